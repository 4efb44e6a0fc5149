"""The runs of one robot under one disturbance: one row per run, failures included."""

from __future__ import annotations

import functools
import platform
import re
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from ..control.protocol import Controller
from ..control.provenance import installed_version
from ..exceptions import DivergenceError
from .definition import Experiment, Study, Task
from .measures import Figures, measure

VERSIONS = ("rbimpedance", "pin", "numpy")
"""Distributions whose versions are in every row, and in a study's identity."""

Maker: TypeAlias = Callable[[Task], Controller[Any]]
"""Makes a controller."""

Answer: TypeAlias = list[Figures] | str
"""Rows of a chunk, one for each run, samples first, controllers within; or why there are none."""

_ADDRESS = re.compile(r"0x[0-9a-fA-F]{6,}")


class Tasks:
    """The tasks of one study, each made once and then kept."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._made: dict[str, Task | Exception] = {}

    def __call__(self, robot: str) -> Task:
        """Return the task on a robot, or raise what making it raised."""
        if robot not in self._made:
            try:
                self._made[robot] = self._study.robots[robot]()
            except Exception as error:  # each of its runs is then a failed one
                self._made[robot] = error
        made = self._made[robot]
        if isinstance(made, Exception):
            raise made
        return made


def run_chunk(
    study: Study,
    robot: str,
    disturbance: str,
    tasks: Tasks,
    on_run: Callable[[], None] = lambda: None,
) -> list[Figures]:
    """Run all samples of one robot under one disturbance with all controllers.

    Args:
        study: The study.
        robot: Name of the robot.
        disturbance: Name of the disturbance.
        tasks: The tasks of the study in this process.
        on_run: Called after every run.
    """
    rows: list[Figures] = []
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # of runs that diverge
        for sample in range(study.samples):
            for controller in study.controllers:
                run = functools.partial(_run, study, tasks, robot, disturbance, sample, controller)
                rows.append(key(study, robot, disturbance, sample, controller) | _tried(run))
                on_run()
    return rows


def lost(study: Study, robot: str, disturbance: str, reason: str) -> list[Figures]:
    """Return the rows of a chunk that no worker survived.

    Args:
        study: The study.
        robot: Name of the robot.
        disturbance: Name of the disturbance.
        reason: What is known of it.
    """
    return [
        key(study, robot, disturbance, sample, controller) | _failed(reason)
        for sample in range(study.samples)
        for controller in study.controllers
    ]


def key(study: Study, robot: str, disturbance: str, sample: int, controller: str) -> Figures:
    """Return the columns that identify a run."""
    return {
        "study": study.name,
        "robot": robot,
        "disturbance": disturbance,
        "sample": sample,
        "controller": controller,
        "seed": study.seed,
    } | versions()


@functools.cache
def versions() -> dict[str, str]:
    """Return what computes here, by column."""
    found = {f"version_{name}": installed_version(name) for name in VERSIONS}
    return {"version_python": platform.python_version()} | found


def _tried(run: Callable[[], Figures]) -> Figures:
    """What a run returns, or how it failed."""
    try:
        return run()
    except Exception as error:
        return _failed(f"{type(error).__name__}: {error}")


def _failed(reason: str) -> Figures:
    return {"status": "failed", "reason": _ADDRESS.sub("0x...", reason)}


def _run(
    study: Study, tasks: Tasks, robot: str, disturbance: str, sample: int, controller: str
) -> Figures:
    """Simulate and measure one run."""
    task = tasks(robot)
    drawn = study.disturbances[disturbance](task, study.generator(robot, disturbance, sample))
    inputs = {f"input_{name}": float(value) for name, value in drawn.inputs.items()}
    make = study.controllers[controller]
    return inputs | _tried(lambda: _simulated(study, task, drawn, make))


def _simulated(study: Study, task: Task, drawn: Experiment, make: Maker) -> Figures:
    try:
        result = drawn.simulate(make(task), duration=study.duration, substeps=study.substeps)
    except DivergenceError as error:
        return {
            "status": "diverged",
            "reason": f"joint '{error.joint}' left every range",
            "diverged_at": error.time,
            "worst_joint": error.joint,
        }
    figures = measure(result, task, drawn.trajectory, study.after)
    unsound = [
        name
        for name, value in figures.items()
        if isinstance(value, float) and not np.isfinite(value)
    ]
    if unsound:
        return _failed(f"{unsound[0]} is not finite")
    return {"status": "done"} | figures
