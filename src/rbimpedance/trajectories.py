"""References for the controller: a trajectory is a callable t -> `Reference`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, per_joint, positive, real, vector
from .dynamics import ArmModel
from .exceptions import DimensionError, GainError


class Reference(NamedTuple):
    """Desired motion at one instant.

    Attributes:
        q: Configuration q_d, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
        a: Acceleration, shape (nv,) [rad/s² or m/s²].
    """

    q: Array
    v: Array
    a: Array


Trajectory: TypeAlias = Callable[[float], Reference]
"""Maps a time [s] to the desired motion."""


def hold(arm: ArmModel, q: ArrayLike | None = None) -> Trajectory:
    """Stay at a configuration.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,); `arm.neutral` by default.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: q holds NaN or infinity.
    """
    q = np.array(arm.neutral if q is None else arm.check_configuration("q", q))
    rest = np.zeros(arm.nv)

    def trajectory(t: float) -> Reference:
        del t
        return Reference(q.copy(), rest.copy(), rest.copy())

    return trajectory


def cosine(
    arm: ArmModel,
    *,
    center: ArrayLike | None = None,
    amplitude: ArrayLike,
    period: ArrayLike,
) -> Trajectory:
    """Swing every joint about a centre: q_d(t) = center (+) amplitude·cos(2πt/period).

    Args:
        arm: The arm.
        center: Configuration, shape (nq,), or a scalar for all joints of an arm without continuous joints;
            `arm.neutral` by default.
        amplitude: Scalar or (nv,) [rad or m].
        period: Scalar or (nv,), positive [s].

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        GainError: A period that is not positive.
    """
    middle = _center(arm, center)
    swing = vector("amplitude", _spread("amplitude", amplitude, arm.nv), arm.nv).copy()
    omega = 2.0 * np.pi / per_joint("period", positive("period", period), arm.nv)

    def trajectory(t: float) -> Reference:
        cos, sin = np.cos(omega * t), np.sin(omega * t)
        q = arm.unchecked.integrate(middle, swing * cos)
        return Reference(q, -swing * omega * sin, -swing * omega**2 * cos)

    return trajectory


def waypoints(
    arm: ArmModel, configurations: Sequence[ArrayLike], times: Sequence[float]
) -> Trajectory:
    """Pass through configurations at given times, at rest in each, with continuous acceleration.

    Between two of them the motion is the minimum-jerk polynomial along the shortest way (continuous joints take the
    short way round); before the first and after the last it stands still.

    Args:
        arm: The arm.
        configurations: At least two configurations, each of shape (nq,).
        times: One time for each, strictly increasing [s].

    Raises:
        DimensionError: Wrong shape or kind, or not one time for each configuration.
        NonFiniteError: An input holds NaN or infinity.
        GainError: Times that do not increase.
    """
    knots = [
        np.array(arm.check_configuration(f"configurations[{i}]", q))
        for i, q in enumerate(configurations)
    ]
    instants = vector("times", times, None, "number of waypoints").copy()
    if len(knots) < 2 or len(knots) != len(instants):
        raise DimensionError(
            "times",
            "one for each of at least two configurations",
            f"{len(instants)} for {len(knots)}",
        )
    if not (np.diff(instants) > 0.0).all():
        raise GainError("times", list(times), "strictly increasing")
    steps = [arm.unchecked.difference(a, b) for a, b in pairwise(knots)]

    def trajectory(t: float) -> Reference:
        i = int(np.clip(np.searchsorted(instants, t, side="right") - 1, 0, len(steps) - 1))
        duration = instants[i + 1] - instants[i]
        x = float(np.clip((t - instants[i]) / duration, 0.0, 1.0))
        blend = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / duration
        curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2
        q = arm.unchecked.integrate(knots[i], blend * steps[i])
        return Reference(q, rate * steps[i], curvature * steps[i])

    return trajectory


def _center(arm: ArmModel, center: ArrayLike | None) -> Array:
    if center is None:
        return np.array(arm.neutral)
    if arm.nq == arm.nv and np.isscalar(center):
        center = np.full(arm.nq, center)
    return np.array(arm.check_configuration("center", center))


def _spread(name: str, value: ArrayLike, nv: int) -> Array:
    return per_joint(name, real(name, value, "a number or one for each joint"), nv)
