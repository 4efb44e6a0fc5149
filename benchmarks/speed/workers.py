"""Programs that are timed from here: they do what one line on their input says and answer with one line of numbers.

    time WHAT COUNT        do it so many times, answer with durations [ns]
    call WHAT NUMBERS...   do it once, answer with the result

The C++ loop and the peers are such programs. Only one of them works at a time, so that they can be timed by turns with
`pin.rnea` in this process.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable, Sequence

import numpy as np

from rbimpedance._common.arrays import Array
from rbimpedance.cli.timing import Timer


class WorkerError(Exception):
    """A worker did not start, or ended; the message is the last line of what it said."""


class Worker:
    """One running program, in a folder of its own that goes with it: some engines write logs where they run.

    Args:
        command: What to run; paths in it are absolute.

    Raises:
        WorkerError: It cannot be run.
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="rbimpedance-")
        try:
            self._process = subprocess.Popen(
                command,
                cwd=self._folder.name,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        except OSError as error:
            self._folder.cleanup()
            raise WorkerError(str(error.strerror)) from error

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *raised: object) -> None:
        self._process.kill()
        self._process.communicate()
        self._folder.cleanup()

    def call(self, what: str, numbers: Iterable[float] = ()) -> Array:
        """Have it do something once.

        Raises:
            WorkerError: It ended instead.
        """
        return self._ask(" ".join(["call", what, *(repr(float(x)) for x in numbers)]))

    def timer(self, what: str) -> Timer:
        """Return what has it do something many times, and tells how long each took [µs]."""
        return lambda count: self._ask(f"time {what} {count}") / 1e3

    def _ask(self, line: str) -> Array:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            self._process.kill()
            said = self._process.communicate()[1].strip().splitlines()
            raise WorkerError(said[-1] if said else "it ended without a word")
        return np.array(answer.split(), dtype=np.float64)
