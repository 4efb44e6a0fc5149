"""Start-up, compile time and memory: what a loop costs before its first tick, and what it leaves behind."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import tracemalloc
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rbimpedance.cli.timing import Progress, Ticks

ROOT = Path(__file__).parents[2]

_IMPORT = """
from time import perf_counter as clock
start = clock()
import pinocchio
middle = clock()
import rbimpedance
print(middle - start, clock() - middle)
"""

_CONTROLLER = """
import sys, time
import numpy as np
from benchmarks.speed import cases
from rbimpedance.cli import timing
clock = time.perf_counter
arm = cases.load(sys.argv[1])
given = timing.inputs(arm)
start = clock()
made = timing.controller(arm, sys.argv[2])
print(clock() - start)
state, durations = made.init(), []
for x in given[:100]:
    time.sleep(1e-3)
    start = clock()
    _, state = made.step(state, *x)
    durations.append(1e6 * (clock() - start))
print(durations[0], np.median(durations[1:]), max(durations[1:]))
"""


def import_times(runs: int) -> tuple[float, float]:
    """Return how long `import pinocchio` takes, and `import rbimpedance` after it; medians of new processes [s]."""
    times = np.array([_numbers(_IMPORT) for _ in range(runs)])
    pinocchio, package = np.median(times, axis=0)
    return float(pinocchio), float(package)


class Start(NamedTuple):
    """The start of one process.

    Attributes:
        controller: Until the controller was made and warmed up [s].
        first: The first tick after that [µs].
        median: Of the ticks that follow, 1 ms apart [µs].
        longest: Of those [µs].
    """

    controller: float
    first: float
    median: float
    longest: float


def compile_times(arm: str, backend: str) -> tuple[Start, Start]:
    """Start a process with an empty cache of machine code, and one after it.

    Args:
        arm: A name that `cases.load` knows.
        backend: Of the controller.
    """
    with tempfile.TemporaryDirectory() as folder:
        cold = Start(*_numbers(_CONTROLLER, arm, backend, NUMBA_CACHE_DIR=folder))
        warm = Start(*_numbers(_CONTROLLER, arm, backend, NUMBA_CACHE_DIR=folder))
    return cold, warm


def growth(ticks: Ticks, count: int, on_tick: Progress | None = None) -> tuple[int, int]:
    """Take ticks and return by how much the memory of the process and its number of blocks have grown."""
    for _ in islice(ticks, count // 10):
        pass
    memory, blocks = resident_bytes(), sys.getallocatedblocks()
    for k in range(10):
        for _ in islice(ticks, count // 10):
            pass
        if on_tick is not None:
            on_tick(k + 1, 10)
    return resident_bytes() - memory, sys.getallocatedblocks() - blocks


def allocation(ticks: Ticks, count: int = 200) -> tuple[int, int]:
    """Return the least and the most memory that one tick held beyond what was there before it [bytes]."""
    peaks = []
    tracemalloc.start()
    try:
        for _ in islice(ticks, 10):
            pass
        for _ in range(count):
            tracemalloc.reset_peak()
            before = tracemalloc.get_traced_memory()[0]
            next(ticks)
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()
    return min(peaks), max(peaks)


def resident_bytes() -> int:
    """Return the memory that this process holds now; 0 where the system does not say."""
    pages = Path("/proc/self/statm")
    if not pages.exists():
        return 0
    return int(pages.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _numbers(code: str, *arguments: str, **environment: str) -> list[float]:
    command = [sys.executable, "-c", code, *arguments]
    run = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return [float(word) for word in run.stdout.split()]
