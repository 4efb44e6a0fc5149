"""Motions for the bounds: on a trajectory, and near it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array, positive_number, size
from .._common.brief import brief_repr
from ..robot.arm_model import ArmModel
from ..trajectories import Reference, Trajectory


@brief_repr()
@dataclass(frozen=True)
class MotionMargin:
    """How far motions leave the trajectory: tracking errors, and what pushes do to the impedance reference.

    A push that swings the reference at the frequency ω = acceleration/velocity also makes the acceleration change, at
    up to ω·acceleration. Bounds that are to hold while the arm is pushed need the acceleration that pushes cause,
    about force·lever/M_d.

    Attributes:
        position: At most this far [rad or m].
        velocity: At most this much faster or slower, positive [rad/s or m/s].
        acceleration: At most this much more or less [rad/s² or m/s²].

    Raises:
        ParameterError: A spread that cannot be.
    """

    position: float = 0.05
    velocity: float = 0.1
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        """Check the three sizes."""
        size("position", self.position)
        positive_number("velocity", self.velocity, "spread in rad/s")
        size("acceleration", self.acceleration)


class Motion(NamedTuple):
    """A motion at one instant, and a period later.

    Attributes:
        now: Configuration, velocity and acceleration.
        then: The same one period later.
    """

    now: Reference
    then: Reference


def sample_motions(
    arm: ArmModel,
    trajectory: Trajectory,
    duration: float,
    dt: float,
    count: int,
    seed: int,
    spread: MotionMargin,
) -> tuple[Motion, ...]:
    """Return motions on the trajectory and around it, spread over its duration.

    Args:
        arm: The arm.
        trajectory: Desired motion.
        duration: Length of it that counts [s].
        dt: Control period [s].
        count: How many instants; each gives one motion on the trajectory and one near it.
        seed: Of the deviations.
        spread: How far from it.
    """
    rng = np.random.default_rng(seed)
    size = np.array([spread.position, spread.velocity, spread.acceleration])[:, None]
    jerk = spread.acceleration**2 / spread.velocity
    motions = []
    for t in np.linspace(0.0, duration, count).tolist():
        now, then = trajectory(t), trajectory(t + dt)
        q, v, a = size * rng.uniform(-1.0, 1.0, (3, arm.nv))
        a_then = a + dt * jerk * rng.choice([-1.0, 1.0], arm.nv)
        motions.append(Motion(now, then))
        motions.append(
            Motion(_beside(arm, now, q, v, a), _beside(arm, then, q + dt * v, v + dt * a, a_then))
        )
    return tuple(motions)


def _beside(arm: ArmModel, reference: Reference, q: Array, v: Array, a: Array) -> Reference:
    """A motion that differs from a reference by q, v and a, each of shape (nv,)."""
    return Reference(
        arm.raw_dynamics.integrate(reference.q, q), reference.v + v, np.asarray(reference.a + a)
    )
