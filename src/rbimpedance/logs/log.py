"""`Log`: what a robot measured, from any of the usual files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, real
from .._common.suggestions import suggest
from ..exceptions import DimensionError, LogError, ParameterError
from ..robot.arm_model import ArmModel
from . import formats
from .arm_log import ArmLog, on_arm
from .findings import DEGREE, LogFinding, checked
from .samples import CHANNELS, Samples, Stamps, to_seconds, to_stamps


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """What a robot measured, sample by sample; the first axis of every array is time.

    Attributes:
        stamps: Times, shape (N,), whole numbers that increase [ns].
        joint_names: Names of the n joints, in the order of the columns.
        position: Joint positions, shape (N, n) [rad or m].
        velocity: Joint velocities, shape (N, n) [rad/s or m/s]; None where they were not measured, as for the others.
        effort: Motor torques, shape (N, n) [N·m or N].
        external: Torques of the environment, shape (N, n) [N·m or N].
        wrench: Wrench at the tool, force and moment, shape (N, 6) [N, N·m].
        findings: What was found when it was read, and what was done about it.
        source: Where it is from.
    """

    stamps: Stamps
    joint_names: tuple[str, ...]
    position: Array
    velocity: Array | None
    effort: Array | None
    external: Array | None
    wrench: Array | None
    findings: tuple[LogFinding, ...]
    source: str

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        position: ArrayLike,
        *,
        joint_names: Sequence[str],
        velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        external: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        drop_invalid: bool = False,
    ) -> Log:
        """Return a log of given arrays.

        Args:
            t: Times, shape (N,) [s]; kept in whole nanoseconds.
            position: Joint positions, shape (N, n) [rad or m].
            joint_names: Names of the n joints.
            velocity: Joint velocities, shape (N, n) [rad/s or m/s].
            effort: Motor torques, shape (N, n) [N·m or N].
            external: Torques of the environment, shape (N, n) [N·m or N].
            wrench: Wrench at the tool, shape (N, 6) [N, N·m].
            drop_invalid: Leave out samples that hold NaN or infinity, which are an error otherwise.

        Raises:
            DimensionError: An array has another shape.
            LogError: Time goes back, a number is NaN, or units do not fit together.
        """
        times = real("t", t, "times of shape (N,)")
        names = tuple(joint_names)
        given = dict(zip(CHANNELS, (position, velocity, effort, external, wrench), strict=True))
        arrays = {
            name: _rows(name, value, len(times), 6 if name == "wrench" else len(names))
            for name, value in given.items()
            if value is not None
        }
        if not np.isfinite(times).all():
            row = int(np.argmin(np.isfinite(times)))
            raise LogError("arrays", f"t at sample {row} is {times[row]}", "times are finite")
        return cls._checked(Samples(to_stamps(times), names, **arrays), (), "arrays", drop_invalid)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        joints: Sequence[str] | None = None,
        topics: Mapping[str, str] | None = None,
        episode: int | None = None,
        unit: Literal["rad", "deg"] = "rad",
        drop_invalid: bool = False,
    ) -> Log:
        """Read a log.

        MCAP files and rosbag2 folders hold `sensor_msgs/JointState` and `geometry_msgs/WrenchStamped` messages. Tables
        (CSV, Parquet) have one row a sample, a column for the time ("t", "time", "timestamp", with "_ns" in
        nanoseconds) and columns as "position.joint1", "joint1_velocity" or "tau_joint1". Of a LeRobot data set, give
        the folder.

        Args:
            path: The file or folder.
            joints: Names of the joints to read, in this order; all by default. Numbered columns get these names.
            topics: Topics by "joints", "external" and "wrench", where a bag holds several.
            episode: Which episode of a LeRobot data set; the first by default.
            unit: Unit of turning joints in the file.
            drop_invalid: Leave out samples that hold NaN or infinity, which are an error otherwise.

        Raises:
            LogError: The file is missing, damaged, of an unknown kind, or ambiguous; a joint is missing; or see
                `from_arrays`.
            MissingExtraError: The library that reads this kind of file is not installed.
        """
        if unit not in {"rad", "deg"}:
            raise ParameterError("unit", unit, '"rad" or "deg"')
        wanted = formats.Wanted(
            tuple(joints) if joints is not None else None, topics or {}, episode
        )
        samples, findings = formats.read(Path(path), wanted)
        if wanted.joints is not None:
            samples = samples.of([_index(name, samples, str(path)) for name in wanted.joints])
        if unit == "deg":
            scaled: dict[str, Any] = {
                name: array / DEGREE
                for name, array in samples.channels()
                if name in {"position", "velocity"}
            }
            samples = samples._replace(**scaled)
        return cls._checked(samples, findings, str(path), drop_invalid)

    @classmethod
    def _checked(
        cls, samples: Samples, found: tuple[LogFinding, ...], source: str, drop_invalid: bool
    ) -> Log:
        samples, findings = checked(samples, source, drop_invalid=drop_invalid)
        return cls(*samples, findings=(*found, *findings), source=source)

    def __repr__(self) -> str:
        channels = ", ".join(name for name, _ in self._samples().channels())
        size = f"{len(self)} samples of {len(self.joint_names)} joints, {self.t[-1]:g} s"
        found = "".join(f"\n    {finding.kind}: {finding.words}" for finding in self.findings)
        return f"Log({self.source!r}, {size}: {channels}){found}"

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def t(self) -> Array:
        """Times from the first sample on, shape (N,) [s]."""
        t: Array = to_seconds(self.stamps - self.stamps[0])
        return t

    def between(self, start: float, end: float) -> Log:
        """Return the part of the log between two times.

        Args:
            start: First time, of `t` [s].
            end: Last time [s].

        Raises:
            LogError: Fewer than two samples are between them.
        """
        rows = (self.t >= start) & (self.t <= end)
        source = f"{self.source} from {start:g} to {end:g} s"
        return self._checked(self._samples().at(rows), (), source, False)

    def on(self, arm: ArmModel) -> ArmLog:
        """Return the log in the terms of an arm: joints in its order, positions as configurations.

        Args:
            arm: The arm. The log may have more joints than it.

        Raises:
            LogError: A joint of the arm is missing, or positions are so far beyond its limits that they must be in
                another unit.
        """
        samples = self._samples()
        columns = [_index(name, samples, self.source) for name in arm.joint_names]
        return on_arm(samples.of(columns), arm, self.findings, self.source)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the log; the file appears whole or not at all. What is written reads back bit by bit.

        Args:
            path: Where to; the ending says which kind: .mcap, .csv, .parquet or .npz.

        Returns:
            The path that was written.

        Raises:
            LogError: Another ending.
            MissingExtraError: The library that writes this kind of file is not installed.
        """
        return formats.write(Path(path), self._samples())

    def _samples(self) -> Samples:
        return Samples._make(getattr(self, name) for name in Samples._fields)


def _rows(name: str, value: ArrayLike, samples: int, columns: int) -> Array:
    expected = f"an array of shape ({samples}, {columns})"
    array = real(name, value, expected)
    if array.shape != (samples, columns):
        raise DimensionError(name, expected, f"shape {array.shape}")
    return array


def _index(name: str, samples: Samples, source: str) -> int:
    if name not in samples.joint_names:
        remedy = f"name the joints as the log does{suggest(name, samples.joint_names)}"
        raise LogError(source, f"no joint '{name}'", remedy)
    return samples.joint_names.index(name)
