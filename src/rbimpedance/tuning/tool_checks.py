"""The final check of gains at the tool: the closed loop with the worst plants that the uncertainty allows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..control.cartesian import CartesianController
from ..exceptions import DivergenceError
from ..robot.tool_kinematics import ToolKinematics, rotation_error
from ..simulation.result import SimulationResult
from ..simulation.run import simulate
from ..trajectories.cartesian import CartesianTrajectory
from .gain_design import DesignTask
from .plant_sample import PlantSample
from .worst_case import (
    CHATTER_FLOOR,
    CHATTER_RATIO,
    LATE,
    LATE_AT_LIMITS,
    NOISE_ERROR_RATIO,
    STRIDE,
    at_limits,
    needed_variation,
)

_UNITS = ("translation", "m"), ("rotation", "rad")


class ToolCase(NamedTuple):
    """One plant in closed loop with the proposed gains.

    Attributes:
        sample: The plant.
        noisy: Whether the sensors had the uncertainty's noise.
        result: The log, up to the divergence where there was one.
        error: Largest true distance from the reference in translation and rotation over the last two fifths, with
            limits over the last fifth, shape (2,) [m, rad].
        variation: Variation of the torque over that time, per joint, shape (nv,) [N·m/s or N/s].
        needed: Variation that the motion itself needs, shape (nv,).
        block: 0 or 1 where translation or rotation keeps an error, else None.
        reason: Why it failed, or empty.
        unstable: Whether it failed by divergence or chatter, which a slower scheme may fix.
    """

    sample: PlantSample
    noisy: bool
    result: SimulationResult
    error: Array
    variation: Array
    needed: Array
    block: int | None = None
    reason: str = ""
    unstable: bool = False


class ToolTask(NamedTuple):
    """What is simulated.

    Attributes:
        task: Requirements; its trajectory is the joint motion that follows the tool's.
        trajectory: Desired motion of the frame.
        q0: Initial configuration, shape (nq,).
        samples: The plants.
        accuracy: Error allowed, shape (2,) [m, rad].
        noise_error: Predicted error by noise, shape (2,) [m, rad]; zero where there is no noise.
    """

    task: DesignTask
    trajectory: CartesianTrajectory
    q0: Array
    samples: tuple[PlantSample, ...]
    accuracy: Array
    noise_error: Array


def cases_until_failure(check: ToolTask, controller: CartesianController) -> tuple[ToolCase, ...]:
    """Simulate the plants without noise, and then with it, up to the first that fails.

    Args:
        check: What is simulated.
        controller: The law with the gains.
    """
    seen = []
    for case in _cases(check, controller):
        seen.append(case)
        if case.reason:
            break
    return tuple(seen)


def _cases(check: ToolTask, controller: CartesianController) -> Iterator[ToolCase]:
    for noisy in (False, True) if check.noise_error.any() else (False,):
        for sample in check.samples:
            yield _judged(check, controller, _run(check, controller, sample, noisy))


def _run(
    check: ToolTask, controller: CartesianController, sample: PlantSample, noisy: bool
) -> ToolCase:
    task, nv = check.task, controller.arm.nv
    options: dict[str, Any] = {"q0": check.q0, "on_tick": task.on_tick}
    duration = max(round(task.duration / task.dt), 10) * task.dt
    loop = sample.wrap(controller, noisy=noisy)
    try:
        result = simulate(loop, sample.plant, check.trajectory, duration=duration, **options)
    except DivergenceError as failure:
        infinite = np.full(nv, np.inf)
        reason = f"joint '{failure.joint}' diverges after {failure.time:.3g} s in simulation"
        log, lost = failure.result, np.full(2, np.inf)
        return ToolCase(sample, noisy, log, lost, infinite, infinite, None, reason, True)
    after = (LATE if task.limits is None else LATE_AT_LIMITS) * duration
    variation = result.metrics(after=after)["tau_variation"]
    times = result.t[result.t >= after][::STRIDE]
    needed = needed_variation(sample.plant, task.trajectory, times)
    error = _true_error(result, ToolKinematics(sample.plant, controller.frame), after)
    return ToolCase(sample, noisy, result, error, variation, needed)


def _true_error(result: SimulationResult, kinematics: ToolKinematics, after: float) -> Array:
    """Largest distance of the frame from its reference, without the sensors' noise and delay, shape (2,) [m, rad]."""
    log, largest = result.tool, np.zeros(2)
    if log is None:
        raise TypeError("a run without a tool")
    for k in np.flatnonzero(result.t >= after)[::STRIDE]:
        now = kinematics.motion(result.q[k], result.v[k])
        away = log.position_r[k] - now.translation, rotation_error(log.rotation_r[k], now.rotation)
        largest = np.maximum(largest, [np.linalg.norm(each) for each in away])
    return largest


def _judged(check: ToolTask, controller: CartesianController, case: ToolCase) -> ToolCase:
    """The case with what is wrong with it."""
    if case.reason:
        return case
    variation, needed = case.variation, case.needed
    if not case.noisy and variation.sum() > CHATTER_RATIO * needed.sum() + CHATTER_FLOOR:
        joint = int(np.argmax(variation - needed))
        reason = (
            f"joint '{controller.arm.joint_names[joint]}' chatters: its torque varies by {variation[joint]:.3g} N·m/s "
            f"where the motion needs {needed[joint]:.3g}"
        )
        return case._replace(reason=reason + _limited(check, case), unstable=True)
    allowed = check.accuracy + _lateness(check) + NOISE_ERROR_RATIO * check.noise_error * case.noisy
    block = int(np.argmax(case.error / allowed))
    if case.error[block] <= allowed[block]:
        return case
    name, unit = _UNITS[block]
    reason = (
        f"the {name} keeps an error of {case.error[block]:.3g} {unit} in simulation, where {allowed[block]:.3g} is "
        "allowed"
    )
    return case._replace(block=block, reason=reason + _limited(check, case))


def _lateness(check: ToolTask) -> Array:
    """How far the frame moves before its sensors report it, shape (2,) [m, rad]."""
    times = np.linspace(0.0, check.task.duration, 50).tolist()
    speeds = [np.linalg.norm(check.trajectory(t).v.reshape(2, 3), axis=1) for t in times]
    late: Array = check.task.uncertainty.delay * check.task.dt * np.max(speeds, axis=0)
    return late


def _limited(check: ToolTask, case: ToolCase) -> str:
    """What held the arm back."""
    words = at_limits(check.task, case.result) if case.result.saturated.any() else ""
    log = case.result.tool
    share = 0.0 if log is None else float((log.lost.max(axis=1) > 0.0).mean())
    if share > 0.0 and check.task.arm.nv >= 6:
        words += f"; a singularity takes part of its motion for {share:.0%} of the time"
    return words
