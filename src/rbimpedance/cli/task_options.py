"""Options of what a controller is for: the motion, what is unknown, and the impedance that is wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..exceptions import ParameterError
from ..law.impedance import Impedance
from ..robot.arm_model import ArmModel
from ..trajectories import Trajectory, cosine
from ..tuning import Uncertainty
from ..tuning.plant_sample import PlantSample
from .options import numbers, option


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """The reference: a cosine about a centre."""

    center: Annotated[
        str | None,
        option(
            "--center",
            "Of the cosine reference in rad or m. Default: the arm's ready posture.",
            "Motion",
            "Q[,Q..]",
        ),
    ] = None
    amplitude: Annotated[
        str | None,
        option(
            "--amplitude",
            "Of it in rad or m. Default: 0.2, or what the joint's limits leave.",
            "Motion",
            "A[,A..]",
        ),
    ] = None
    period: Annotated[float, option("--period", "Of it in s.", "Motion", "S")] = 6.0
    start: Annotated[
        str | None,
        option(
            "--start",
            "Where the arm starts. Default: where the reference does.",
            "Motion",
            "Q[,Q..]",
        ),
    ] = None
    dt: Annotated[float, option("--dt", "Control period in s.", "Motion", "S")] = 1e-3
    duration: Annotated[float, option("--duration", "Length in s.", "Motion", "S")] = 5.0

    def trajectory(self, arm: ArmModel) -> Trajectory:
        """Return the reference."""
        center = None if self.center is None else _posture("--center", self.center, arm)
        amplitude = None if self.amplitude is None else numbers("--amplitude", self.amplitude)
        return cosine(arm, center=center, amplitude=amplitude, period=self.period)

    def start_of(self, arm: ArmModel, trajectory: Trajectory) -> Array:
        """Return the configuration to start from, shape (nq,)."""
        return trajectory(0.0).q if self.start is None else _posture("--start", self.start, arm)


@dataclass(frozen=True, kw_only=True)
class UnknownOptions:
    """What the controller does not know."""

    payload: Annotated[
        str,
        option("--payload", "At the tool: largest, or a range.", "Unknown", "KG[,KG]"),
    ] = "0"
    payload_com: Annotated[
        str,
        option("--payload-com", "Where, in the tool's axes in m.", "Unknown", "X,Y,Z"),
    ] = "0,0,0"
    payload_gyration: Annotated[
        str,
        option("--payload-gyration", "Its radius of gyration in m.", "Unknown", "R[,R]"),
    ] = "0"
    inertia_scale: Annotated[
        str,
        option("--inertia-scale", "Factor on the links' inertia.", "Unknown", "F[,F]"),
    ] = "1"
    viscous: Annotated[
        str,
        option("--viscous", "Viscous friction in N m s/rad.", "Unknown", "D[,D]"),
    ] = "0"
    coulomb: Annotated[str, option("--coulomb", "Dry friction in N m.", "Unknown", "C[,C]")] = "0"
    torque_constant: Annotated[
        float,
        option("--torque-constant", "Relative error of the torque.", "Unknown", "X"),
    ] = 0.0
    position_noise: Annotated[
        float,
        option("--position-noise", "Standard deviation in rad.", "Unknown", "X"),
    ] = 0.0
    velocity_noise: Annotated[
        float,
        option("--velocity-noise", "Standard deviation in rad/s.", "Unknown", "X"),
    ] = 0.0
    delay: Annotated[int, option("--delay", "Of the measurements in ticks.", "Unknown", "N")] = 0
    seed: Annotated[int, option("--seed", "Of everything random.", "Unknown", "N")] = 0

    def uncertainty(self) -> Uncertainty:
        """Return the ranges."""
        ranges = {name: numbers(option, text) for name, option, text in self._ranges()}
        return self._with(ranges, self.torque_constant)

    def plant(self, arm: ArmModel) -> PlantSample:
        """Return the arm that is simulated: each range at the number given last."""
        ends = {name: np.ravel(numbers(option, text))[-1] for name, option, text in self._ranges()}
        constant = 1.0 + self.torque_constant
        ranges = {name: np.array([end, end]) for name, end in ends.items()}
        (sample,) = self._with(ranges, (constant, constant)).sample(arm, 1, seed=self.seed)
        return sample

    def _ranges(self) -> tuple[tuple[str, str, str], ...]:
        return (
            ("payload", "--payload", self.payload),
            ("payload_gyration", "--payload-gyration", self.payload_gyration),
            ("inertia_scale", "--inertia-scale", self.inertia_scale),
            ("viscous", "--viscous", self.viscous),
            ("coulomb", "--coulomb", self.coulomb),
        )

    def _with(self, ranges: Mapping[str, Any], torque_constant: ArrayLike) -> Uncertainty:
        return Uncertainty(
            **ranges,
            payload_com=numbers("--payload-com", self.payload_com, 3),
            torque_constant=torque_constant,
            position_noise=self.position_noise,
            velocity_noise=self.velocity_noise,
            delay=self.delay,
        )


@dataclass(frozen=True, kw_only=True)
class TargetOptions:
    """The impedance that the arm is to have, and the torques that it may use."""

    mass: Annotated[str, option("--mass", "M_d, per joint.", "Target", "M[,M..]")] = "1"
    damping: Annotated[str, option("--damping", "D_d, per joint.", "Target", "D[,D..]")] = "10"
    stiffness: Annotated[str, option("--stiffness", "K_d, per joint.", "Target", "K[,K..]")] = "20"
    limits: Annotated[
        str | None,
        option(
            "--limits",
            "Torque limits to keep in N m; urdf: those of the description, the default where it "
            "has any; none: no limits.",
            "Target",
            "T[,T..]",
        ),
    ] = None

    def impedance(self) -> Impedance:
        """Return the target."""
        return Impedance(
            mass=numbers("--mass", self.mass),
            damping=numbers("--damping", self.damping),
            stiffness=numbers("--stiffness", self.stiffness),
        )

    def torque_limits(self, arm: ArmModel) -> Array | None:
        """Return the limits, per joint or one for all; None for none."""
        given = bool(np.isfinite(arm.effort_limit).any())
        if self.limits is None:
            return arm.effort_limit if given else None
        if self.limits == "urdf" and not given:
            words = f"numbers: '{arm.name}' comes without effort limits"
            raise ParameterError("--limits", self.limits, words)
        if self.limits == "urdf":
            return arm.effort_limit
        return None if self.limits == "none" else numbers("--limits", self.limits)


class Task(NamedTuple):
    """What a controller is for.

    Attributes:
        arm: The arm as its description says.
        motion: What it follows.
        target: How it is to feel.
        unknown: What the controller does not know.
    """

    arm: ArmModel
    motion: MotionOptions
    target: TargetOptions
    unknown: UnknownOptions


def _posture(option: str, text: str, arm: ArmModel) -> Array:
    """Read joint positions, one for all or one each [rad or m]; returns a configuration, shape (nq,)."""
    positions = np.ravel(numbers(option, text))
    if len(positions) not in {1, arm.nv}:
        raise ParameterError(option, text, f"one number, or one for each of the {arm.nv} joints")
    return arm.integrate(arm.zero, np.broadcast_to(positions, arm.nv).copy())
