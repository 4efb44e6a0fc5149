"""`propose_gains` for an arm as it is delivered: bandwidths from its hardware, checked in simulation on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..control.estimation.friction_learning import Expectation
from ..control.hardware_controller import HardwareController
from ..exceptions import DivergenceError, ParameterError
from ..law.impedance import Impedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..simulation.plants.elasticity import enough_substeps
from ..simulation.run import on_hardware, simulate
from .gain_design import DesignTask, Measured, measure_task
from .hardware_bandwidths import (
    HardwareBandwidths,
    HardwareDemand,
    bandwidths,
    spring_bound,
    variation_of_motion,
)
from .hardware_plants import LEAST_FRICTION, as_seen, expectation, worst_samples
from .plant_sample import PlantSample, with_body
from .worst_case import true_error, usual_impedance

BEST = 2e-3
"""Accuracy that is aimed at where none is requested [rad or m]."""

LOUDEST = 2.0
"""Gains are made softer where the torque varies by more than this times what the motion needs, and 2 N·m/s."""

REFUSED = 2.5
"""A proposal that varies by more than this, however soft, is refused."""

GATE_SHARE = 0.25
"""Share of the accuracy at which the bandwidth is raised,"""

GATE_COUNTS = 30.0
"""and counts of error from which on it is, where these are more."""

_FLOOR = 2.0  # N·m/s
_JUMP_TARGET = 0.35  # of the accuracy: a jump comes on top of the rest
_K2_OVER_MISMATCH = 60.0  # reversals stay in the linear zone of the reaching term
_LATE = 0.4  # share of the run after which errors and variation are taken
_ROUNDS = 6
_SOFTER, _GATE_SOFTER = (
    0.89,
    0.73,
)  # of the quiet bandwidth in a round, and of the inverse of the error that raises it


class HardwareRun(NamedTuple):
    """One plant in closed loop on the hardware.

    Attributes:
        sample: The plant.
        error: Largest true error abs(e1) late in the run, shape (nv,); infinite where it diverged [rad or m].
        variation: Of the torque over that time, over all joints [N·m/s or N/s].
    """

    sample: PlantSample
    error: Array
    variation: float


@brief_repr("feasible", "reason", "hardware", "arm", "error", "variation")
@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareProposal:
    """A controller for an arm on its hardware, or the reason why there is none; arrays have shape (nv,).

    Attributes:
        feasible: Whether the worst samples are accurate and quiet on this hardware.
        reason: Why not; empty where feasible.
        joint: Joint that makes it infeasible, or None.
        remedies: What would help, in words.
        hardware: What it is made for.
        arm: The model that the controller should use.
        payload: Payload in that model [kg].
        dt: Control period [s].
        bandwidths: Of the loop, and what bounds them on every joint.
        demand: What they follow from.
        k2: Acceleration up to which the reaching term is linear [rad/s² or m/s²].
        accuracy: Error at which the bandwidth is raised [rad or m].
        expected: What is known of friction and load beforehand.
        load: The model with one more kilogram where the payload is.
        softer: Steps by which the quiet bandwidth was lowered, because the torque varied too much.
        runs: The simulated samples: corners of the ranges, and plants between them.
        limits: Of the actuators; None for none.
    """

    feasible: bool
    reason: str
    joint: str | None
    remedies: tuple[str, ...]
    hardware: Hardware
    arm: ArmModel
    payload: float
    dt: float
    bandwidths: HardwareBandwidths
    demand: HardwareDemand
    k2: Array
    accuracy: Array
    expected: Expectation
    load: ArmModel
    softer: int = 0
    runs: tuple[HardwareRun, ...]
    limits: Limits | None

    @property
    def error(self) -> Array:
        """Largest error abs(e1) of the simulated worst samples, late in the run [rad or m]."""
        error: Array = np.max([run.error for run in self.runs], axis=0)
        return error

    @property
    def variation(self) -> float:
        """Largest torque variation of them, over what the motion needs of the heaviest plant."""
        return max(run.variation for run in self.runs) / self.demand.need

    def exceeds(self, multiple: float) -> bool:
        """Whether the torque of a sample varies by more than a multiple of what the motion needs, and 2 N·m/s more.

        Args:
            multiple: The multiple.
        """
        return not self.variation <= multiple + _FLOOR / self.demand.need

    def controller(
        self, impedance: Impedance | None = None, *, limits: Limits | ArrayLike | None = None
    ) -> HardwareController:
        """Build the controller that was proposed.

        Args:
            impedance: Target impedance; M_d = 1, D_d = 10, K_d = 20 by default, as in the paper.
            limits: Of the actuators; those of the proposal by default.

        Raises:
            ParameterError: The proposal is not feasible.
        """
        if not self.feasible:
            raise ParameterError("proposal", self.reason, "feasible; see its remedies")
        return _controller(self, impedance, self.limits if limits is None else limits)

    def explain(self) -> str:
        """Explain the proposal, joint by joint: what bounds it, with the number; or why there is none."""
        if not self.feasible and not self.runs:
            return "\n".join([f"No controller: {self.reason}.", *self._listed()])
        lines = [
            f"Torque acts {1e3 * self.demand.delay.max():.3g} ms after the measurement; the motion needs "
            f"{self.demand.need:.3g} N·m/s of torque variation, counting adds {self.bandwidths.noise:.3g}."
        ]
        for j, name in enumerate(self.arm.joint_names):
            lines.append(
                f"- {name}: {self.bandwidths.quiet[j]:.3g} rad/s, up to {self.bandwidths.alert[j]:.3g} at a "
                f"disturbance; bound by {self._words(j)}"
            )
        lines.append(
            f"Simulated on the worst samples: error {1e3 * self.error.max():.3g} mrad, torque variation "
            f"{self.variation:.2g} times what the motion needs."
        )
        lines += self._of_springs()
        if self.softer:
            lines.append(
                f"Bandwidths are {100 * (1 - _SOFTER**self.softer):.0f} % lower than the hardware allows, and raised "
                f"at an error {_GATE_SOFTER**-self.softer:.2g} times as large: otherwise the torque varies by more "
                f"than {LOUDEST:g} times what the motion needs."
            )
        if not self.feasible:
            lines.append(f"Not feasible: {self.reason}.")
        return "\n".join([*lines, *self._listed()])

    def _words(self, j: int) -> str:
        demand = self.demand
        return {
            "delay": f"the delay of {1e3 * demand.delay[j]:.3g} ms",
            "friction": f"what a jump of {demand.jump[j]:.3g} N·m needs: more is not worth its noise",
            "noise": f"the noise of counts of {1e6 * demand.count[j]:.3g} µrad",
            "spring": "the resonance of its spring, which no torque sensor damps",
        }[self.bandwidths.bound[j]]

    def _of_springs(self) -> list[str]:
        """What springs without a torque sensor mean."""
        hardware = self.hardware
        if not hardware.is_elastic or hardware.torque_sensor is not None:
            return []
        words = (
            "Springs without a torque sensor: the law is soft, so that their resonance stays quiet."
        )
        if hardware.encoder_side == "motor":
            words += " Encoders on the motors do not see the springs yield: the links are off by torque over stiffness."
        return [f"{words} A torque sensor behind every gear would allow more."]

    def _listed(self) -> list[str]:
        return [f"- {remedy}" for remedy in self.remedies]


def propose_for_hardware(
    task: DesignTask,
    hardware: Hardware,
    impedance: Impedance,
    q0: Array,
    accuracy: float | None,
) -> HardwareProposal:
    """Return the proposal for an arm on its hardware; see `propose_gains`.

    Args:
        task: The requirements.
        hardware: What is between tick and links.
        impedance: Target impedance of the simulations.
        q0: Initial configuration, shape (nq,).
        accuracy: Largest error allowed; None for what the hardware allows [rad or m].
    """
    smooth = task.uncertainty.but(coulomb=0.0, viscous=0.0)
    seen = as_seen(task.arm, hardware)
    measured = measure_task(replace(task, arm=seen, uncertainty=smooth))
    found = _designed(task, hardware, measured, accuracy or BEST)
    samples, tried = worst_samples(task, hardware), list[HardwareProposal]()
    for softer in range(_ROUNDS):
        found = _until_loud(task, _softened(found, softer), impedance, q0, samples)
        tried.append(found)
        if not found.exceeds(LOUDEST):
            break
        loudest = found.runs[-1].sample  # the first plant of the next round
        samples = [loudest, *(each for each in samples if each is not loudest)]
    else:
        found = min(tried, key=lambda each: each.variation)
        ran = [run.sample for run in found.runs]
        left = [each for each in samples if each not in ran]
        found = replace(found, runs=(*found.runs, *_runs(task, found, impedance, q0, left)))
    return _judged(found, accuracy)


def _until_loud(
    task: DesignTask,
    found: HardwareProposal,
    impedance: Impedance,
    q0: Array,
    samples: list[PlantSample],
) -> HardwareProposal:
    """The proposal with the runs of its samples up to the first that is too loud: then a softer one is tried."""
    for run in _runs(task, found, impedance, q0, samples):
        found = replace(found, runs=(*found.runs, run))
        if found.exceeds(LOUDEST):
            break
    return found


def _designed(
    task: DesignTask, hardware: Hardware, measured: Measured, accuracy: float
) -> HardwareProposal:
    """Bandwidths and gains, not simulated yet."""
    arm, q = measured.model, task.trajectory(0.0).q
    friction = np.maximum(task.uncertainty.coulomb.max(axis=0) + task.arm.coulomb, LEAST_FRICTION)
    heaviest = task.uncertainty.sample(task.arm, 1, seed=task.seed)[0].plant
    mismatch, mass = measured.mismatch, np.diag(arm.mass_matrix(q)).copy()
    demand = HardwareDemand(
        delay=hardware.delay_bound(arm, task.dt),
        inertia=mismatch.inertia,
        mass=mass,
        jump=2.0 * (1.0 + hardware.stribeck) * friction,
        count=hardware.count(arm),
        spring=spring_bound(hardware, arm, mismatch.inertia, mass),
        need=variation_of_motion(heaviest, hardware, task.trajectory, task.duration),
        accuracy=_JUMP_TARGET * accuracy,
    )
    return HardwareProposal(
        feasible=True,
        reason="",
        joint=None,
        remedies=(),
        hardware=hardware,
        arm=arm,
        payload=measured.payload,
        dt=task.dt,
        bandwidths=bandwidths(demand),
        demand=demand,
        k2=_K2_OVER_MISMATCH * (mismatch.torque + friction) / mismatch.inertia,
        accuracy=np.maximum(GATE_SHARE * accuracy, GATE_COUNTS * hardware.count(arm)),
        expected=expectation(task, hardware),
        load=with_body(
            arm, 1.0, task.uncertainty.payload_com.mean(axis=0), 0.0, task.uncertainty.payload_frame
        ),
        runs=(),
        limits=task.limits,
    )


def _softened(found: HardwareProposal, softer: int) -> HardwareProposal:
    """The proposal, a step softer than before: less quiet bandwidth, raised at a larger error.

    A lower alert bandwidth is no softer: an error then lasts longer, and with it the noise of the open gate.
    """
    if softer == 0:
        return found
    slower = replace(found.bandwidths, quiet=_SOFTER * found.bandwidths.quiet)
    accuracy = found.accuracy / _GATE_SOFTER
    return replace(found, bandwidths=slower, accuracy=accuracy, softer=softer, runs=())


def _controller(
    proposal: HardwareProposal, impedance: Impedance | None, limits: Limits | ArrayLike | None
) -> HardwareController:
    return HardwareController(
        proposal.arm,
        proposal.hardware,
        usual_impedance() if impedance is None else impedance,
        bandwidths=(proposal.bandwidths.quiet, proposal.bandwidths.alert),
        dt=proposal.dt,
        k2=proposal.k2,
        learns_friction=not proposal.hardware.is_elastic or proposal.hardware.torque_sensor is None,
        accuracy=proposal.accuracy,
        expected=proposal.expected,
        load=proposal.load,
        limits=limits,
    )


def _runs(
    task: DesignTask,
    proposal: HardwareProposal,
    impedance: Impedance,
    q0: Array,
    samples: list[PlantSample],
) -> Iterator[HardwareRun]:
    """Samples on the hardware."""
    law = _controller(proposal, impedance, task.limits)
    hardware = proposal.hardware
    for sample in samples:
        controller, plant = on_hardware(sample.wrap(law, noisy=False), sample.plant, hardware)
        ticks = max(round(task.duration / task.dt), 10)
        try:
            result = simulate(
                controller,
                plant,
                task.trajectory,
                q0=q0,
                duration=ticks * task.dt,
                substeps=enough_substeps(plant, q0, task.dt),
                on_tick=task.on_tick,
            )
        except DivergenceError:
            yield HardwareRun(sample, np.full(task.arm.nv, np.inf), np.inf)
            continue
        late = result.t >= _LATE * ticks * task.dt
        error = np.abs(true_error(sample.plant, result)[late]).max(axis=0)
        variation = float(result.metrics(after=_LATE * ticks * task.dt)["tau_variation"].sum())
        yield HardwareRun(sample, error, variation)


def _judged(found: HardwareProposal, accuracy: float | None) -> HardwareProposal:
    """The proposal, refused where a run is lost, loud or inaccurate."""
    names, error = found.arm.joint_names, found.error
    joint = int(np.argmax(error))
    bound = found._words(joint)
    if not np.isfinite(error).all():
        reason, remedies = "the arm is lost in simulation", _shorter(found)
    elif found.exceeds(REFUSED):
        reason = f"the torque varies by {found.variation:.2g} times what the motion needs, more than {REFUSED:g}"
        remedies = ("finer encoders: a bit more lowers the noise to half", *_shorter(found))
    elif accuracy is not None and error[joint] > accuracy:
        reason = (
            f"joint '{names[joint]}' keeps an error of {1e3 * error[joint]:.3g} mrad, more than "
            f"{1e3 * accuracy:g}; it is bound by {bound}"
        )
        remedies = (f"accuracy={1.2 * error[joint]:.2g}", *_shorter(found))
    else:
        return found
    return replace(found, feasible=False, reason=reason, joint=names[joint], remedies=remedies)


def _shorter(found: HardwareProposal) -> tuple[str, ...]:
    remedy = f"a shorter delay than {1e3 * found.demand.delay.max():.3g} ms"
    if not np.isfinite(found.demand.spring).any():
        return (remedy,)
    return (
        "a torque sensor behind every gear, with an inner torque loop, and encoders on the links",
        "PD with gravity compensation, `baselines.PDGravity`, with gains for a slower loop",
        remedy,
    )
