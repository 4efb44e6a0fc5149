"""What a part is: its jobs, and the tables of their answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import rbimpedance as rbi
from benchmarks.pages import markdown
from rbimpedance.trajectories import Trajectory

Figures = dict[str, Any]

DURATION, LATE = 5.0, 3.0
SIMULATION: dict[str, Any] = {}
"""`--backend` puts the backend of all controllers here."""


@dataclass(frozen=True)
class Options:
    """What a run was asked for."""

    arms: tuple[str, ...]
    plants: int
    few: int
    seed: int


def as_rows(options: Options, answers: list[Any]) -> Figures:
    """One row for each answer."""
    del options
    return {"rows": answers}


class Job(NamedTuple):
    """A call that any process can make: a function of a module, and its arguments."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def by_arm(
    head: str,
    rows: Sequence[Mapping[str, Any]],
    cases: Mapping[str, Mapping[str, float]],
    cell: Callable[[Mapping[str, Any]], str],
) -> str:
    """A table with a line for each case, the figures that tell its rows by its name, and a column for each arm."""
    arms = list(dict.fromkeys(row["arm"] for row in rows))
    lines = []
    for name, figures in cases.items():
        found = {row["arm"]: row for row in rows if figures.items() <= row.items()}
        lines.append((name, *(cell(found[arm]) for arm in arms)))
    return markdown((head, *arms), lines)


def on_every_arm(
    options: Options, function: Callable[..., Any], cases: Sequence[tuple[Any, ...]], plants: int
) -> list[Job]:
    """Every case on every arm, each on so many plants."""
    names = options.arms
    return [Job(function, (name, *case, plants, options.seed)) for name in names for case in cases]


class Part(NamedTuple):
    """One part of the script.

    Attributes:
        jobs: The calls that it takes.
        collect: Turns their answers into figures; keys with a leading underscore are not written.
        tables: Turns the figures into Markdown, by the name that docs/robustness.md gives its place.
        draw: Writes the part's pictures into a folder.
    """

    jobs: Callable[[Options], list[Job]]
    collect: Callable[[Options, list[Any]], Figures]
    tables: Callable[[Mapping[str, Any]], dict[str, str]]
    draw: Callable[[Mapping[str, Any], Path], None] | None = None


def simulate(
    controller: Any, plant: rbi.ArmModel, trajectory: Trajectory, **more: Any
) -> rbi.SimulationResult:
    """The library's simulation, with the backend of this run."""
    if SIMULATION and isinstance(controller, rbi.ImpedanceController):
        controller = controller.with_backend(SIMULATION["backend"])
    return rbi.simulate(controller, plant, trajectory, **more)
