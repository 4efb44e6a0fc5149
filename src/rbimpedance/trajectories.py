"""References for the controller: a trajectory is a callable t -> `Reference`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ._common.arrays import Array, per_joint, positive, real, vector
from .exceptions import DimensionError, ParameterError
from .robot.arm_model import ArmModel


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
    """A trajectory that gives many samples at once, in less time than one by one; those of this module do."""

    def __call__(self, t: float) -> Reference:
        """Return the desired motion at a time [s]."""

    def sample(self, times: Array) -> Reference:
        """Return the desired motion at n times [s]: arrays of n rows, or of one row for all where nothing changes."""


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
    return _Hold(q, np.zeros(arm.nv))


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
        ParameterError: A period that is not positive.
    """
    middle = _center(arm, center)
    swing = vector("amplitude", _spread("amplitude", amplitude, arm.nv), arm.nv).copy()
    omega = 2.0 * np.pi / per_joint("period", positive("period", period), arm.nv)
    return _Cosine(arm, middle, swing, omega)


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
        ParameterError: Times that do not increase.
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
        raise ParameterError("times", list(times), "strictly increasing")
    steps = [arm.raw_dynamics.difference(a, b) for a, b in pairwise(knots)]
    return _Waypoints(arm, np.array(knots), np.array(steps), instants)


class _Hold:
    def __init__(self, q: Array, rest: Array) -> None:
        self._q, self._rest = q, rest

    def __call__(self, t: float) -> Reference:
        del t
        return Reference(self._q.copy(), self._rest.copy(), self._rest.copy())

    def sample(self, times: Array) -> Reference:
        del times
        return Reference(self._q[None].copy(), self._rest[None].copy(), self._rest[None].copy())


class _Cosine:
    def __init__(self, arm: ArmModel, middle: Array, swing: Array, omega: Array) -> None:
        self._arm, self._middle, self._swing, self._omega = arm, middle, swing, omega
        self._rates, self._rate_of_joint = np.unique(omega, return_inverse=True)

    def __call__(self, t: float) -> Reference:
        return Reference(*(x[0] for x in self.sample(np.array([t]))))

    def sample(self, times: Array) -> Reference:
        swing, omega, phase = self._swing, self._omega, times[:, None] * self._rates
        cos, sin = np.cos(phase), np.sin(phase)
        if len(self._rates) > 1:
            cos, sin = cos[:, self._rate_of_joint], sin[:, self._rate_of_joint]
        q = _integrate_each(self._arm, self._middle[None], swing * cos)
        return Reference(q, -swing * omega * sin, -swing * omega**2 * cos)


class _Waypoints:
    def __init__(self, arm: ArmModel, knots: Array, steps: Array, instants: Array) -> None:
        self._arm, self._knots, self._steps, self._instants = arm, knots, steps, instants

    def __call__(self, t: float) -> Reference:
        return Reference(*(x[0] for x in self.sample(np.array([t]))))

    def sample(self, times: Array) -> Reference:
        instants, steps = self._instants, self._steps
        i = np.clip(np.searchsorted(instants, times, side="right") - 1, 0, len(steps) - 1)
        duration = (instants[i + 1] - instants[i])[:, None]
        x = np.clip((times - instants[i])[:, None] / duration, 0.0, 1.0)
        blend = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / duration
        curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2
        q = _integrate_each(self._arm, self._knots[i], blend * steps[i])
        return Reference(q, rate * steps[i], curvature * steps[i])


def _integrate_each(arm: ArmModel, q: Array, steps: Array) -> Array:
    """Row by row q (+) step; one row of q does for all."""
    if arm.nq == arm.nv:
        return np.asarray(q + steps)
    q = np.broadcast_to(q, (len(steps), arm.nq))
    return np.array([arm.raw_dynamics.integrate(*row) for row in zip(q, steps, strict=True)])


def _center(arm: ArmModel, center: ArrayLike | None) -> Array:
    if center is None:
        return np.array(arm.neutral)
    if arm.nq == arm.nv and np.isscalar(center):
        center = np.full(arm.nq, center)
    return np.array(arm.check_configuration("center", center))


def _spread(name: str, value: ArrayLike, nv: int) -> Array:
    return per_joint(name, real(name, value, "a number or one for each joint"), nv)
