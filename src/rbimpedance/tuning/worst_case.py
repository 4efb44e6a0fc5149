"""The final check of gains: the closed loop with the worst plants that the uncertainty allows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..control.controller import ImpedanceController
from ..control.protocol import Backend
from ..exceptions import DivergenceError
from ..law.impedance import Impedance
from ..law.limits import Limits
from ..law.super_twisting import SuperTwisting
from ..robot.arm_model import ArmModel
from ..robot.units import FORCE
from ..simulation.result import SimulationResult
from ..simulation.run import simulate
from ..trajectories import Trajectory
from ..trajectories.reference import difference_each
from .gain_design import Design, DesignTask
from .plant_sample import PlantSample
from .torque_demand import TorqueDemand

CHATTER_RATIO = 1.5
"""Torque that varies more than this times what the motion needs, and by 1 N·m/s more, chatters."""

NOISE_ERROR_RATIO = 30.0
"""A noisy loop whose error is more than this times the predicted noise error is unbounded."""

LATE, LATE_AT_LIMITS = 0.6, 0.8
"""Share of the run after which errors and variations are taken; with limits the arm comes to its motion later."""

CHATTER_FLOOR = 1.0
"""Variation of the torque that is no chatter, however little the motion needs [N·m/s]."""

STRIDE = 10
"""Ticks between the instants at which the torque that a motion needs is taken."""


def usual_impedance() -> Impedance:
    """Return the target of simulations where none is given: that of the paper's section 4."""
    return Impedance(mass=1.0, damping=10.0, stiffness=20.0)


class ExtremeCase(NamedTuple):
    """One plant in closed loop with the proposed gains; arrays have shape (nv,).

    Attributes:
        sample: The plant.
        noisy: Whether the sensors had the uncertainty's noise.
        result: The log, up to the divergence where there was one.
        error: Largest true error abs(e1) over the last two fifths; with limits over the last fifth [rad or m].
        peak: Largest true error over the whole run [rad or m].
        peak_torque: Largest torque [N·m or N].
        variation: Variation of the torque over that time [N·m/s or N/s].
        needed: Variation that the motion itself needs [N·m/s or N/s].
        joint: Joint that failed, or None.
        reason: Why, or empty.
        unstable: Whether it failed by divergence or chatter, which a slower scheme may fix.
    """

    sample: PlantSample
    noisy: bool
    result: SimulationResult
    error: Array
    peak: Array
    peak_torque: Array
    variation: Array
    needed: Array
    joint: int | None
    reason: str
    unstable: bool

    @property
    def true_error(self) -> Array:
        """True error e1 at all times, which sensors do not disturb, shape (N, nv) [rad or m]."""
        return true_error(self.sample.plant, self.result)


def controller_for(
    design: Design,
    dt: float,
    impedance: Impedance,
    limits: Limits | None,
    backend: Backend = "pinocchio",
) -> ImpedanceController:
    """Return the controller with a design's model and gains."""
    reaching = SuperTwisting(design.k1, design.k2, "matched", design.margin)
    return ImpedanceController(
        design.measured.model,
        impedance,
        design.surface,
        reaching,
        dt,
        limits=limits,
        backend=backend,
    )


def worst_cases(
    task: DesignTask,
    design: Design,
    impedance: Impedance,
    q0: Array,
    demand: TorqueDemand | None,
    more: Sequence[PlantSample] = (),
) -> Iterator[ExtremeCase]:
    """Simulate the extreme samples without noise, from starts on both sides of the motion, and then with noise.

    Args:
        task: The requirements.
        design: Gains with a finite margin.
        impedance: Target impedance.
        q0: Initial configuration, shape (nq,).
        demand: What the motion asks of limited joints; the plants that bring one near its limits are simulated first.
        more: Further plants.
    """
    extremes = [design.measured.samples[i] for i in design.measured.mismatch.extremes]
    strenuous = () if demand is None else demand.strenuous
    samples = {id(sample): sample for sample in (*strenuous, *more, *extremes)}.values()
    noisy = bool(design.noise_error.max() > 0.0)
    for start in both_sides(task, q0):
        for sample in samples:
            yield _run(task, design, impedance, start, sample, noisy=False)
    for sample in samples if noisy else ():
        yield _run(task, design, impedance, q0, sample, noisy=True)


def both_sides(task: DesignTask, q0: Array) -> tuple[Array, ...]:
    """Return the start, and the one as far on the other side of the motion, within the position limits.

    Args:
        task: The requirements.
        q0: The start, shape (nq,).
    """
    dynamics, on_motion = task.arm.raw_dynamics, np.asarray(task.trajectory(0.0).q)
    away = dynamics.difference(q0, on_motion)
    if not away.any():
        return (q0,)
    other: Array = np.clip(dynamics.integrate(on_motion, away), task.arm.lower, task.arm.upper)
    return q0, other


def true_error(plant: ArmModel, result: SimulationResult) -> Array:
    """Return q_r (-) q over time, without the sensors' noise and delay, shape (N, nv) [rad or m]."""
    return difference_each(plant, result.q, result.q_r)


def needed_variation(plant: ArmModel, trajectory: Trajectory, times: Array) -> Array:
    """Return the variation per second of the torque that a motion needs, shape (nv,) [N·m/s or N/s].

    Args:
        plant: The arm that moves.
        trajectory: The motion.
        times: Instants to take, increasing.
    """
    tau = np.array([plant.raw_dynamics.inverse_dynamics(*trajectory(t)) for t in times.tolist()])
    variation: Array = np.abs(np.diff(tau, axis=0)).sum(axis=0) / (times[-1] - times[0])
    return variation


def _run(
    task: DesignTask,
    design: Design,
    impedance: Impedance,
    q0: Array,
    sample: PlantSample,
    noisy: bool,
) -> ExtremeCase:
    law = controller_for(design, task.dt, impedance, task.limits, task.backend)
    controller = sample.wrap(law, noisy=noisy)
    ticks = max(round(task.duration / task.dt), 10)
    run: dict[str, Any] = {"q0": q0, "duration": ticks * task.dt, "on_tick": task.on_tick}
    try:
        result = simulate(controller, sample.plant, task.trajectory, **run)
    except DivergenceError as failure:
        return _diverged(task.arm, sample, noisy, failure)
    after = (LATE if task.limits is None else LATE_AT_LIMITS) * ticks * task.dt
    late = result.t >= after
    errors = np.abs(true_error(sample.plant, result))
    error = errors[late].max(axis=0)
    variation = result.metrics(after=after)["tau_variation"]
    needed = needed_variation(sample.plant, task.trajectory, result.t[late][::STRIDE])
    joint_failed, reason, unstable = _verdict(task, design, noisy, error, variation, needed)
    if joint_failed is None:
        joint_failed, reason = _deviation(task.arm, result)
    if joint_failed is not None and result.saturated.any():
        reason += at_limits(task, result)
    peaks = errors.max(axis=0), np.abs(result.tau).max(axis=0)
    return ExtremeCase(
        sample, noisy, result, error, *peaks, variation, needed, joint_failed, reason, unstable
    )


def _diverged(
    arm: ArmModel, sample: PlantSample, noisy: bool, failure: DivergenceError
) -> ExtremeCase:
    x, joint = np.full(arm.nv, np.inf), arm.joint_names.index(failure.joint)
    reason = f"joint '{failure.joint}' diverges after {failure.time:.3g} s"
    return ExtremeCase(sample, noisy, failure.result, x, x, x, x, x, joint, reason, True)


def _deviation(arm: ArmModel, result: SimulationResult) -> tuple[int | None, str]:
    """The joint that was far from its reference on the way, and in words when and how far; see `Verdict`."""
    for finding in result.verdict().findings:
        if finding.kind == "deviation":
            return arm.joint_names.index(finding.joint), f"in simulation, {finding.words}"
    return None, ""


def at_limits(task: DesignTask, result: SimulationResult) -> str:
    """Return in words which joints were at their torque limits, for how long.

    Args:
        task: The requirements.
        result: The run.
    """
    shares = result.saturated.mean(axis=0)
    names = zip(task.arm.joint_names, shares, strict=True)
    said = ", ".join(f"'{name}' for {share:.0%} of the time" for name, share in names if share)
    return f"; at their limits: {said}"


def _verdict(
    task: DesignTask, design: Design, noisy: bool, error: Array, variation: Array, needed: Array
) -> tuple[int | None, str, bool]:
    """The joint that fails, why, and whether it is unstable."""
    names, units = task.arm.joint_names, task.arm.position_units
    times = np.linspace(0.0, task.duration, 50).tolist()
    speed = np.max([np.abs(task.trajectory(t).v) for t in times], axis=0)
    late = (
        task.uncertainty.delay * task.dt * speed
    )  # how far the arm moves before its sensors report it
    allowed = task.accuracy + late + NOISE_ERROR_RATIO * design.noise_error * noisy
    joint = int(np.argmax(variation - needed))
    ceiling = CHATTER_RATIO * float(needed.sum()) + CHATTER_FLOOR
    if not noisy and float(variation.sum()) > ceiling:
        reason = (
            f"joint '{names[joint]}' chatters: its torque varies by {variation[joint]:.3g} {FORCE[units[joint]]}/s "
            f"where the motion needs {needed[joint]:.3g}"
        )
        return joint, reason, True
    joint = int(np.argmax(error / allowed))
    if error[joint] > allowed[joint]:
        reason = (
            f"joint '{names[joint]}' keeps an error of {error[joint]:.3g} {units[joint]} in simulation, where "
            f"{allowed[joint]:.3g} is allowed"
        )
        return joint, reason, False
    return None, "", False
