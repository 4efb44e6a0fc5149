"""What the parts share: one simulation of a proposal on a plant, and what a part is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT
from benchmarks.pages import markdown
from rbimpedance.trajectories import Trajectory
from rbimpedance.tuning import GainProposal, MotionMargin, PlantSample, Uncertainty, propose_gains
from rbimpedance.tuning.gain_design import Task, design, measure_task
from rbimpedance.tuning.worst_case import controller_for, needed_variation, true_error

Figures = dict[str, Any]

DURATION, LATE = 5.0, 3.0
SIMULATION: dict[str, Any] = {}
"""Further arguments of every simulation; `--backend` puts the backend here."""


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
    return rbi.simulate(controller, plant, trajectory, **SIMULATION, **more)


def run(proposal: GainProposal, sample: PlantSample, **limits: Any) -> Figures:
    """Put a proposal to the test on one plant."""
    figures: Figures = {"payload": sample.payload, "inertia_scale": sample.inertia_scale}
    try:
        result = simulate(
            sample.wrap(proposal.controller(**limits)),
            sample.plant,
            proposal.trajectory,
            q0=proposal.nominal.neutral,
            duration=DURATION,
        )
    except rbi.DivergenceError as error:
        infinite = dict.fromkeys(("error", "late", "last", "variation", "needed"), np.inf)
        return figures | infinite | {"diverged": error.joint, "saturated": 1.0}
    e1 = np.abs(true_error(sample.plant, result)).max(axis=1)
    late = result.t >= LATE
    needed = needed_variation(sample.plant, proposal.trajectory, result.t[late][::10])
    return figures | {
        "diverged": None,
        "error": float(e1[-1]),
        "late": float(e1[late].max()),
        "last": float(e1[result.t >= DURATION - 1.0].max()),
        "variation": float(result.metrics(after=LATE)["tau_variation"].sum()),
        "needed": float(needed.sum()),
        "saturated": float(result.saturated.any(axis=1).mean()),
    }


def propose(
    arm: rbi.ArmModel, unknown: Uncertainty, trajectory: Trajectory, dt: float = DT, **more: Any
) -> GainProposal:
    """The library's proposal, with the backend of this run."""
    return propose_gains(arm, unknown, trajectory, dt, **SIMULATION, **more)


def knowing(plant: rbi.ArmModel, trajectory: Trajectory) -> dict[str, float]:
    """The same law with a controller that knows the plant: error and variation of the torque."""
    task = Task(
        arm=plant,
        uncertainty=Uncertainty(),
        trajectory=trajectory,
        dt=DT,
        surface=None,
        duration=DURATION,
        accuracy=1e-3,
        samples=1,
        instants=25,
        seed=0,
        spread=MotionMargin(),
        limits=None,
    )
    gains = design(task, measure_task(task))
    controller = controller_for(gains, DT, rbi.Impedance(1.0, 10.0, 20.0), None)
    result = simulate(controller, plant, trajectory, q0=plant.neutral, duration=DURATION)
    return {
        "error": float(np.abs(true_error(plant, result)[-1]).max()),
        "variation": float(result.metrics(after=LATE)["tau_variation"].sum()),
    }


def said(proposal: GainProposal) -> Figures:
    """What a proposal says, in figures."""
    mismatch = proposal.mismatch
    return {
        "arm": proposal.nominal.name,
        "feasible": proposal.feasible,
        "joint": proposal.joint,
        "reason": proposal.reason,
        "carried": proposal.payload,
        "rho": mismatch.rho,
        "gain": [mismatch.gain_low, mismatch.gain_high],
        "margin": float(proposal.margin[0]),
        "smoothing": float(getattr(proposal.surface, "smoothing", np.nan)),
        "predicted": float(proposal.error.max()),
    }


def summary(tests: Sequence[Mapping[str, Any]]) -> Figures:
    """The worst of several plants."""
    sound = [test for test in tests if test["diverged"] is None]
    return {
        "plants": len(tests),
        "diverged": len(tests) - len(sound),
        "error": max(test["error"] for test in tests),
        "median": float(np.median([test["error"] for test in tests])),
        "late": max(test["late"] for test in tests),
        "ratio": max((test["variation"] / test["needed"] for test in sound), default=np.inf),
    }
