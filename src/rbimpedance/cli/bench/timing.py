"""Durations of things so short that the measuring counts: interleaved, the clock's own cost subtracted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from time import perf_counter_ns as clock
from typing import TypeAlias

import numpy as np

from ..._common.arrays import Array
from .report import RATIO

Ticks: TypeAlias = Iterator[int]
"""Does one thing at every `next`, and yields the clock when it is done [ns]."""

Timer: TypeAlias = Callable[[int], Array]
"""Does a thing so many times and returns how long each took [µs]."""

Progress: TypeAlias = Callable[[int, int], None]
"""Called with (done, in all)."""

_WARM_UP, _COST_SAMPLES = 30, 200

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


def timer(ticks: Ticks) -> Timer:
    """Return what times ticks, from one reading of the clock to the next, less what the reading costs."""

    def durations(count: int) -> Array:
        cost = np.median(_intervals(_idle(), _COST_SAMPLES))
        return (_intervals(ticks, count) - cost) / 1e3

    return durations


def interleaved(
    timers: Mapping[str, Timer], count: int, *, rounds: int = 50, on_tick: Progress | None = None
) -> dict[str, Array]:
    """Time several things by turns, so that a disturbance of the machine meets all of them.

    Each turn begins with a few that do not count, since the others have had the caches.

    Args:
        timers: What to time, by name.
        count: How many times each.
        rounds: In how many turns.
        on_tick: Called after each turn.

    Returns:
        Durations [µs] by name.
    """
    rounds = min(rounds, count)
    found: dict[str, list[Array]] = {name: [] for name in timers}
    for k in range(rounds):
        for name, measure in timers.items():
            measure(_WARM_UP)
            found[name].append(measure(count // rounds))
        if on_tick is not None:
            on_tick(k + 1, rounds)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def percentiles(durations: Array) -> dict[str, float]:
    """Return p50, p99, p99.9 and max [µs]."""
    return {
        f"{name} [µs]": float(np.percentile(durations, share))
        for name, share in PERCENTILES.items()
    }


def ratios(durations: Array, yardstick: Array, name: str = "rnea") -> dict[str, float]:
    """Return p50, p99 and p99.9 as shares of the same percentile of the yardstick."""
    return {
        f"{RATIO} {name} {point}": float(
            np.percentile(durations, share) / np.percentile(yardstick, share)
        )
        for point, share in PERCENTILES.items()
        if point != "max"
    }


def median(durations: Array) -> float:
    """Return the median [µs]."""
    return float(np.median(durations))


def _intervals(ticks: Ticks, count: int) -> Array:
    start = clock()
    stamps = np.fromiter(islice(ticks, count), np.int64, count)
    return np.diff(stamps, prepend=start).astype(np.float64)


def _idle() -> Ticks:
    while True:
        yield clock()
