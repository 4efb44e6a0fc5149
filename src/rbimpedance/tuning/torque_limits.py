"""Gains against the actuators' limits: the joint that lacks torque, how much, and how much would be enough."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..law.limits import Limits
from ..robot.units import FORCE
from .gain_design import Design, DesignTask
from .plant_sample import PlantSample
from .torque_demand import Exertion, TorqueDemand, slowed
from .uncertainty import Uncertainty

_SLOWEST = 100.0  # factor on the motion's time beyond which slower is no remedy
_DIGITS = 3
_BISECTIONS = 24


def demand_of(
    task: DesignTask, exertion: Exertion, found: Design, slower: float = 1.0
) -> TorqueDemand:
    """Return what a task asks of the joints with the gains of a design.

    Args:
        task: The requirements, with limits.
        exertion: The torques of its motion.
        found: Gains; their noise torque joins the reserve.
        slower: Factor on the motion's time.
    """
    return exertion.demand(
        _limits(task), push=task.spread.acceleration, noise=found.noise_torque, slower=slower
    )


def refused_for_torque(task: DesignTask, found: Design, demand: TorqueDemand) -> Design:
    """Return the design with the joint that lacks most for its limits, and what all of them lack."""
    joint = int(np.argmax(demand.share))
    others = [
        f"'{name}' {_figure(lack)} {FORCE[unit]}"
        for i, (name, lack, unit) in enumerate(
            zip(task.arm.joint_names, demand.lack, task.arm.position_units, strict=True)
        )
        if lack > 0.0 and i != joint
    ]
    also = f" (also missing: {', '.join(others)})" if others else ""
    return replace(found, joint=joint, reason=_reason(task, demand, joint) + also)


def exertion_of(task: DesignTask, samples: Sequence[PlantSample] = ()) -> Exertion:
    """Return the torques of a task's motion for every corner of the ranges.

    Args:
        task: The requirements.
        samples: Plants that begin with the corners, taken where they are more.
    """
    plants = max(samples, task.uncertainty.extremes(task.arm), key=len)
    return Exertion(plants, task.trajectory, task.duration)


def within_limits(
    task: DesignTask, found: Design, demand: TorqueDemand
) -> Iterator[list[tuple[str, dict[str, Any]]]]:
    """Yield how much slower or lighter the task has to be, and what the joints have to give, as changes to try.

    With each of them the limits leave the reserve, too.

    Args:
        task: The requirements.
        found: The design that the limits do not allow.
        demand: What the motion asks of the joints.
    """
    yield _slower(task, found)
    yield _lighter(task, found)
    yield _stronger(task, demand)


def _reason(task: DesignTask, demand: TorqueDemand, joint: int) -> str:
    name, sample = task.arm.joint_names[joint], demand.plants[joint]
    unit = FORCE[task.arm.position_units[joint]]
    plant = f"with a payload of {sample.payload:.3g} kg and links {sample.inertia_scale:.3g} times as heavy"
    if demand.lack[joint] <= 0.0:
        needed, limit = demand.rate_needed[joint], demand.rate_limit[joint]
        return (
            f"the torque of joint '{name}' must change by {_figure(needed)} {unit}/s {plant}; its limit is "
            f"{_figure(limit)} {unit}/s: it lacks {_figure(demand.rate_lack[joint])} {unit}/s"
        )
    return (
        f"joint '{name}' needs {_figure(demand.needed[joint])} {unit} {plant} at t = {demand.time[joint]:.3g} s; its "
        f"limit is {_figure(demand.limit[joint])} {unit}: it lacks {_figure(demand.lack[joint])} {unit}"
    )


def without_reserve(task: DesignTask, found: Design, demand: TorqueDemand) -> Design:
    """Add what its limit leaves the tightest joint to the reason of a design that does not converge."""
    left = demand.limit - demand.needed
    joint = int(np.argmin(left / demand.reserve))
    unit = FORCE[task.arm.position_units[joint]]
    words = (
        f"; the motion leaves joint '{task.arm.joint_names[joint]}' {_figure(left[joint])} of "
        f"{_figure(demand.limit[joint])} {unit}, where {_figure(demand.reserve[joint])} {unit} are wanted to converge"
    )
    return replace(found, reason=found.reason + words)


def _slower(task: DesignTask, found: Design) -> list[tuple[str, dict[str, Any]]]:
    """The smallest factor on the motion's time that the limits allow."""
    exertion = exertion_of(task)

    def enough(factor: float) -> bool:
        return demand_of(task, exertion, found, factor).with_reserve

    if not enough(_SLOWEST):
        return []
    factor = _rounded(_border(enough, _SLOWEST, 1.0), up=True)
    changes = {"trajectory": slowed(task.trajectory, factor), "duration": factor * task.duration}
    return [(f"a motion {factor:g} times slower, over {changes['duration']:g} s", changes)]


def _lighter(task: DesignTask, found: Design) -> list[tuple[str, dict[str, Any]]]:
    """The largest payload that the limits allow."""
    low, high = task.uncertainty.payload.tolist()

    def at_most(payload: float) -> Uncertainty:
        return task.uncertainty.but(payload=(min(low, payload), payload))

    def enough(payload: float) -> bool:
        lighter = replace(task, uncertainty=at_most(payload))
        return demand_of(lighter, exertion_of(lighter), found).with_reserve

    if high == 0.0 or not enough(0.0):
        return []
    payload = _rounded(_border(enough, 0.0, high), up=False)
    return [(f"a payload of {payload:g} kg at most", {"uncertainty": at_most(payload)})]


def _stronger(task: DesignTask, demand: TorqueDemand) -> list[tuple[str, dict[str, Any]]]:
    """Actuators that give what the joints lack."""
    limits, wanted = _limits(task), demand.needed + demand.reserve
    effort = np.where(wanted > demand.limit, [_rounded(x, up=True) for x in wanted], limits.effort)
    needed = [_rounded(x, up=True) for x in demand.rate_needed]
    rate = np.where(demand.rate_lack > 0.0, needed, limits.rate)
    words = f"actuators with {', '.join(_missing(task, demand))}"
    return [(words, {"limits": Limits(effort, rate)})]


def _missing(task: DesignTask, demand: TorqueDemand) -> Iterator[str]:
    for i, (name, unit) in enumerate(
        zip(task.arm.joint_names, task.arm.position_units, strict=True)
    ):
        if demand.needed[i] + demand.reserve[i] > demand.limit[i]:
            torque = _rounded(float(demand.needed[i] + demand.reserve[i]), up=True)
            yield f"{torque:g} {FORCE[unit]} on '{name}'"
        if demand.rate_lack[i] > 0.0:
            rate = _rounded(float(demand.rate_needed[i]), up=True)
            yield f"{rate:g} {FORCE[unit]}/s on '{name}'"


def _border(enough: Callable[[float], bool], good: float, bad: float) -> float:
    """The number next to `bad` that is enough, by bisection from one that is."""
    for _ in range(_BISECTIONS):
        middle = (good + bad) / 2.0
        good, bad = (middle, bad) if enough(middle) else (good, middle)
    return good


def _rounded(value: float, *, up: bool) -> float:
    """A number rounded to a few digits, towards the safe side."""
    if value == 0.0:
        return 0.0
    unit = 10.0 ** (np.floor(np.log10(value)) - _DIGITS + 1)
    return float(unit * (np.ceil(value / unit) if up else np.floor(value / unit)))


def _limits(task: DesignTask) -> Limits:
    return Limits() if task.limits is None else task.limits


def _figure(value: float) -> str:
    return f"{value:.{_DIGITS}g}"
