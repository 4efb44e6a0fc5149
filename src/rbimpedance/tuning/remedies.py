"""What would make a refused task feasible: every change is tried as a whole proposal, simulations included."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..law.impedance import Impedance
from ..robot.units import error_unit
from .checks import Checked, solve
from .gain_design import DesignTask, measure_task
from .torque_demand import slowed
from .torque_limits import within_limits

KNOWN_ARMATURE = 0.1
"""Reflected inertia that geared arms of this size have [kg·m²]; URDFs leave it out."""

_LONGER = (2.0, 4.0)
_SLOWER = (1.5, 3.0)
_SHORTER = (2, 4, 8)
_SOFTER = (1.2, 3.0)


class Remedy(str):
    """A change in words, with which the proposal was made again and is feasible.

    Attributes:
        changes: The arguments of `propose_gains` to change, by name.
    """

    changes: Mapping[str, Any]

    def __new__(cls, words: str, changes: Mapping[str, Any]) -> Remedy:
        """Return the words with the changes."""
        remedy = super().__new__(cls, words)
        remedy.changes = dict(changes)
        return remedy

    def __reduce__(self) -> tuple[Any, ...]:
        return Remedy, (str(self), self.changes)


class Tried(NamedTuple):
    """What came of trying.

    Attributes:
        remedies: Changes that are enough, each alone.
        failed: Changes that are not, in words.
        complete: Whether there was time for every change.
    """

    remedies: tuple[Remedy, ...] = ()
    failed: tuple[str, ...] = ()
    complete: bool = True


class Trial(NamedTuple):
    """How changes are tried.

    Attributes:
        task: The requirements.
        impedance: Target impedance of the simulations.
        q0: Initial configuration, shape (nq,).
    """

    task: DesignTask
    impedance: Impedance
    q0: Array

    def of(self, changes: Mapping[str, Any]) -> Checked:
        """Return what comes of the task with changed arguments."""
        others = {name: value for name, value in changes.items() if name != "q0"}
        task, q0 = replace(self.task, **others), changes.get("q0", self.q0)
        return solve(task, measure_task(task), self.impedance, q0)


def try_remedies(trial: Trial, refused: Checked) -> Tried:
    """Try one change after another, of each kind the gentlest first; where none is enough, several together.

    Args:
        trial: How to try them.
        refused: What came of the task as it is.
    """
    end = time.monotonic() + trial.task.remedy_time
    remedies: list[Remedy] = []
    failed: list[str] = []
    for way in itertools.chain(_ways(trial, refused), _together(trial, remedies)):
        for words, changes in way:
            if time.monotonic() > end:
                return Tried(tuple(remedies), tuple(failed), complete=False)
            found = trial.of(changes)
            if found.design.joint is None:
                remedies.append(Remedy(words + _figures(trial.task, found), changes))
                break
            failed.append(words)
    return Tried(tuple(remedies), tuple(failed))


Step = tuple[str, dict[str, Any]]
"""A change in words, and the arguments that it changes."""


def _ways(trial: Trial, refused: Checked) -> Iterator[list[Step]]:
    """Kinds of changes, each as steps from gentle to strong."""
    task, demand = trial.task, refused.demand
    if demand is not None and not demand.with_reserve:
        yield from within_limits(task, refused.design, demand)
        return
    if not task.arm.armature.any():
        yield _armature(task)  # descriptions leave it out: the usual reason
    if refused.worst:
        yield _longer(task)
        yield _from_the_start(trial)
    yield _payload(task)
    yield _known_payload(task)
    if task.arm.armature.any():
        yield _armature(task)
    yield _period(task)
    yield _delay_and_noise(task)
    yield _accuracy(task, refused)
    yield _slower_motion(task)
    if task.surface is not None:
        yield [("a surface that the proposal chooses (surface=None)", {"surface": None})]


def _together(trial: Trial, remedies: list[Remedy]) -> Iterator[list[Step]]:
    """The strongest steps of several kinds at once, if no single one was enough."""
    if remedies:
        return
    task, words, changes = trial.task, list[str](), dict[str, Any]()
    for kind in (_period, _delay_and_noise, _payload, _armature):
        if steps := kind(task):
            word, change = steps[-1]
            words.append(word)
            changes |= change
            task = replace(task, **change)
            if len(words) > 1:
                yield [(f"together: {', '.join(words)}", dict(changes))]
                if remedies:
                    return


def _longer(task: DesignTask) -> list[Step]:
    times = [factor * task.duration for factor in _LONGER]
    return [(f"a longer run, duration = {time:g} s", {"duration": time}) for time in times]


def _from_the_start(trial: Trial) -> list[Step]:
    start = np.array(trial.task.trajectory(0.0).q)
    if np.array_equal(start, trial.q0):
        return []
    return [("a start on the motion, q0 = trajectory(0.0).q", {"q0": start})]


def _payload(task: DesignTask) -> list[Step]:
    low, high = task.uncertainty.payload.tolist()
    most = [low + share * (high - low) for share in (0.5, 0.25)] if high > low else []
    return [
        (f"a payload of {m:g} kg at most", {"uncertainty": task.uncertainty.but(payload=(low, m))})
        for m in most
    ]


def _known_payload(task: DesignTask) -> list[Step]:
    low, high = task.uncertainty.payload.tolist()
    if high == low:
        return []
    known = task.uncertainty.but(payload=(high, high))
    return [(f"a payload that is known, {high:g} kg", {"uncertainty": known})]


def _armature(task: DesignTask) -> list[Step]:
    arm = task.arm
    if (arm.armature >= KNOWN_ARMATURE).all() or task.uncertainty.armature is not None:
        return []
    words = f"a known armature, if the arm is geared: {KNOWN_ARMATURE:g} kg·m² for example"
    return [(words, {"arm": arm.with_armature(np.maximum(arm.armature, KNOWN_ARMATURE))})]


def _period(task: DesignTask) -> list[Step]:
    return [(f"a shorter period, dt = {task.dt / n:g} s", {"dt": task.dt / n}) for n in _SHORTER]


def _delay_and_noise(task: DesignTask) -> list[Step]:
    uncertainty = task.uncertainty
    steps = [
        (f"a delay of {n} ticks", {"uncertainty": uncertainty.but(delay=n)})
        for n in sorted({uncertainty.delay // 2, 0} - {uncertainty.delay}, reverse=True)
    ]
    noise = {name: getattr(uncertainty, name) for name in ("position_noise", "velocity_noise")}
    for n in (2, 10) if any(noise.values()) else ():
        less = uncertainty.but(**{name: size / n for name, size in noise.items()})
        steps.append((f"1/{n} of the noise", {"uncertainty": less}))
    return steps


def _accuracy(task: DesignTask, refused: Checked) -> list[Step]:
    """A softer accuracy, where an error is what is wrong."""
    found = refused.design
    error = float((found.error + found.noise_error).max())
    if refused.worst:
        error = max(error, float(refused.worst[-1].error.max()))
    if not np.isfinite(error) or error <= task.accuracy:
        return []
    softer = [float(f"{factor * error:.2g}") for factor in _SOFTER]
    return [
        (f"accuracy = {each:g} {error_unit(task.arm)} instead", {"accuracy": each})
        for each in softer
    ]


def _slower_motion(task: DesignTask) -> list[Step]:
    return [
        (
            f"a motion {factor:g} times slower, over {factor * task.duration:g} s",
            {"trajectory": slowed(task.trajectory, factor), "duration": factor * task.duration},
        )
        for factor in _SLOWER
    ]


def _figures(task: DesignTask, found: Checked) -> str:
    error = float(found.stated.error.max())
    return f": margin {found.design.margin:.2g}, error {error:.2g} {error_unit(task.arm)}"
