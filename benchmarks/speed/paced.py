"""Ticks paced as a control loop paces them: cold caches, late wake-ups, and the pauses of the garbage collector."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from time import perf_counter_ns as clock
from typing import Any, NamedTuple

import numpy as np

from rbimpedance._common.arrays import Array
from rbimpedance.cli.timing import Progress, Ticks

COLLECTORS = ("on", "frozen", "off")
BALLAST = 300_000
"""Objects that the program has beside the loop; the collector looks at them all unless they are frozen."""


_PARTS = 10


class Paced(NamedTuple):
    """What was found.

    Attributes:
        durations: Of each thing by name, shape (periods,) [µs].
        late: How late the wake-ups were, shape (periods,) [µs].
        pause: The longest time that a thing and its entry in the log took together [µs].
    """

    durations: dict[str, Array]
    late: Array
    pause: float


@contextmanager
def collector(mode: str) -> Iterator[None]:
    """Let the garbage collector be on, blind for what is there already, or off."""
    gc.collect()
    if mode == "frozen":
        gc.freeze()
    elif mode == "off":
        gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


def run(
    things: Mapping[str, Ticks], periods: int, period: float, on_tick: Progress | None = None
) -> Paced:
    """Do everything once a period, at equal distances, and log it as programs do: a dict a tick.

    Args:
        things: By name.
        periods: How many.
        period: Length of one [s].
        on_tick: Called a few times, since what it does disturbs.
    """
    durations, late = np.empty((len(things), periods)), np.empty(periods)
    log: list[dict[str, Any]] = []
    slot, longest = int(period * 1e9 / len(things)), 0
    due = clock() + slot
    for k in range(periods):
        for i, (name, ticks) in enumerate(things.items()):
            start = _wait(due)
            end = next(ticks)
            log.append({"name": name, "time": [start, end]})
            longest = max(longest, clock() - start)
            durations[i, k] = end - start
            if i == 0:
                late[k] = start - due
            due = max(due + slot, clock())
        if on_tick is not None and (k + 1) % (periods // _PARTS or 1) == 0:
            on_tick(k + 1, periods)
    found = {name: durations[i] / 1e3 for i, name in enumerate(things)}
    return Paced(found, late / 1e3, longest / 1e3)


def ballast() -> list[dict[str, Any]]:
    """Return what a program has in memory beside its loop."""
    return [{"time": [k]} for k in range(BALLAST)]


def _wait(due: int, now: Callable[[], int] = clock) -> int:
    """Sleep until a time, and return when it was over."""
    left = due - now()
    if left > 0:
        time.sleep(left / 1e9)
    return now()
