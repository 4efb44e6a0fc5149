"""`propose_gains`: from what is not known about an arm to gains that tolerate it, or to the reason why none do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number
from .._common.brief import brief_repr
from .._common.deprecation import renamed_attribute
from ..control.controller import ImpedanceController
from ..exceptions import ParameterError
from ..law.certificate import Certificate
from ..law.impedance import Impedance
from ..law.limits import Limits, as_limits
from ..law.sampled_certificate import SampledCertificate
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import NonsingularTerminalSurface, Surface
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..robot.units import error_unit
from ..trajectories import Trajectory
from ..trajectories.cartesian import CartesianTrajectory
from .checks import Checked
from .coupling import Coupling
from .gain_design import DesignTask, foundations
from .hardware_proposal import HardwareProposal, propose_for_hardware
from .mismatch import Mismatch
from .motions import MotionMargin
from .remedies import Remedy, Trial, Tried, try_remedies
from .sampled_proof import prove
from .tool_gains import propose_at_tool
from .tool_proposal import CartesianGainProposal
from .torque_demand import TorqueDemand
from .uncertainty import Uncertainty
from .worst_case import ExtremeCase, usual_impedance


@brief_repr("feasible", "reason", "arm", "k1", "k2", "error")
@dataclass(frozen=True, eq=False, kw_only=True)
class GainProposal:
    """Gains for an arm with an uncertainty, or the reason why there are none; arrays have shape (nv,).

    Attributes:
        feasible: Whether bounds, certificate, the scheme's margins and the worst samples all allow these gains.
        reason: Why not; empty where feasible.
        joint: Name of the joint that makes it infeasible, or None.
        remedies: Changes with which the same call was made again and was feasible, each alone; `remedy.changes` are its
            arguments of `propose_gains`. Empty where feasible.
        tried: What came of all changes that were tried, those included that are not enough.
        nominal: The arm as it was given.
        arm: The model that the controller should use.
        payload: Payload in that model [kg].
        uncertainty: What is not known.
        trajectory: The motion that it was made for.
        dt: Control period [s].
        duration: Length of the motion that was checked [s].
        surface: Sliding surface.
        k1: Gain of the root [rad^½/s^(3/2)].
        k2: Gain of the integral [rad/s³].
        margin: Of the matched scheme.
        mismatch: The bounds behind the gains.
        coupling: Whether the joints' laws are stable together, whatever the gains.
        gain_limit: Input gain that the scheme tolerates at this margin and period; 0 where there is none.
        error: Largest error abs(e1) after `total_time`, and `s_error`, `peak`, `peak_torque`, `reaching_time`: see
            `stated.Stated`. They are estimates from `worst`, with headroom, not proven bounds [rad or m].
        s_error: Largest abs(s) after `reaching_time` [rad/s or m/s].
        peak: Largest error abs(e1) from the start on [rad or m].
        peak_torque: Largest torque from the start on [N·m or N].
        reaching_time: From then on abs(s) is no larger than the s that belongs to `error` [s].
        total_time: From then on abs(e1) is no larger than `error` [s].
        noise_error: Error e1 caused by sensor noise [rad or m].
        noise_torque: Torque caused by it, about [N·m or N].
        certificate: Theorem 1 for the effective gains at the smallest input gain; None where the margin is infinite.
        worst: The simulated worst samples; empty where the bounds alone say no.
        limits: Of the actuators, which the controller keeps; None for none.
        torque: What the motion asks of the joints against these limits; None where there are none.
    """

    feasible: bool
    reason: str
    joint: str | None
    remedies: tuple[Remedy, ...]
    tried: Tried
    nominal: ArmModel
    arm: ArmModel
    payload: float
    uncertainty: Uncertainty
    trajectory: Trajectory
    dt: float
    duration: float
    surface: Surface
    k1: Array
    k2: Array
    margin: Array
    mismatch: Mismatch
    coupling: Coupling
    gain_limit: float
    error: Array
    s_error: Array
    peak: Array
    peak_torque: Array
    reaching_time: Array
    total_time: Array
    noise_error: Array
    noise_torque: Array
    certificate: Certificate | None
    worst: tuple[ExtremeCase, ...]
    limits: Limits | None
    torque: TorqueDemand | None

    def controller(
        self, impedance: Impedance | None = None, *, limits: Limits | ArrayLike | None = None
    ) -> ImpedanceController:
        """Build the controller that was proposed.

        Args:
            impedance: Target impedance; M_d = 1, D_d = 10, K_d = 20 by default, as in the paper.
            limits: Of the actuators; those of the proposal by default, +inf for none.

        Raises:
            ParameterError: The proposal is not feasible.
        """
        if not self.feasible:
            raise ParameterError("proposal", self.reason, "feasible; see its remedies")
        reaching = SuperTwisting(self.k1, self.k2, "matched", self.margin)
        impedance = usual_impedance() if impedance is None else impedance
        limits = self.limits if limits is None else limits
        return ImpedanceController(
            self.arm, impedance, self.surface, reaching, self.dt, limits=limits
        )

    def prove(self, *, lost: int = 0, spread: MotionMargin | None = None) -> SampledCertificate:
        """Certify the sampled loop of all joints together, over sampled plants and motions; some seconds.

        What it proves holds on the motion, with an integral that holds what it needs; see `certify_sampled` for its
        assumptions, and docs/theory.md, section 9.1. Not every proposal has a proof.

        Args:
            lost: Ticks in a row that may be lost, time and again.
            spread: How far motions leave the trajectory.

        Raises:
            ParameterError: The surface is not a `FastTerminalSurface`.
        """
        return prove(self, lost=lost, spread=spread)

    def explain(self) -> str:
        """Explain the proposal, or why it is infeasible and what would help."""
        mismatch = self.mismatch
        if not self.feasible:
            return f"No gains: {self.reason}.\n{self._explain_remedies()}"
        return (
            f"The controller's model holds {self.payload:.3g} kg. A plant answers with {mismatch.gain_low:.2g} to "
            f"{mismatch.gain_high:.2g} times the acceleration that the model expects; the scheme tolerates up to "
            f"{self.gain_limit:.2g} with margin {float(self.margin.max()):.3g} at dt = {self.dt:g} s. "
            f"{self._explain_error()}{self._explain_torque()} {self._explain_coupling()}"
        )

    def _explain_coupling(self) -> str:
        """Whether the joints are proven to be stable together."""
        coupling, names = self.coupling, self.nominal.joint_names
        if coupling.is_proven:
            return (
                "One diagonal matrix shows for all sampled plants that coupled joints converge together, with an input "
                f"gain of {coupling.gain:.2g} at least."
            )
        first, second = (names[i] for i in sorted(coupling.pair))
        return (
            f"Not proven: no diagonal matrix shows that coupled joints converge together; '{first}' and '{second}' are "
            "coupled most. Known rotors, a payload in the model or narrower ranges help."
        )

    def _explain_error(self) -> str:
        """The errors that are stated, on the way and afterwards."""
        unit = error_unit(self.nominal)
        return (
            f"From {self.total_time.max():.2g} s on the error is {self.error.max():.2g} {unit} at most, and "
            f"{self.peak.max():.2g} {unit} before: estimates from simulated worst cases, over the first "
            f"{self.duration:g} s of the motion."
        )

    def _explain_remedies(self) -> str:
        """What was tried, with and without success."""
        lines = [f"- {remedy}" for remedy in self.remedies]
        heading = "Remedies, each tried and enough:" if lines else "No remedy was found."
        lines.insert(0, heading)
        if self.tried.failed:
            lines.append(f"Tried and not enough: {'; '.join(self.tried.failed)}.")
        if not self.tried.complete:
            lines.append("There was no time for more; remedy_time= gives some.")
        return "\n".join(lines)

    def _explain_torque(self) -> str:
        """The joint that comes nearest to its limits, if there are any."""
        if self.torque is None or not self.torque.share.any():
            return ""
        i = int(np.argmax(self.torque.share))
        name, share = self.nominal.joint_names[i], float(self.torque.share[i])
        return f" Of its limits joint '{name}' needs the most, {share:.0%}."

    ways_out = renamed_attribute("ways_out", "remedies")


ACCURACY = 1e-3
"""Largest error abs(e1) that is allowed after the reaching phase where none is given [rad or m]."""


@overload
def propose_gains(
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: Trajectory,
    dt: float,
    *,
    hardware: None = None,
    frame: None = None,
    **options: Any,
) -> GainProposal: ...


@overload
def propose_gains(
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: Trajectory,
    dt: float,
    *,
    hardware: Hardware,
    frame: None = None,
    **options: Any,
) -> GainProposal | HardwareProposal: ...


@overload
def propose_gains(
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: CartesianTrajectory,
    dt: float,
    *,
    hardware: None = None,
    frame: str,
    **options: Any,
) -> CartesianGainProposal: ...


def propose_gains(  # noqa: PLR0913 (requirements, each given by name)
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: Any,
    dt: float,
    *,
    impedance: Any = None,
    surface: Surface | None = None,
    q0: ArrayLike | None = None,
    spread: MotionMargin | None = None,
    limits: Limits | ArrayLike | None = None,
    duration: float = 5.0,
    accuracy: float | None = None,
    hardware: Hardware | None = None,
    frame: str | None = None,
    proof: bool = False,
    **search: Any,
) -> GainProposal | HardwareProposal | CartesianGainProposal:
    """Propose gains for an arm from what is not known about it.

    Bounds come from sampled plants on sampled motions around the trajectory; the gains follow from them, are checked
    by `certify` and against the scheme's margins for input gain and noise at this period, and the worst samples are
    simulated. docs/tuning.md explains how, and what is not covered.

    With `hardware` the controller is a `HardwareController`, whose bandwidths follow from delay, friction and noise of
    the encoders, and the worst samples are simulated on that hardware (docs/hardware-limits.md). Perfect hardware is
    as none.

    With `frame` the gains are those of a `CartesianController` for that frame: the same plants and margins, projected
    on translation, rotation and null space.

    Args:
        arm: The arm as it is modelled.
        uncertainty: What is not known.
        trajectory: Desired motion; with `frame` of that frame.
        dt: Control period [s].
        impedance: Target impedance that the samples are simulated with; M_d = 1, D_d = 10, K_d = 20 by default. With
            `frame` a `CartesianImpedance`.
        surface: Sliding surface; by default a fast terminal one with the smoothing that leaves the smallest error.
        q0: Initial configuration, shape (nq,); `arm.ready` by default, with `frame` where the motion begins.
        spread: How far motions leave the trajectory; give the acceleration of pushes where the arm will be pushed.
        limits: `Limits` of the actuators or an array-like of torque limits, such as `arm.effort_limit`: the motion has
            to be possible within them on every plant, and the controller keeps them. None for none.
        duration: Length of the motion that counts, and of the simulations [s].
        accuracy: Largest error abs(e1) allowed after the reaching phase; by default 1e-3, with `hardware` what it
            allows [rad or m]. With `frame`, translations are allowed `damping.length` times as much [rad].
        hardware: What is between a tick and the links; None for nothing.
        frame: Name of the frame for gains at the tool; None for gains of the joints.
        proof: Feasible only with a certificate of the sampled loop (`GainProposal.prove`); of joints without hardware.
        **search: The fields of `gain_design.Search`: samples, instants, seed, backend, on_tick, remedy_time. With
            `frame` also `damping`, of the Jacobian's inverse.

    Returns:
        The proposal: yes with the numbers behind it, or no with the joint, the reason and remedies that were tried.

    Raises:
        ParameterError: A period, duration, accuracy, limit or count that cannot be, a surface that Theorem 1 does not
            cover, a surface or hardware with `frame`, or a start that is out of reach.
        DimensionError: A range, the surface, a limit or q0 is for another number of joints.
        ModelError: The arm has no such frame.
        TypeError: A keyword that there is not.
    """
    required = {
        **_positive(dt=dt, duration=duration, accuracy=ACCURACY if accuracy is None else accuracy),
        "spread": MotionMargin() if spread is None else spread,
        "limits": as_limits(limits, arm.nv),
        **search,
    }
    if frame is not None:
        _check_at_tool(surface=surface, hardware=hardware)
        options = {"frame": frame, "impedance": impedance, "q0": q0}
        return propose_at_tool(arm, uncertainty, trajectory, **options, **required)
    if isinstance(surface, NonsingularTerminalSurface):
        raise ParameterError("surface", surface, "one with s = φ(e1) + e2, power or fast terminal")
    task = DesignTask(
        arm=arm, uncertainty=uncertainty, trajectory=trajectory, surface=surface, **required
    )
    q0 = np.array(arm.ready if q0 is None else arm.check_configuration("q0", q0))
    target = usual_impedance() if impedance is None else impedance
    if hardware is not None and not hardware.is_perfect:
        return propose_for_hardware(task, hardware, target, q0, accuracy)
    found = _searched(Trial(task, target, q0))
    return _proven(found, task) if proof and found.feasible else found


def _positive(**given: float) -> dict[str, Any]:
    meanings = {
        "dt": "control period in seconds",
        "duration": "length in seconds",
        "accuracy": "error",
    }
    return {name: positive_number(name, value, meanings[name]) for name, value in given.items()}


def _proven(found: GainProposal, task: DesignTask) -> GainProposal:
    """The proposal, refused where there is no certificate of its sampled loop."""
    certificate = prove(found, spread=task.spread, seed=task.seed)
    if certificate.feasible:
        return found
    return replace(found, feasible=False, reason=f"not proven: {certificate.reason}")


def _check_at_tool(**unused: object) -> None:
    for name, value in unused.items():
        if value is not None:
            raise ParameterError(name, value, "None with frame=: gains at the tool do not use it")


def _searched(trial: Trial) -> GainProposal:
    """The proposal for a task, with remedies where it is not feasible."""
    checked = trial.of({})
    tried = Tried() if checked.design.joint is None else try_remedies(trial, checked)
    return _proposal(trial.task, checked, tried)


def _proposal(task: DesignTask, checked: Checked, tried: Tried) -> GainProposal:
    found, demand = checked.design, checked.demand
    feasible = found.joint is None
    margin = np.full(task.arm.nv, found.margin)
    for array in (found.k1, found.k2, margin):
        array.setflags(write=False)
    return GainProposal(
        feasible=feasible,
        reason=found.reason,
        joint=None if found.joint is None else task.arm.joint_names[found.joint],
        remedies=tried.remedies,
        tried=tried,
        trajectory=task.trajectory,
        duration=task.duration,
        surface=found.surface,
        k1=found.k1,
        k2=found.k2,
        margin=margin,
        mismatch=found.measured.mismatch,
        coupling=cast("Coupling", found.measured.coupling),
        gain_limit=found.gain_limit,
        **checked.stated._asdict(),
        noise_error=found.noise_error,
        noise_torque=found.noise_torque,
        certificate=checked.certificate,
        worst=checked.worst,
        torque=demand,
        **foundations(task, found.measured),
    )
