"""Checkpoints of a run: an interrupted simulation continues to a bitwise identical result."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._common.arrays import Array, is_finite, positive_number
from .._common.files import remove_parts, whole_file
from ..control.snapshot import SnapshotError, dump, restore

EVERY = 2.0
"""Time between checkpoints [s], wall-clock."""

Channels: TypeAlias = Mapping[str, NDArray[Any]]
"""Logged arrays by name, first axis time."""


class RunState(NamedTuple):
    """Everything that a closed loop continues from.

    Attributes:
        tick: The tick that comes next.
        plant: State of the plant.
        tau: Torque held since the tick before, shape (nv,) [N·m or N].
        controller: State of the controller.
        sensor: State of the sensor.
    """

    tick: int
    plant: Any
    tau: Array
    controller: Any
    sensor: Any


class _Kept(NamedTuple):
    """What the file of a checkpoint holds: the state, and the checksum of the rows that belong to it."""

    run: RunState
    rows: str


class Checkpoint:
    """Where a run keeps what it has so far, every few seconds: `simulate(..., checkpoint=...)`.

    Two files: at `path` the state of the loop, replaced as a whole; next to it, with the ending ".rows", the log so
    far, which only grows. A state names the checksum of its rows, which are on the disk before it is. So whenever the
    process is killed, there is a whole checkpoint or none, and a run that continues from it computes and logs exactly
    what it would have without the interruption.

    Args:
        path: Where to.
        label: Says which run it is, in all that `simulate` cannot see: trajectory and environment. Part of what is
            compared before a run continues.
        resume: Continue from an existing checkpoint; otherwise, or if there is none, start from the beginning.
        every: Time between checkpoints, wall-clock [s].
        clock: Gives that time.

    Raises:
        ParameterError: `every` is not a positive number.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        label: str = "",
        *,
        resume: bool = False,
        every: float = EVERY,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self.path = Path(path)
        self.label = label
        self.every = positive_number("every", every, "time in seconds")
        self._resume = resume
        self._clock = clock
        self._rows = self.path.with_name(self.path.name + ".rows")

    def begin(self, start: RunState, channels: Channels, identity: str) -> RunState:
        """Return the state to begin with; where it is not the start, the rows before it are in the channels.

        Args:
            start: State before the first tick.
            channels: The log, for the whole run.
            identity: `fingerprint` of controller, plant and settings.

        Raises:
            SnapshotError: There is a checkpoint of another run, or a damaged one.
        """
        self._template = _Kept(start, "")
        self._identity = hashlib.sha256(f"{identity} {self.label}".encode()).hexdigest()
        self._saved, self._sum, self._last = start.tick, hashlib.sha256(), self._clock()
        remove_parts(self.path)
        goes_on, self._resume = self._resume and self.path.exists(), False
        if not goes_on:
            self.remove()
            return start
        kept = self._load()
        rows = self._load_rows(kept, channels)
        for name, channel in channels.items():
            channel[: len(rows)] = rows[name]
        self._saved = kept.run.tick
        return kept.run

    def offer(self, state: RunState, channels: Channels) -> None:
        """Keep a state and the rows before it, if the last time is long enough ago.

        Args:
            state: State before a tick.
            channels: The log, up to that tick.
        """
        if self._clock() - self._last >= self.every and is_finite(state):
            self.save(state, channels)
            self._last = self._clock()

    def save(self, state: RunState, channels: Channels) -> None:
        """Keep a state and the rows before it.

        Args:
            state: State before a tick.
            channels: The log, up to that tick.
        """
        content = _rows(channels, self._saved, state.tick).tobytes()
        with self._rows.open("r+b" if self._saved else "wb") as file:
            file.seek(self._saved * _row_type(channels).itemsize)
            file.write(content)
            file.truncate()
            file.flush()
            os.fsync(file.fileno())
        self._sum.update(content)
        self._saved = state.tick
        kept = _Kept(state, self._sum.hexdigest())
        with whole_file(self.path) as file:
            file.write(dump(kept, self._template, self._identity))

    def remove(self) -> None:
        """Remove the files; for when the result is on the disk."""
        remove_parts(self.path)
        for path in (self.path, self._rows):
            path.unlink(missing_ok=True)

    def blocks(
        self,
        blocks: Iterable[range],
        memory: Sequence[Array],
        channels: Channels,
        identity: str,
    ) -> Iterator[range]:
        """Give the blocks of ticks that are still to do, in a run that goes block by block, and keep each state.

        Args:
            blocks: All blocks, the same ones in every run.
            memory: The arrays that are passed from one block to the next; those of the kept state are written into
            them.
            channels: The log, for the whole run.
            identity: As for `begin`.

        Raises:
            SnapshotError: There is a checkpoint of another run, or a damaged one.
        """
        state = self.begin(_at(0, memory), channels, identity)
        for array, kept in zip(memory, state.controller, strict=True):
            array[...] = kept
        for block in blocks:
            if block.start >= state.tick:
                yield block
                self.offer(_at(block.stop, memory), channels)

    def _load(self) -> _Kept:
        try:
            kept: _Kept = restore(self.path.read_bytes(), self._template, self._identity)
        except SnapshotError as error:
            words = str(error).replace("another controller", "another run").partition(":")[0]
            raise SnapshotError(
                f"'{self.path}' {words}: continue with the original options, or start again"
            ) from None
        return kept

    def _load_rows(self, kept: _Kept, channels: Channels) -> NDArray[Any]:
        row = _row_type(channels)
        size = kept.run.tick * row.itemsize
        try:
            with self._rows.open("rb") as file:
                content = file.read(size)
        except OSError:
            content = b""
        self._sum = hashlib.sha256(content)
        if len(content) != size or self._sum.hexdigest() != kept.rows:
            raise SnapshotError(f"'{self._rows}' is damaged: start again")
        return np.frombuffer(content, dtype=row)


def _at(tick: int, memory: Sequence[Array]) -> RunState:
    """The state of a run whose memory is a number of arrays."""
    none = np.zeros(0)
    return RunState(tick, none, none, tuple(np.array(array) for array in memory), None)


def _row_type(channels: Channels) -> np.dtype[Any]:
    return np.dtype([(name, x.dtype, x.shape[1:]) for name, x in channels.items()])


def _rows(channels: Channels, start: int, stop: int) -> NDArray[Any]:
    rows = np.empty(stop - start, dtype=_row_type(channels))
    for name, channel in channels.items():
        rows[name] = channel[start:stop]
    return rows
