"""What a proposal states of the closed loop: estimates from the simulated worst samples, with headroom for others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..control.default_gains import slope_at_zero
from ..law.certificate import Certificate
from .gain_design import Design, DesignTask
from .scan import Scan
from .worst_case import LATE, LATE_AT_LIMITS, ExtremeCase

ERROR_HEADROOM, PEAK_HEADROOM, TIME_HEADROOM = 3.0, 1.5, 1.5
"""Factors on the largest simulated error after convergence, on the largest one before, and on times; other plants
within the ranges may be somewhat worse than the worst simulated ones (docs/robustness.md has the measured ratios)."""

_LEAST_ERROR = 1e-9  # that is stated: below it rounding decides [rad or m]
_SUBSTEPS = 4  # of the simulations


class Stated(NamedTuple):
    """What is stated of every joint; arrays have shape (nv,). Sensor noise is included.

    Attributes:
        error: Largest error abs(e1) after `total_time` [rad or m].
        s_error: Largest abs(s) after `reaching_time` [rad/s or m/s].
        peak: Largest error from the start on [rad or m].
        peak_torque: Largest torque from the start on [N·m or N].
        reaching_time: From then on abs(s) stays within `s_error` [s].
        total_time: From then on abs(e1) stays within `error` [s].
    """

    error: Array
    s_error: Array
    peak: Array
    peak_torque: Array
    reaching_time: Array
    total_time: Array


def stated(
    task: DesignTask,
    design: Design,
    certificate: Certificate | None,
    worst: Sequence[ExtremeCase],
    scanned: Scan | None,
) -> Stated:
    """Return what a proposal states.

    Args:
        task: The requirements.
        design: The gains.
        certificate: Theorem 1 for them; None where there is none.
        worst: The simulated worst samples; one that diverged says nothing.
        scanned: Short runs of all samples; None where there are none.
    """
    sound = [case for case in worst if np.isfinite(case.error).all()]
    infinite = np.full(design.k1.shape, np.inf)
    if not sound or certificate is None:
        return Stated(design.error, *[infinite] * 5)
    after = (LATE if task.limits is None else LATE_AT_LIMITS) * task.duration
    runs = [(case.result.t, np.abs(case.true_error), np.abs(case.result.s)) for case in sound]
    floor = _floor(task, design)
    late = np.max([e1[t >= after].max(axis=0) for t, e1, _ in runs], axis=0)
    most = np.maximum(task.accuracy, 2.0 * late)
    error = floor + np.minimum(ERROR_HEADROOM * late, most)
    least_s = slope_at_zero(design.surface, len(floor)) * floor
    s_error = least_s + ERROR_HEADROOM * np.max(
        [s[t >= after].max(axis=0) for t, _, s in runs], axis=0
    )
    reached = np.max([_last_beyond(s, s_error, t) for t, _, s in runs], axis=0)
    settled = np.max([_last_beyond(e1, error, t) for t, e1, _ in runs], axis=0)
    peaks, torques = [case.peak for case in sound], [case.peak_torque for case in sound]
    if scanned is not None:
        peaks, torques = [*peaks, scanned.peak], [*torques, scanned.peak_torque]
    return Stated(
        error=error,
        s_error=s_error,
        peak=error + PEAK_HEADROOM * np.max(peaks, axis=0),
        peak_torque=PEAK_HEADROOM * np.max(torques, axis=0),
        reaching_time=np.maximum(TIME_HEADROOM * reached, certificate.reaching_time),
        total_time=np.maximum(TIME_HEADROOM * settled, certificate.total_time),
    )


def _floor(task: DesignTask, design: Design) -> Array:
    """What the steps of the simulated plant make of an error, shape (nv,): h·abs(a)/2 over the slope of the surface."""
    times = np.linspace(0.0, task.duration, 50).tolist()
    a = np.max([np.abs(task.trajectory(t).a) for t in times], axis=0)
    slope = slope_at_zero(design.surface, len(a))
    floor: Array = _LEAST_ERROR + task.dt / _SUBSTEPS * a / (2.0 * slope)
    return floor


def _last_beyond(x: Array, bound: Array, t: Array) -> Array:
    """The last time at which each joint is beyond its bound, shape (nv,)."""
    times: Array = np.where(x > bound, t[:, None], 0.0).max(axis=0)
    return times
