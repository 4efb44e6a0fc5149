"""What a run on a robot leaves behind: statistics of all of it, and a log of its last part."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..control.guards import FaultEvent
from ..control.loop import TimeHistogram

CHANNELS = ("t", "q", "v", "e1", "tau", "command", "cycles", "delay", "work")
"""What is logged at every tick."""


class RunReport(NamedTuple):
    """How a run went; printed, it is a few lines of plain words.

    Attributes:
        ticks: Number of ticks.
        late: Ticks whose state came more than one cycle of the robot after the one before.
        missed: Cycles of the robot without a tick.
        longest_gap: Longest time from tick to tick, in cycles.
        repeated: States that came twice: the command was sent again, without a tick.
        delay: Largest number of cycles from a command to the state that reports it; 1 where every command is in time.
        limited: Ticks whose torque was held back by the robot's limits of torque and torque rate.
        work_p50: Median of the time from a state to its command [s].
        work_p999: Its percentile 99.9 [s].
        work_longest: The longest [s].
        error_rms: Root mean square of the position error, shape (nv,) [rad or m]; after the soft start.
        error_largest: Its largest absolute value, shape (nv,) [rad or m]; likewise.
        step_rms: Root mean square of the command's change from tick to tick, shape (nv,) [N·m or N]; likewise.
        events: What the guard did, in order.
        ended: Why the run ended, in words.
    """

    ticks: int
    late: int
    missed: int
    longest_gap: int
    repeated: int
    delay: int
    limited: int
    work_p50: float
    work_p999: float
    work_longest: float
    error_rms: Array
    error_largest: Array
    step_rms: Array
    events: tuple[FaultEvent, ...]
    ended: str

    def __repr__(self) -> str:
        worst = 1e3 * self.error_rms.max(initial=0.0)
        work = f"{1e6 * self.work_p50:.0f} µs, 99.9 % up to {1e6 * self.work_p999:.0f} µs"
        return (
            f"RunReport: {self.ended}; {self.ticks} ticks, {self.late} late, {self.missed} cycles missed "
            f"(at most {self.longest_gap - 1 if self.longest_gap else 0} in a row), {self.limited} limited, "
            f"command reported within {self.delay} cycles; own work {work}; "
            f"error {worst:.3g} mrad or mm rms at the worst joint, "
            f"torque step {self.step_rms.max(initial=0.0):.3g} N·m or N rms"
        )


class RobotRun(NamedTuple):
    """A run on a robot.

    Attributes:
        report: Statistics of all of it.
        log: The last ticks, one array for each of `CHANNELS`, the first axis time: time on the robot's clock [s],
            configuration, velocity, position error, torque of the law, command, cycles since the tick before, commands
            that the robot has not reported yet, time from the state to its command [s].
    """

    report: RunReport
    log: dict[str, Array]

    def save(self, path: str) -> None:
        """Write the log as an npz file.

        Args:
            path: Where.
        """
        arrays: dict[str, Any] = {**self.log, "ended": np.array(self.report.ended)}
        np.savez_compressed(path, **arrays)


class Recorder:
    """Counts and logs ticks in memory that is made once.

    Args:
        nq: Size of a configuration.
        nv: Number of joints.
        length: Ticks that the log holds.
    """

    def __init__(self, nq: int, nv: int, length: int) -> None:
        sizes = {"t": (), "cycles": (), "delay": (), "work": (), "q": (nq,)}
        self._log = {
            name: np.zeros((length, *sizes.get(name, (nv,))), dtype=np.float64) for name in CHANNELS
        }
        self._length, self._nv = length, nv
        self._ticks = self._late = self._missed = self._longest = self._limited = self._delay = 0
        self._work, self.repeated = TimeHistogram(), 0
        self._judged, self._errors, self._steps = 0, np.zeros(nv), np.zeros(nv)
        self._largest = np.zeros(nv)
        self.events: list[FaultEvent] = []

    def add(self, row: tuple[Any, ...], *, limited: bool, counts: bool, before: Array) -> None:
        """Add a tick.

        Args:
            row: What is logged, in the order of `CHANNELS`.
            limited: Whether the robot's limits held the torque back.
            counts: Whether errors and torque steps count already.
            before: Command of the tick before, shape (nv,).
        """
        place = self._ticks % self._length
        for name, value in zip(CHANNELS, row, strict=True):
            self._log[name][place] = value
        *_, e1, _, command, cycles, delay, work = row
        self._ticks += 1
        self._late += cycles > 1
        self._missed += cycles - 1
        self._longest = max(self._longest, cycles)
        self._limited += limited
        self._delay = max(self._delay, delay)
        self._work.add(work)
        if counts:
            self._judged += 1
            self._errors += e1**2
            np.maximum(self._largest, np.abs(e1), out=self._largest)
            self._steps += (command - before) ** 2

    def run(self, ended: str) -> RobotRun:
        """Return what was recorded.

        Args:
            ended: Why the run ended.
        """
        n, work = max(self._judged, 1), self._work
        report = RunReport(
            self._ticks,
            self._late,
            self._missed,
            self._longest,
            self.repeated,
            self._delay,
            self._limited,
            work.percentile(0.5),
            work.percentile(0.999),
            work.longest,
            np.sqrt(self._errors / n),
            self._largest.copy(),
            np.sqrt(self._steps / n),
            tuple(self.events),
            ended,
        )
        first = max(self._ticks - self._length, 0)
        order = np.arange(first, self._ticks) % self._length
        return RobotRun(report, {name: rows[order] for name, rows in self._log.items()})
