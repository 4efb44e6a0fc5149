"""The times of a run, and trajectories sampled ahead of it, checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arrays import Array
from ..control.errors import check_reference
from ..robot.arm_model import ArmModel
from ..trajectories import Reference, SampledTrajectory, Trajectory


def sample(arm: ArmModel, trajectory: Trajectory, times: Array) -> Reference:
    """Return the desired motion at n times: arrays of n rows, or all of one row where nothing changes.

    Args:
        arm: The arm that is to move.
        trajectory: The trajectory; one with its own `sample` is evaluated at once.
        times: The times, shape (n,) [s].

    Raises:
        DimensionError: A reference of wrong shape or kind.
        NonFiniteError: One that holds NaN or infinity.
    """
    widths = (arm.nq, arm.nv, arm.nv)
    if isinstance(trajectory, SampledTrajectory):
        rows = [_rows(part) for part in trajectory.sample(times)]
        if [x.shape for x in rows] in ([(n, w) for w in widths] for n in (1, len(times))):
            return Reference(*rows)
    samples = [trajectory(t) for t in times.tolist()]
    rows = [_rows([_part(reference, i) for reference in samples]) for i in range(3)]
    if [x.shape for x in rows] != [(len(times), width) for width in widths]:
        checked = [check_reference(arm, reference) for reference in samples]
        rows = [_rows(parts) for parts in zip(*checked, strict=True)]
    return Reference(*rows)


def tick_times(ticks: range, dt: float) -> Array:
    """Return the times k·dt of some ticks [s].

    Args:
        ticks: The ticks.
        dt: Control period [s].
    """
    return np.asarray(np.arange(ticks.start, ticks.stop, ticks.step) * dt, dtype=np.float64)


def _part(reference: Any, i: int) -> Any:
    return reference[i] if isinstance(reference, tuple) else None


def _rows(parts: Any) -> Array:
    """The parts as rows of float64, or nothing where they are no such rows."""
    try:
        rows = np.asarray(parts)
    except ValueError:
        return np.empty(0)
    if rows.dtype.kind not in "fiu":
        return np.empty(0)
    return np.ascontiguousarray(rows, dtype=np.float64)
