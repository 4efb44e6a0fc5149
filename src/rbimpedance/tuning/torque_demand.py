"""What a motion asks of the actuators over every plant that an uncertainty allows, and what the actuators have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from ..law.limits import Limits
from ..trajectories import Reference, Trajectory
from .plant_sample import PlantSample

RESERVE_ACCELERATION = 0.5
"""Acceleration that a joint should have left at the most strenuous instant, to converge with [rad/s² or m/s²]."""

NEAR_THE_LIMIT = 0.7
"""Share of a limit from which a joint's most strenuous plant is among the simulated ones."""

_STEP = 0.01  # between instants [s]
_INSTANTS = (100, 2000)  # fewest and most


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueDemand:
    """What a motion asks of each joint against its limits; arrays have shape (nv,).

    Torque is linear in payload, link inertia, friction and armature, so that its largest value is at a corner of
    their ranges; every corner that `Uncertainty.extremes` gives is among the plants that this is taken over.

    Attributes:
        needed: Largest torque that is needed by the motion, by the acceleration that pushes cause (`MotionMargin`)
            and by the sensors' noise [N·m or N].
        reserve: What is wanted beyond that to converge, the torque for `RESERVE_ACCELERATION`; where a limit leaves
            less, simulation decides [N·m or N].
        limit: What the joint has; infinite where there is no limit [N·m or N].
        rate_needed: Largest change of the motion's torque in a second [N·m/s or N/s].
        rate_limit: What the joint allows; infinite where there is no limit [N·m/s or N/s].
        time: When the motion asks most of the joint [s].
        plants: The plant that asks most of each joint.
    """

    needed: Array
    reserve: Array
    limit: Array
    rate_needed: Array
    rate_limit: Array
    time: Array
    plants: tuple[PlantSample, ...]

    @property
    def lack(self) -> Array:
        """Torque that each joint lacks: needed - limit where that is positive, else 0 [N·m or N]."""
        return np.maximum(self.needed - self.limit, 0.0)

    @property
    def rate_lack(self) -> Array:
        """Torque rate that each joint lacks, else 0 [N·m/s or N/s]."""
        return np.maximum(self.rate_needed - self.rate_limit, 0.0)

    @property
    def feasible(self) -> bool:
        """Whether no joint lacks anything."""
        return not (self.lack.any() or self.rate_lack.any())

    @property
    def with_reserve(self) -> bool:
        """Whether no joint lacks anything even with the reserve."""
        enough = (self.needed + self.reserve <= self.limit).all()
        return bool(enough) and not self.rate_lack.any()

    @property
    def share(self) -> Array:
        """Part of its limits that each joint needs; more than 1 is more than it has."""
        share: Array = np.maximum(self.needed / self.limit, self.rate_needed / self.rate_limit)
        return share

    @property
    def strenuous(self) -> tuple[PlantSample, ...]:
        """The plants that bring a joint near its limits, each once."""
        near = np.flatnonzero(self.share > NEAR_THE_LIMIT)
        return tuple({id(plant): plant for plant in (self.plants[i] for i in near)}.values())


class Exertion:
    """The torques of a motion for plants, kept so that slower motion costs no further dynamics.

    Attributes:
        times: Instants, shape (N,) [s].
        inertia: Largest magnitude of every entry of the mass matrix, shape (nv, nv).
    """

    def __init__(
        self, plants: Sequence[PlantSample], trajectory: Trajectory, duration: float
    ) -> None:
        self.plants = tuple(plants)
        count = int(np.clip(duration / _STEP, *_INSTANTS))
        self.times = np.linspace(0.0, duration, count)
        self._motion = [trajectory(t) for t in self.times.tolist()]
        few = self._motion[:: count // 25]
        sizes = [
            np.abs(sample.plant.raw_dynamics.mass_matrix(now.q) / sample.torque_constant[:, None])
            for sample in self.plants
            for now in few
        ]
        self.inertia: Array = np.max(sizes, axis=0)
        resting, moving = zip(*(self._torques(sample) for sample in self.plants), strict=True)
        self._resting, self._moving = np.array(resting), np.array(moving)

    def torque(self, slower: float = 1.0) -> Array:
        """Torque that is needed with the motion slowed down, shape (plants, N, nv) [N·m or N].

        Args:
            slower: Factor on the motion's time; torque without friction is g(q) + (M a + C v)/slower².
        """
        v = np.array([now.v for now in self._motion]) / slower
        friction = [s.plant.raw_dynamics.friction(v) / s.torque_constant for s in self.plants]
        torque: Array = self._resting + self._moving / slower**2 + np.array(friction)
        return torque

    def _torques(self, sample: PlantSample) -> tuple[Array, Array]:
        """Torque at rest, and what inertia adds, each of shape (N, nv)."""
        dynamics, zero = sample.plant.raw_dynamics, np.zeros(sample.plant.nv)
        resting = np.array([dynamics.bias(now.q, zero) for now in self._motion])
        whole = np.array(
            [dynamics.inverse_dynamics(*now) - dynamics.friction(now.v) for now in self._motion]
        )
        return resting / sample.torque_constant, (whole - resting) / sample.torque_constant

    def demand(
        self, limits: Limits, *, push: float = 0.0, noise: Array | float = 0.0, slower: float = 1.0
    ) -> TorqueDemand:
        """Compare the needed torque with the limits.

        Args:
            limits: Of the actuators.
            push: Acceleration that pushes add on every joint at once [rad/s² or m/s²].
            noise: Torque caused by sensor noise, scalar or (nv,) [N·m or N].
            slower: Factor on the motion's time.
        """
        nv = len(self.inertia)
        size = np.abs(torque := self.torque(slower))
        step = slower * (self.times[1] - self.times[0])
        most = size.max(axis=1)
        worst = most.argmax(axis=0)
        instants = size[worst, :, np.arange(nv)].argmax(axis=1)
        return TorqueDemand(
            needed=most.max(axis=0) + push * self.inertia.sum(axis=1) + noise,
            reserve=RESERVE_ACCELERATION * np.diag(self.inertia),
            limit=np.broadcast_to(limits.effort, nv).copy(),
            rate_needed=np.abs(np.diff(torque, axis=1)).max(axis=(0, 1)) / step,
            rate_limit=np.broadcast_to(limits.rate, nv).copy(),
            time=slower * self.times[instants],
            plants=tuple(self.plants[i] for i in worst),
        )


def slowed(trajectory: Trajectory, factor: float) -> Trajectory:
    """Return the same motion, slower.

    Args:
        trajectory: The motion.
        factor: On its time: 2 takes twice as long, with half the speed and a quarter of the acceleration.
    """

    def slow(t: float) -> Reference:
        q, v, a = trajectory(t / factor)
        return Reference(q, v / factor, a / factor**2)

    return slow
