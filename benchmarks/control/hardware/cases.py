"""An arm on usual hardware with its heaviest plant, and what a law makes of it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import ARMS, Array, load
from rbimpedance.simulation.plants.elasticity import enough_substeps
from rbimpedance.trajectories import Trajectory, cosine, hold

from .linear_laws import DT, TARGET

LENGTH, SHORT, LATE = 6.0, 4.0, 2.0
"""Length of a run, of one in the search over a grid, and the time from which they are evaluated [s]."""
AMPLITUDE, PERIOD = 0.2, 6.0  # rad, s
ROTOR = 0.1  # kg·m²
COULOMB, VISCOUS = 2.0, 1.0
PUSH = rbi.interaction.Push([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], start=0.5, duration=1.0)
CAP = 2.0  # times the torque variation of perfect sensing
BITS = (17, 19, 24)
USUAL: dict[str, Any] = {"torque_lag": 2e-3, "delay": 1, "ripple": 0.03, "stribeck": 0.2}


def swing(arm: rbi.ArmModel, center: Array) -> Trajectory:
    """All joints swing by 0.2 rad about a posture; they begin beside it, at rest."""
    return cosine(arm, center=center, amplitude=AMPLITUDE, period=PERIOD, check_limits=False)


@functools.cache
def _loaded(name: str, rotor: float) -> rbi.ArmModel:
    return load(name, rotor)


@dataclass(frozen=True, eq=False)
class Case:
    """An arm with its heaviest plant, half of whose payload its model holds.

    Attributes:
        name: Of the arm.
        coulomb: Dry friction of the plant [N·m].
        rotor: Inertia of the rotors on the joints' side of the gears [kg·m²].
    """

    name: str
    coulomb: float = COULOMB
    rotor: float = ROTOR

    def arm(self) -> rbi.ArmModel:
        """The arm as it is modelled, without friction."""
        return _loaded(self.name, self.rotor).with_friction(0.0, 0.0)

    def plant(self) -> rbi.ArmModel:
        """Links 10 % heavier, the whole payload, friction."""
        heavy = self.arm().with_scaled_inertia(1.1).with_payload(ARMS[self.name])
        return heavy.with_friction(VISCOUS, self.coulomb)

    def model(self) -> rbi.ArmModel:
        """The arm with half of the payload."""
        return self.arm().with_payload(ARMS[self.name] / 2.0)

    def unknown(self) -> rbi.Uncertainty:
        """What is not known."""
        return rbi.Uncertainty(
            payload=ARMS[self.name],
            inertia_scale=1.1,
            coulomb=(0.0, self.coulomb),
            viscous=(0.0, VISCOUS),
        )

    def motion(self) -> Trajectory:
        """All joints swing by 0.2 rad about neutral, where the arm starts."""
        return swing(self.arm(), np.array(self.arm().neutral))

    def still(self) -> Trajectory:
        """The arm stays at neutral."""
        return hold(self.arm(), np.array(self.arm().neutral), check_limits=False)


def simulated(
    case: Case,
    controller: Any,
    hardware: rbi.Hardware,
    motion: Any,
    push: Any = PUSH,
    length: float = LENGTH,
    engine: Callable[[rbi.ArmModel], Any] = lambda arm: arm,
) -> rbi.SimulationResult:
    """The heaviest plant on the hardware, under a controller that is behind its encoders already.

    Raises:
        DivergenceError: The arm is lost.
    """
    driven = rbi.DrivenPlant.for_(hardware, engine(case.plant()), DT)
    q0 = np.array(case.plant().neutral)
    return rbi.simulate(
        controller,
        driven,
        motion,
        environment=push,
        q0=q0,
        duration=length,
        substeps=enough_substeps(driven, q0, DT),
    )


def run(
    case: Case, controller: Any, hardware: rbi.Hardware, motion: Any, *how: Any, **more: Any
) -> dict[str, Any]:
    """Error from 2 s on [rad], and torque variation [N·m/s], of a `simulated` run; infinite where the arm is lost."""
    try:
        result = simulated(case, controller, hardware, motion, *how, **more)
    except rbi.DivergenceError:
        return {"error": np.inf, "variation": np.inf}
    return evaluated(case.plant(), result.t, result.q, result.q_r, result.tau)


def evaluated(plant: rbi.ArmModel, t: Array, q: Array, q_r: Array, tau: Array) -> dict[str, Any]:
    """Error from 2 s on [rad], and torque variation [N·m/s]; infinite where the log ends in NaN."""
    late = t >= LATE
    if np.isnan(tau).any():
        return {"error": np.inf, "variation": np.inf}
    pairs = zip(q[late], q_r[late], strict=True)
    error = np.array([plant.raw_dynamics.difference(*pair) for pair in pairs])
    steps = np.abs(np.diff(tau[late], axis=0)).sum()
    return {"error": float(np.abs(error).max()), "variation": float(steps / (t[-1] - LATE))}


def needed(case: Case, ripple: float, length: float = LENGTH) -> float:
    """Torque variation of computed torque with an integral, with perfect sensing and torque, on the rippling arm."""
    law = rbi.baselines.PIDImpedance(case.model(), TARGET, 150.0, DT)
    hardware = rbi.Hardware(ripple=ripple, stribeck=USUAL["stribeck"])
    return float(run(case, law, hardware, case.motion(), length=length)["variation"])


def ours(case: Case, hardware: rbi.Hardware, length: float = LENGTH) -> rbi.HardwareProposal:
    """What is proposed."""
    proposal = rbi.propose_gains(
        case.arm(),
        case.unknown(),
        case.motion(),
        DT,
        hardware=hardware,
        duration=length,
        q0=np.array(case.arm().neutral),
    )
    assert isinstance(proposal, rbi.HardwareProposal)
    return proposal


def our_run(case: Case, hardware: rbi.Hardware, length: float = LENGTH) -> dict[str, Any]:
    """What the proposal makes of the heaviest plant, in motion and at rest; the reason where it is refused."""
    proposal = ours(case, hardware, length)
    if not proposal.feasible:
        return {"refused": proposal.reason}
    law = rbi.QuantizedEncoders.for_(hardware, proposal.controller(TARGET))
    found = run(case, law, hardware, case.motion(), length=length) | {
        "quiet_bandwidth": proposal.bandwidths.quiet,
        "alert_bandwidth": proposal.bandwidths.alert,
    }
    if not hardware.is_elastic:
        found["still"] = run(case, law, hardware, case.still(), None)["variation"]
    return found
