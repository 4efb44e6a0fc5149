"""What the loop is to cost, held against what was measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from rbimpedance.cli.timing import REALTIME, RNEA, STEP

from .comparison import CPP_LOOP, MJ_STEP
from .libraries import PEERS
from .report import RATIO, Line, Report, Section


class Goal(NamedTuple):
    """One bound.

    Attributes:
        name: What is bounded.
        bound: The largest value that meets it.
        values: Finds the values in a report; the largest counts, and there is none where it was not measured.
    """

    name: str
    bound: float
    values: Callable[[Report], Iterator[float]]


def section(report: Report) -> Section:
    """Return the table of the goals that a report has figures for."""
    lines = []
    for goal in GOALS:
        if values := list(goal.values(report)):
            figures = {"goal: at most": goal.bound, "measured": max(values)}
            lines.append(Line(goal.name, figures, "met" if max(values) <= goal.bound else "MISSED"))
    return Section(
        "goals", "Goals", "The largest of the values below that each speaks of.", tuple(lines)
    )


def _figures(key: str, figure: str, line: str = "") -> Callable[[Report], Iterator[float]]:
    """Find a figure in the lines of a section whose names begin so."""

    def values(report: Report) -> Iterator[float]:
        found = report.section(key)
        for one in () if found is None else found.lines:
            if one.name.startswith(line) and figure in one.figures and one.name != RNEA:
                yield one.figures[figure]

    return values


def _below(line: str) -> Callable[[Report], Iterator[float]]:
    """Find the compiled closed-loop step over another one."""

    def values(report: Report) -> Iterator[float]:
        steps = {name: list(_figures("peer-loops", "a step [µs]", name)(report)) for name in _LOOPS}
        if steps[_COMPILED_LOOP] and steps[line]:
            yield steps[_COMPILED_LOOP][0] / steps[line][0]

    return values


def _ahead_of_peers(report: Report) -> Iterator[float]:
    """The compiled tick over the fastest library's."""
    ours = list(_figures("peers", "p50 [µs]", STEP["compiled"])(report))
    labels = (task.label for peer in PEERS.values() for task in peer.tasks.values())
    theirs = [x for label in labels for x in _figures("peers", "p50 [µs]", label)(report)]
    if ours and theirs:
        yield ours[0] / min(theirs)


_COMPILED_LOOP = "simulate, compiled"
_LOOPS = (_COMPILED_LOOP, CPP_LOOP, MJ_STEP)

GOALS = (
    *(
        Goal(
            f"{name}, any surface and scheme, × rnea",
            bound,
            _figures("laws", f"{RATIO} rnea, {name}"),
        )
        for name, bound in (
            (STEP["pinocchio"], 2.5),
            (STEP["compiled"], 1.0),
            (REALTIME["compiled"], 0.8),
        )
    ),
    *(
        Goal(f"{point} back to back, × rnea's", 2.5, _figures("tick", f"{RATIO} rnea {point}"))
        for point in ("p99", "p99.9")
    ),
    Goal(
        "simulate, pinocchio, × (rnea + aba)",
        2.0,
        _figures("loop", f"{RATIO} (rnea + aba)", "simulate, pinocchio"),
    ),
    Goal(
        "simulate, compiled, × (rnea + aba)",
        0.35,
        _figures("loop", f"{RATIO} (rnea + aba)", _COMPILED_LOOP),
    ),
    Goal(
        "1024 worlds, 2 threads, a world-step × (rnea + aba)",
        0.22,
        _figures("batch", f"{RATIO} (rnea + aba)", "1024 worlds, 2 threads"),
    ),
    Goal("compiled closed-loop step over the C++ loop", 1.0, _below(CPP_LOOP)),
    Goal("compiled closed-loop step over mj_step alone", 1.0, _below(MJ_STEP)),
    Goal("compiled tick over the fastest library's", 1.0, _ahead_of_peers),
    Goal(
        "import rbimpedance beyond pinocchio [s]",
        0.4,
        _figures("start-up", "time [s]", "import rbimpedance"),
    ),
)
