"""One arm, one set of gains, one kind of hardware: a run, its verdict, and the bounds of each imperfection alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import ARMS, load
from rbimpedance.control.default_gains import slope_at_zero
from rbimpedance.trajectories import cosine
from rbimpedance.tuning.worst_case import true_error

from .linear import Array, Linear

DT = 1e-3
LENGTH, SHORT, LATE = 5.0, 4.0, 3.0
"""Length of a run, of one in a search for a bound, and the time after which they are judged [s]."""
ROTOR = 0.1  # kg·m²
PUSH = rbi.interaction.Push([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], start=0.5, duration=1.0)
ACCURACY = 5e-3  # rad, of what the controller sees
ROUGHNESS = 0.01  # change of the torque from tick to tick, as a share of the effort limit
SUBSTEPS = (4, 8, 16, 32, 64)


@dataclass(frozen=True)
class Hardware:
    """What lies between a controller and links.

    Attributes:
        time_constant: Of the torque [s].
        ripple: Of the torque, relative.
        bits: Of the encoders, to a turn of the joint; None for exact positions and velocities.
        stiffness: Factor on the usual stiffness of the joints; infinite for rigid ones.
        side: Where the encoders are.
    """

    time_constant: float = 0.0
    ripple: float = 0.0
    bits: int | None = None
    stiffness: float = np.inf
    side: Any = "motor"


PERFECT = Hardware()
USUAL = Hardware(time_constant=1.5e-3, ripple=0.01, bits=19, stiffness=1.0)


def usual_stiffness(arm: rbi.ArmModel) -> Array:
    """1e4 N·m/rad where a joint gives 30 N·m or more, 5e3 from 10 N·m on, 3e3 below."""
    limit = arm.effort_limit
    return np.where(limit >= 30.0, 1e4, np.where(limit >= 10.0, 5e3, 3e3))


def resolution(bits: int) -> float:
    """A count of an encoder with that many bits to a turn [rad]."""
    return float(2.0 * np.pi / 2**bits)


@dataclass(frozen=True)
class Trial:
    """An arm with its heaviest plant and a law.

    Attributes:
        arm: As it is modelled, armature included.
        plant: With the largest payload and links 10 % heavier.
        controller: The law.
        runs: What was measured, by hardware.
    """

    arm: rbi.ArmModel
    plant: rbi.ArmModel
    controller: rbi.ImpedanceController
    runs: dict[tuple[Hardware, float], dict[str, Any]] = field(default_factory=dict)

    def driven(self, hardware: Hardware) -> rbi.DrivenPlant:
        """The plant behind its drives."""
        return rbi.DrivenPlant(
            self.plant,
            time_constant=hardware.time_constant,
            ripple=hardware.ripple,
            stiffness=hardware.stiffness * usual_stiffness(self.arm),
            encoders=hardware.side,
        )

    def run(self, hardware: Hardware, length: float = LENGTH) -> dict[str, Any]:
        """Run the law on that hardware; errors in rad, roughness as a share of the effort limit."""
        if (hardware, length) not in self.runs:
            self.runs[hardware, length] = self._measured(hardware, length)
        return self.runs[hardware, length]

    def is_quiet(self, hardware: Hardware) -> bool:
        """Whether a short run is what the page calls quiet."""
        return bool(self.run(hardware, SHORT)["quiet"])

    def linear(self, hardware: Hardware) -> Linear:
        """The loop about s = 0 at the start of the run."""
        arm, plant = self.arm, self.driven(hardware)
        law: Any = self.controller
        q = arm.neutral
        armature = np.diag(plant.arm.armature)
        return Linear(
            model=law.arm.mass_matrix(q),
            links=plant.arm.mass_matrix(q) - armature,
            viscous=self.plant.viscous,
            rotor=arm.armature,
            stiffness=plant.stiffness if plant.elastic.any() else None,
            damping=plant.damping,
            time_constant=hardware.time_constant,
            side=hardware.side,
            is_differentiated=hardware.bits is not None,
            slope=float(slope_at_zero(law.surface, arm.nv).max()),
            margin=float(np.max(law.reaching.margin)),
            h=DT,
        )

    def _measured(self, hardware: Hardware, length: float) -> dict[str, Any]:
        controller: Any = self.controller
        if hardware.bits is not None:
            count = resolution(hardware.bits)
            controller = rbi.QuantizedEncoders(controller, resolution=count)
        try:
            result = _simulated(controller, self.driven(hardware), length)
        except rbi.DivergenceError as error:
            return {"quiet": False, "diverges": error.joint, "at": error.time}
        late = result.t >= LATE
        steps = np.sqrt((np.diff(result.tau[late], axis=0) ** 2).mean(axis=0))
        shares = steps / self.arm.effort_limit
        e1 = np.abs(result.e1[late]).max()
        return {
            "quiet": bool(shares.max() <= ROUGHNESS and e1 <= ACCURACY),
            "e1": float(e1),
            "link": float(np.abs(true_error(self.plant, result)[late]).max()),
            "roughness": float(shares.max()),
            "joint": self.arm.joint_names[int(np.argmax(shares))],
            "variation": float(result.metrics(after=LATE)["tau_variation"].sum()),
        }


def _simulated(controller: Any, plant: rbi.DrivenPlant, length: float) -> rbi.SimulationResult:
    """The run, with as many substeps as the springs need."""
    trajectory = cosine(plant.arm, amplitude=0.2, period=6.0)
    for substeps in SUBSTEPS:
        try:
            plant.begin(plant.arm.neutral, np.zeros(plant.arm.nv), DT / substeps)
        except rbi.ParameterError:
            continue
        return rbi.simulate(
            controller, plant, trajectory, environment=PUSH, duration=length, substeps=substeps
        )
    raise rbi.ParameterError("stiffness", "the springs'", f"borne by {SUBSTEPS[-1]} substeps")


def arm_and_plant(name: str, rotor: float = ROTOR) -> tuple[rbi.ArmModel, rbi.ArmModel]:
    """The arm as modelled, and the plant of every run: links 10 % heavier, the largest payload at the tool."""
    arm = load(name, rotor)
    return arm, arm.with_scaled_inertia(1.1).with_payload(ARMS[name])


def propose(arm: rbi.ArmModel, name: str, accuracy: float, **sensors: Any) -> rbi.GainProposal:
    """The library's proposal for the unknown payload and links."""
    unknown = rbi.Uncertainty(payload=ARMS[name], inertia_scale=1.1, **sensors)
    motion = cosine(arm, amplitude=0.2, period=6.0)
    return rbi.propose_gains(arm, unknown, motion, DT, accuracy=accuracy)


def boundary(
    is_good: Callable[[float], bool], good: float, bad: float, halvings: int
) -> float | None:
    """The last good value on the way from good to bad, by bisection on a logarithmic scale.

    None where even the first is not good; the last one where all are.
    """
    if not is_good(good):
        return None
    if is_good(bad):
        return bad
    for _ in range(halvings):
        middle = float(np.sqrt(good * bad))
        good, bad = (middle, bad) if is_good(middle) else (good, middle)
    return good


def fewest_bits(is_good: Callable[[int], bool], most: int = 28, least: int = 14) -> int | None:
    """The coarsest encoder that is good, by bisection; None where not even the finest is."""
    if not is_good(most):
        return None
    while most - least > 1:
        middle = (most + least) // 2
        most, least = (middle, least) if is_good(middle) else (most, middle)
    return most


def with_bits(hardware: Hardware, bits: int | None) -> Hardware:
    """The same with other encoders."""
    return replace(hardware, bits=bits)
