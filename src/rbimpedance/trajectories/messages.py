"""Samples as other programs write them: CSV files, and messages of the shape of ROS' JointTrajectory."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from .._common.arrays import Array, real
from .._common.suggestions import suggest
from ..exceptions import InputError
from ..robot.arm_model import ArmModel
from .reference import SampledTrajectory, integrate_each
from .samples import samples

_ENDINGS = ("", "_v", "_a")  # of a joint's columns: position, velocity, acceleration


def from_csv(
    arm: ArmModel, path: str | os.PathLike[str], *, check_limits: bool = True
) -> SampledTrajectory:
    """Pass smoothly through the samples of a CSV file; see `samples`.

    The first line names the columns: `t` [s], `<joint>` for positions, and if they are known `<joint>_v` and
    `<joint>_a` [rad or m, per second, per second²], in any order. Lines that begin with # are comments.

    Args:
        arm: The arm; each of its joints needs a column. A continuous joint's position is its angle.
        path: The file.
        check_limits: See `samples`.

    Raises:
        InputError: The file cannot be read, a column is missing or is not known, or an entry is no number; and as
            `samples`.
        ParameterError: Times that do not increase.
    """
    columns = _read_columns(Path(path))
    known = {"t", *(name + ending for name in arm.joint_names for ending in _ENDINGS)}
    for name in columns:
        if name not in known:
            raise InputError(
                f"'{path}' has a column '{name}' that is not a joint of '{arm.name}'{suggest(name, known)}"
            )
    parts = [
        _joined(str(path), columns, [name + ending for name in arm.joint_names], ending != "")
        for ending in _ENDINGS
    ]
    (t,) = _joined(str(path), columns, ["t"], False).T
    return _samples(arm, t, parts, check_limits)


def from_joint_trajectory(
    arm: ArmModel, message: object, *, check_limits: bool = True
) -> SampledTrajectory:
    """Pass smoothly through the points of a message of the shape of ROS' `trajectory_msgs/JointTrajectory`.

    Args:
        arm: The arm.
        message: Has `joint_names`, in any order, and `points` with `positions`, `time_from_start` and, empty or for
            every point, `velocities` and `accelerations`; as attributes, or as keys of dictionaries. A time is a number
            of seconds, a `timedelta`, or has `sec` and `nanosec` (ROS 2) or `secs` and `nsecs` (ROS 1).
        check_limits: See `samples`.

    Raises:
        InputError: Names that are not the arm's, or points of wrong shape; and as `samples`.
        ParameterError: Times that do not increase.
    """
    names, points = list(_get(message, "joint_names")), list(_get(message, "points"))
    order = _order(arm, names)
    t = np.array([_seconds(_get(point, "time_from_start")) for point in points])
    parts = [
        _part(points, field, len(names), order)
        for field in ("positions", "velocities", "accelerations")
    ]
    return _samples(arm, t, parts, check_limits)


def _samples(
    arm: ArmModel, t: Array, parts: Sequence[Array | None], check: bool
) -> SampledTrajectory:
    positions, v, a = parts
    if positions is None:
        raise InputError("the points have no positions")
    q = integrate_each(arm, arm.zero[None], positions)
    return samples(arm, t, q, v, a, check_limits=check)


def _read_columns(path: Path) -> dict[str, Array]:
    """The columns of a CSV file by name."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"'{path}' cannot be read as a CSV file: {error}") from error
    table = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    if len(table) < 2:
        raise InputError(
            f"'{path}' has no samples: a line of names and at least two lines of numbers are needed"
        )
    names = [name.strip() for name in table[0]]
    if len(set(names)) != len(names):
        raise InputError(f"'{path}' names a column twice")
    for i, row in enumerate(table):
        if len(row) != len(names):
            raise InputError(f"'{path}', row {i}: {len(row)} entries for {len(names)} columns")
    try:
        values = np.array(table[1:], dtype=np.float64)
    except ValueError as error:
        raise InputError(f"'{path}' has an entry that is not a number: {error}") from error
    return dict(zip(names, values.T, strict=True))


def _joined(path: str, columns: Mapping[str, Array], names: list[str], may_miss: bool) -> Any:
    """Columns side by side; None where all are missing and may be."""
    missing = [name for name in names if name not in columns]
    if missing and (not may_miss or len(missing) < len(names)):
        raise InputError(f"'{path}' has no column '{missing[0]}'{suggest(missing[0], columns)}")
    return None if missing else np.column_stack([columns[name] for name in names])


def _order(arm: ArmModel, names: list[str]) -> list[int]:
    """Where the arm's joints stand in a message."""
    for name in names:
        if name not in arm.joint_names:
            raise InputError(
                f"joint_names has '{name}', which is not a joint of '{arm.name}'{suggest(name, arm.joint_names)}"
            )
    for name in arm.joint_names:
        if names.count(name) != 1:
            raise InputError(f"joint_names has joint '{name}' {names.count(name)} times, not once")
    return [names.index(name) for name in arm.joint_names]


def _part(points: list[Any], field: str, width: int, order: list[int]) -> Array | None:
    """One field of all points, shape (n, nv); None where it is empty everywhere."""
    rows = [_get(point, field, ()) for point in points]
    if all(len(row) == 0 for row in rows):
        return None
    for i, row in enumerate(rows):
        if len(row) != width:
            raise InputError(f"points[{i}].{field} has {len(row)} entries for {width} joint names")
    return real(field, np.array(rows), "numbers")[:, order]


_REQUIRED = object()


def _get(part: Any, name: str, default: Any = _REQUIRED) -> Any:
    """An attribute, or what a dictionary has under that key."""
    value = part.get(name, default) if isinstance(part, Mapping) else getattr(part, name, default)
    if value is _REQUIRED:
        raise InputError(
            f"a {type(part).__name__} without '{name}' is not a part of a JointTrajectory"
        )
    return value


def _seconds(time: Any) -> float:
    if isinstance(time, timedelta):
        return time.total_seconds()
    if isinstance(time, int | float | np.number):
        return float(time)
    sec = _get(time, "sec", None)
    if sec is not None:
        return float(sec) + 1e-9 * float(_get(time, "nanosec", 0))
    return float(_get(time, "secs")) + 1e-9 * float(_get(time, "nsecs", 0))
