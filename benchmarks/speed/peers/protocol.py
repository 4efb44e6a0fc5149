"""The peers' side of the protocol in benchmarks/speed/workers.py; needs NumPy only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from itertools import cycle, islice
from time import perf_counter_ns as clock
from typing import NamedTuple

import numpy as np

KP, KD = 100.0, 20.0
"""Gains of the comparable law: tau = M(q)·(a_d + KP·(q_d - q) + KD·(v_d - v)) + bias(q, v)."""


STATES = 64
"""Sent at once by "call states"."""


class State(NamedTuple):
    """What a tick is given, each of shape (n,)."""

    q: np.ndarray
    v: np.ndarray
    q_d: np.ndarray
    v_d: np.ndarray
    a_d: np.ndarray
    tau_ext: np.ndarray


Tick = Callable[[State], np.ndarray]


def command(x: State) -> np.ndarray:
    """Acceleration that the law asks for."""
    return x.a_d + KP * (x.q_d - x.q) + KD * (x.v_d - x.v)


def serve(ticks: Mapping[str, Tick]) -> None:
    """Answer until the input ends."""
    states: list[State] = []
    for line in sys.stdin:
        verb, what, *rest = line.split()
        numbers = np.array(rest, dtype=np.float64)
        if verb == "time":
            answer = _durations(ticks[what], states, int(numbers[0]))
        elif what == "states":
            states = [State(*x) for x in numbers.reshape(-1, 6, numbers.size // (6 * STATES))]
            answer = np.array([len(states)], dtype=np.float64)
        else:
            answer = np.concatenate([np.asarray(ticks[what](x)) for x in states])
        print(*map(repr, map(float, answer)), flush=True)


def _durations(tick: Tick, states: list[State], count: int) -> np.ndarray:
    """From one reading of the clock to the next, less what the reading costs [ns]."""
    return _intervals(tick, states, count) - np.median(_intervals(_nothing, states, 200))


def _intervals(tick: Tick, states: list[State], count: int) -> np.ndarray:
    def stamps() -> Iterator[int]:
        for x in islice(cycle(states), count):
            tick(x)
            yield clock()

    start = clock()
    return np.diff(np.fromiter(stamps(), np.int64, count), prepend=start)


def _nothing(x: State) -> np.ndarray:
    return x.q
