"""Motions by formula: hold, oscillate, move from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive, real, vector
from ..exceptions import DimensionError, ParameterError
from ..robot.arm_model import ArmModel
from .limits import amplitude_within_limits, check_positions, joint_positions, warn_of_speeds
from .reference import Reference, Sampled, SampledTrajectory, difference_each, integrate_each


def hold(
    arm: ArmModel, q: ArrayLike | None = None, *, check_limits: bool = True
) -> SampledTrajectory:
    """Stay at a configuration.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,); `arm.ready` by default.
        check_limits: Whether a configuration outside the position limits is refused.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: q holds NaN or infinity.
        JointLimitError: q lies outside the position limits.
    """
    q = np.array(arm.ready if q is None else arm.check_configuration("q", q))
    if check_limits:
        check_positions("q", arm, joint_positions(arm, q))
    return _Hold(arm.name, q, np.zeros(arm.nv))


def cosine(
    arm: ArmModel,
    *,
    center: ArrayLike | None = None,
    amplitude: ArrayLike | None = None,
    period: ArrayLike = 6.0,
    check_limits: bool = True,
) -> SampledTrajectory:
    """Swing every joint about a centre: q_d(t) = center (+) amplitude·cos(2πt/period).

    Args:
        arm: The arm.
        center: Configuration, shape (nq,), or a scalar for all joints of an arm without continuous joints;
            `arm.ready` by default.
        amplitude: Scalar or (nv,) [rad or m]; by default 0.2, and less where a limit is near: see
            `amplitude_within_limits`.
        period: Scalar or (nv,), positive [s].
        check_limits: Whether a motion that leaves the position limits is refused, and one that is faster than the
            velocity limits draws a warning.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: A period that is not positive.
        JointLimitError: The motion leaves the position limits.
    """
    middle = _center(arm, center)
    periods = positive("period", period, arm.nv)
    if amplitude is None:
        amplitude = amplitude_within_limits(arm, middle, period=float(periods.min()))
    swing = vector("amplitude", _spread("amplitude", amplitude, arm.nv), arm.nv).copy()
    omega = 2.0 * np.pi / periods
    if check_limits:
        x, reach = joint_positions(arm, middle), np.abs(swing)
        check_positions("center ± amplitude", arm, np.array([x - reach, x + reach]))
        warn_of_speeds("cosine", arm, swing * omega)
    return _Cosine(arm, middle, swing, omega)


def waypoints(
    arm: ArmModel,
    configurations: Sequence[ArrayLike],
    times: Sequence[float],
    *,
    check_limits: bool = True,
) -> SampledTrajectory:
    """Pass through configurations at given times, at rest in each, with continuous acceleration.

    Between two of them the motion is the minimum-jerk polynomial along the shortest way (continuous joints take the
    short way round); before the first and after the last it is constant. `samples` passes through without stopping.

    Args:
        arm: The arm.
        configurations: At least two configurations, each of shape (nq,).
        times: One time for each, strictly increasing [s].
        check_limits: Whether a configuration outside the position limits is refused, and a motion that is faster than
            the velocity limits draws a warning.

    Raises:
        DimensionError: Wrong shape or kind, or not one time for each configuration.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: Times that do not increase.
        JointLimitError: A configuration lies outside the position limits.
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
    rows = np.array(knots)
    steps = difference_each(arm, rows[:-1], rows[1:])
    if check_limits:
        for i, q in enumerate(knots):
            check_positions(f"configurations[{i}]", arm, joint_positions(arm, q))
        speeds = _MINIMUM_JERK_PEAK * np.abs(steps) / np.diff(instants)[:, None]
        warn_of_speeds("waypoints", arm, speeds.max(axis=0))
    return _Waypoints(arm, rows, steps, instants)


_MINIMUM_JERK_PEAK = (
    15.0 / 8.0
)  # largest speed of the minimum-jerk polynomial, relative to its mean


class _Hold:
    def __init__(self, name: str, q: Array, rest: Array) -> None:
        self._name, self._q, self._rest = name, q, rest

    def __repr__(self) -> str:
        return f"hold({self._name!r}, q={np.array2string(self._q, precision=3, separator=', ')})"

    def __call__(self, t: float) -> Reference:
        del t
        return Reference(self._q.copy(), self._rest.copy(), self._rest.copy())

    def sample(self, times: Array) -> Reference:
        del times
        return Reference(self._q[None].copy(), self._rest[None].copy(), self._rest[None].copy())


class _Cosine(Sampled):
    def __init__(self, arm: ArmModel, middle: Array, swing: Array, omega: Array) -> None:
        self._arm, self._middle, self._swing, self._omega = arm, middle, swing, omega
        self._rates, self._rate_of_joint = np.unique(omega, return_inverse=True)

    def __repr__(self) -> str:
        amplitude, period = span(self._swing), span(2.0 * np.pi / self._omega)
        return f"cosine({self._arm.name!r}, amplitude={amplitude}, period={period} s)"

    def sample(self, times: Array) -> Reference:
        swing, omega, phase = self._swing, self._omega, times[:, None] * self._rates
        cos, sin = np.cos(phase), np.sin(phase)
        if len(self._rates) > 1:
            cos, sin = cos[:, self._rate_of_joint], sin[:, self._rate_of_joint]
        q = integrate_each(self._arm, self._middle[None], swing * cos)
        return Reference(q, -swing * omega * sin, -swing * omega**2 * cos)


class _Waypoints(Sampled):
    def __init__(self, arm: ArmModel, knots: Array, steps: Array, instants: Array) -> None:
        self._arm, self._knots, self._steps, self._instants = arm, knots, steps, instants

    def __repr__(self) -> str:
        first, last = self._instants[0], self._instants[-1]
        return f"waypoints({self._arm.name!r}, {len(self._knots)} from t = {first:g} to {last:g} s)"

    def sample(self, times: Array) -> Reference:
        instants, steps = self._instants, self._steps
        i = np.clip(np.searchsorted(instants, times, side="right") - 1, 0, len(steps) - 1)
        duration = (instants[i + 1] - instants[i])[:, None]
        x = np.clip((times - instants[i])[:, None] / duration, 0.0, 1.0)
        blend = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / duration
        curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2
        q = integrate_each(self._arm, self._knots[i], blend * steps[i])
        return Reference(q, rate * steps[i], curvature * steps[i])


def span(values: Array) -> str:
    """Return numbers as "0.2", or "0.1…0.2" where they differ."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:.4g}" if low == high else f"{low:.4g}…{high:.4g}"


def _center(arm: ArmModel, center: ArrayLike | None) -> Array:
    if center is None:
        return np.array(arm.ready)
    if arm.nq == arm.nv and np.isscalar(center):
        center = np.full(arm.nq, center)
    return np.array(arm.check_configuration("center", center))


def _spread(name: str, value: ArrayLike, nv: int) -> Array:
    return per_joint(name, real(name, value, "a number or one for each joint"), nv)
