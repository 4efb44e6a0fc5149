"""Smooth motions through given samples (t, q[, v, a])."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, real, vector
from ..exceptions import DimensionError, NonFiniteError, ParameterError
from ..robot.arm_model import ArmModel
from .limits import check_positions, joint_positions, warn_of_speeds
from .reference import Reference, Sampled, SampledTrajectory, integrate_each

Ends: TypeAlias = Literal["clamped", "not-a-knot"]
"""Whether a spline begins and ends at rest, or in the middle of a motion."""

_BETWEEN = np.arange(8) / 8.0  # places in every interval where limits are checked


def samples(
    arm: ArmModel,
    t: ArrayLike,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    *,
    check_limits: bool = True,
) -> SampledTrajectory:
    """Pass smoothly through samples, as a planner or a recording gives them.

    Position, velocity and acceleration are continuous from the first sample to the last. With q alone the motion is
    the cubic spline that begins and ends at rest; with v, and with v and a, the quintic Hermite polynomials through
    them (without a, the accelerations are the means of those that cubic Hermite polynomials have on either side).
    Before the first sample and after the last it is constant. Continuous joints take the short way from sample to
    sample.

    Args:
        arm: The arm.
        t: Times, strictly increasing, shape (n,) with n at least 2 [s].
        q: Configurations, shape (n, nq).
        v: Velocities, shape (n, nv) [rad/s or m/s].
        a: Accelerations, shape (n, nv) [rad/s² or m/s²]; only together with v.
        check_limits: Whether a motion that leaves the position limits is refused, and one that is faster than the
            velocity limits draws a warning.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: Times that do not increase, or accelerations without velocities.
        JointLimitError: The motion leaves the position limits, at a sample or between two.
    """
    times = vector("t", t, None, "n").copy()
    if len(times) < 2:
        raise DimensionError("t", "at least two times", f"{len(times)}")
    if a is not None and v is None:
        raise ParameterError("a", "accelerations without velocities", "given together with v")
    n = len(times)
    start, travelled = _travelled(arm, times, q)
    speeds = None if v is None else _rows("v", v, n, arm.nv)
    rates = None if a is None else _rows("a", a, n, arm.nv)
    trajectory = _Samples(arm, start, _spline(times, travelled, speeds, rates))
    if check_limits:
        trajectory.check_limits()
    return trajectory


def path_through(arm: ArmModel, t: Array, q: ArrayLike) -> SampledTrajectory:
    """Return the cubic spline through samples in the middle of a motion: it neither begins nor ends at rest.

    Args:
        arm: The arm.
        t: Times, at least two [s].
        q: Configurations, shape (n, nq).

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: Times that do not increase.
    """
    start, travelled = _travelled(arm, t, q)
    return _Samples(arm, start, _spline(t, travelled, None, None, "not-a-knot"))


def _travelled(arm: ArmModel, times: Array, q: ArrayLike) -> tuple[Array, Array]:
    """The first configuration, and the way travelled from there at every time."""
    if not (np.diff(times) > 0.0).all():
        i = int(np.argmin(np.diff(times) > 0.0))
        words = f"strictly increasing; t[{i + 1}] = {times[i + 1]:g} follows t[{i}] = {times[i]:g}"
        raise ParameterError("t", f"{len(times)} times", words)
    rows = [
        arm.check_configuration(f"q[{i}]", row)
        for i, row in enumerate(_rows("q", q, len(times), arm.nq))
    ]
    steps = [arm.raw_dynamics.difference(*pair) for pair in pairwise(rows)]
    return rows[0].copy(), np.vstack([np.zeros(arm.nv), np.cumsum(steps, axis=0)])


class _Samples(Sampled):
    """A spline of the way travelled from the first configuration on."""

    def __init__(self, arm: ArmModel, start: Array, spline: Any) -> None:
        self._arm, self._start, self._spline = arm, start, spline

    def __repr__(self) -> str:
        t = self._spline.x
        return f"samples({self._arm.name!r}, {len(t)} from t = {t[0]:g} to {t[-1]:g} s)"

    def sample(self, times: Array) -> Reference:
        first, last = self._spline.x[[0, -1]]
        inside = ((times >= first) & (times <= last))[:, None]
        x = np.clip(times, first, last)
        q = integrate_each(self._arm, self._start[None], self._spline(x))
        return Reference(q, *(np.where(inside, self._spline(x, order), 0.0) for order in (1, 2)))

    def check_limits(self) -> None:
        """Refuse positions beyond the limits, and warn of such speeds."""
        t = self._spline.x
        fine = np.append((t[:-1, None] + np.diff(t)[:, None] * _BETWEEN).ravel(), t[-1])
        start = joint_positions(self._arm, self._start)
        check_positions("the motion through the samples", self._arm, start + self._spline(fine))
        warn_of_speeds("samples", self._arm, np.abs(self._spline(fine, 1)).max(axis=0))


def _spline(t: Array, x: Array, v: Array | None, a: Array | None, ends: Ends = "clamped") -> Any:
    """The piecewise polynomial through x, and v and a where they are given."""
    from scipy import interpolate  # noqa: PLC0415 (takes longer to load than the package itself)

    if v is None:
        return interpolate.CubicSpline(t, x, bc_type=ends)
    if a is None:
        a = _accelerations(t, x, v)
    bernstein = interpolate.BPoly.from_derivatives(t, np.stack([x, v, a], axis=1))
    return interpolate.PPoly.from_bernstein_basis(bernstein)


def _accelerations(t: Array, x: Array, v: Array) -> Array:
    """Accelerations at the samples: means of those of the cubic Hermite polynomials on either side."""
    h, steps = np.diff(t)[:, None], np.diff(x, axis=0)
    at_begin = (6.0 * steps / h - 4.0 * v[:-1] - 2.0 * v[1:]) / h
    at_end = (-6.0 * steps / h + 2.0 * v[:-1] + 4.0 * v[1:]) / h
    return np.vstack([at_begin[:1], (at_begin[1:] + at_end[:-1]) / 2.0, at_end[-1:]])


def _rows(name: str, value: ArrayLike, n: int, width: int) -> Array:
    """A finite matrix of n rows."""
    expected = f"one row for each time, shape ({n}, {width})"
    array = real(name, value, expected)
    if array.shape != (n, width):
        raise DimensionError(name, expected, f"shape {array.shape}")
    if not np.isfinite(array).all():
        raise NonFiniteError(f"{name} (row by row)", np.flatnonzero(~np.isfinite(array)).tolist())
    return array
