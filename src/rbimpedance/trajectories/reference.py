"""What a trajectory is: a callable t -> `Reference`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..robot.arm_model import ArmModel


@brief_repr()
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


@runtime_checkable
class SampledTrajectory(Protocol):
    """A trajectory that gives many samples at once, in less time than one by one; those of this room do."""

    def __call__(self, t: float) -> Reference:
        """Return the desired motion at a time [s]."""

    def sample(self, times: Array) -> Reference:
        """Return the desired motion at n times [s]: arrays of n rows, or of one row for all where nothing changes."""


class Sampled:
    """Base of trajectories that compute many samples as cheaply as one."""

    def __call__(self, t: float) -> Reference:
        """Return the desired motion at a time [s]."""
        return Reference(*(x[0] for x in self.sample(np.array([t]))))

    def sample(self, times: Array) -> Reference:
        """Return the desired motion at n times [s]; see `SampledTrajectory.sample`."""
        raise NotImplementedError


def integrate_each(arm: ArmModel, q: Array, steps: Array) -> Array:
    """Return q (+) step row by row; one row of q does for all.

    Args:
        arm: The arm.
        q: Configurations, shape (n, nq) or (1, nq).
        steps: Tangent vectors, shape (n, nv) [rad or m].
    """
    if arm.nq == arm.nv:
        return np.asarray(q + steps)
    q = np.broadcast_to(q, (len(steps), arm.nq))
    return np.array([arm.raw_dynamics.integrate(*row) for row in zip(q, steps, strict=True)])


def difference_each(arm: ArmModel, q0: Array, q1: Array) -> Array:
    """Return q1 (-) q0 row by row, shape (n, nv) [rad or m].

    Args:
        arm: The arm.
        q0: Configurations, shape (n, nq).
        q1: Configurations, shape (n, nq).
    """
    if arm.nq == arm.nv:
        return np.asarray(q1 - q0)
    return np.array([arm.raw_dynamics.difference(*row) for row in zip(q0, q1, strict=True)])
