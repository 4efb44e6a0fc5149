"""The clock of a control loop: it keeps the period, measures it, and says how well it was kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import log, log1p
from time import perf_counter, sleep
from typing import NamedTuple, Protocol

import numpy as np

from .._common.arrays import positive_number
from .._common.brief import brief_repr

RESOLUTION = 1e-3
"""Share of itself to which a percentile of the periods is known."""

_SHORTEST, _LONGEST = 1e-6, 1e3  # s: what the histogram covers
_BIN = log1p(RESOLUTION)


class Limiter(Protocol):
    """What keeps the rate: `AbsoluteRate`, or the like."""

    @property
    def slack(self) -> float:
        """Time that was left when the last tick was done; negative where it was late [s]."""

    def sleep(self) -> None:
        """Wait for the next tick."""


class AbsoluteRate:
    """Ticks at multiples of the period: a wake-up that comes late does not delay the ticks after it.

    After a tick that is late, by its work or by half a period of wake-up, the count starts again from there: no period
    is shorter than half of the nominal one.

    Args:
        period: Time between two ticks [s].
        clock: Gives the time [s].
        sleep: Waits for a time [s].
    """

    def __init__(
        self, period: float, clock: Callable[[], float], sleep: Callable[[float], object]
    ) -> None:
        self.period, self.slack = period, 0.0
        self._clock, self._sleep = clock, sleep
        self._due = clock() + period

    def sleep(self) -> None:
        """Wait for the next tick."""
        self.slack = self._due - self._clock()
        if self.slack > 0.0:
            self._sleep(self.slack)
            late = self._clock() - self._due
            if late < self.period / 2.0:
                self._due += self.period
                return
            self.slack = -late
        self._due = self._clock() + self.period


class TimeHistogram:
    """Percentiles of times, good to `RESOLUTION`, in memory that does not grow.

    Attributes:
        longest: The longest time so far [s].
    """

    def __init__(self) -> None:
        bins = int(np.log(_LONGEST / _SHORTEST) / np.log1p(RESOLUTION)) + 2
        self._counts = np.zeros(bins, dtype=np.int64)
        self.longest = 0.0

    def add(self, time: float) -> None:
        """Count a time [s]."""
        self.longest = max(self.longest, time)
        size = min(max(time, _SHORTEST), _LONGEST) / _SHORTEST
        self._counts[int(log(size) / _BIN)] += 1

    @property
    def count(self) -> int:
        """How many times there were."""
        return int(self._counts.sum())

    def percentile(self, share: float) -> float:
        """Return the middle of the bin in which a percentile is, at most the longest time; NaN without times.

        Args:
            share: 0.5 for the median.
        """
        if self.count == 0:
            return float("nan")
        bin_ = int(np.searchsorted(np.cumsum(self._counts), share * self.count))
        return float(min(_SHORTEST * (1.0 + RESOLUTION) ** (bin_ + 0.5), self.longest))


class LoopReport(NamedTuple):
    """How well a loop kept its period; printed, it is one line of plain words.

    Attributes:
        ticks: Number of measured periods: one less than the ticks that took place.
        overruns: How many ticks came late: the work of the one before took longer than a period, or the computer woke
            the process more than half a period late.
        missed: How many ticks never took place: whole periods that passed meanwhile. A tick 2.5 periods late is one
            overrun, and two ticks are missed.
        p50: Median of the measured periods [s]; this and p99 are good to `RESOLUTION`.
        p99: Their 99th percentile: one period in a hundred is longer [s].
        longest: The longest [s].
    """

    ticks: int
    overruns: int
    missed: int
    p50: float
    p99: float
    longest: float

    def __repr__(self) -> str:
        p50, p99, longest = (f"{1e3 * x:.3g} ms" for x in self[3:])
        return (
            f"LoopReport: {self.ticks} periods, median {p50}, 99 % up to {p99}, longest {longest}; "
            f"{self.overruns} ticks late (overruns), {self.missed} left out (missed)"
        )


@brief_repr()
class Loop:
    """Ticks at a period, and measures what the period really was.

        loop = Loop(controller.dt)
        for period in loop:
            q, v, tau_ext = robot.read()
            output, state = controller.step(state, q, v, reference(loop.time), tau_ext, period)
            robot.send(output.tau)

    The first period is dt: no tick was before. Ticks come at multiples of dt, so that the mean period is dt although
    every sleep ends a little late. A late tick is not made up for by shorter ones: two control ticks in quick
    succession do harm, and the controller takes the measured period into account. Long runs take no more memory than
    short ones.

    Args:
        dt: Control period [s].
        limiter: Keeps the rate; an `AbsoluteRate` by default.
        clock: Gives the time [s].

    Raises:
        ParameterError: dt is not a positive number.
    """

    def __init__(
        self,
        dt: float,
        *,
        limiter: Limiter | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        self.dt = positive_number("dt", dt, "control period in seconds")
        self._limiter = limiter
        self._clock = clock
        self._start: float | None = None
        self._now = 0.0
        self._overruns = self._missed = 0
        self._periods = TimeHistogram()

    def __iter__(self) -> Iterator[float]:
        while True:
            yield self.wait()

    @property
    def time(self) -> float:
        """Time of this tick since the first [s]."""
        return 0.0 if self._start is None else self._now - self._start

    def wait(self) -> float:
        """Wait for the next tick, and return the time since the one before [s]."""
        limiter = self._limiter or AbsoluteRate(self.dt, self._clock, sleep)
        self._limiter = limiter  # made at the first tick: it counts from there
        if self._start is None:
            self._start = self._now = self._clock()
            return self.dt
        limiter.sleep()
        before, self._now = self._now, self._clock()
        self._count(self._now - before, limiter.slack)
        return self._now - before

    def report(self) -> LoopReport:
        """Return how well the period was kept so far; percentiles of no periods are NaN."""
        periods = self._periods
        p50, p99 = (periods.percentile(share) for share in (0.5, 0.99))
        return LoopReport(periods.count, self._overruns, self._missed, p50, p99, periods.longest)

    def _count(self, period: float, slack: float) -> None:
        if slack < 0.0:
            self._overruns += 1
            self._missed += int(-slack / self.dt)
        self._periods.add(period)
