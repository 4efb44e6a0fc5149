"""Options of what a controller is for: the motion, what is unknown, the impedance that is wanted, and where."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive, positive_number
from ..exceptions import DimensionError, InputError, ParameterError
from ..law.impedance import Impedance
from ..robot.arm_model import ArmModel
from ..robot.dexterous import dexterous_configuration
from ..trajectories import Trajectory, cosine
from ..tuning import Uncertainty
from ..tuning.plant_sample import PlantSample
from .options import Robot, RobotOptions, numbers, option
from .tool_options import ToolOptions

_motion = partial(option, "Motion")
_unknown = partial(option, "Unknown")
_target = partial(option, "Target")


LONGEST_DT = 0.1
"""Longest control period of a run [s]; no arm is controlled more slowly."""


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """The reference: a cosine about a centre."""

    center: Annotated[
        str | None,
        _motion(
            "Of the cosine reference in rad or m; with --frame where the tool begins. Default: the arm's ready "
            "posture; with --frame another one where that is singular.",
            "Q[,Q..]",
        ),
    ] = None
    amplitude: Annotated[
        str | None,
        _motion("Of it in rad or m. Default: 0.2, or what the joint's limits leave.", "A[,A..]"),
    ] = None
    period: Annotated[float, _motion("Of it in s.", "S")] = 6.0
    start: Annotated[
        str | None, _motion("Where the arm starts. Default: where the reference does.", "Q[,Q..]")
    ] = None
    dt: Annotated[float, _motion("Control period in s.", "S")] = 1e-3
    duration: Annotated[float, _motion("Length in s.", "S")] = 5.0

    def trajectory(self, arm: ArmModel) -> Trajectory:
        """Return the reference."""
        center = None if self.center is None else _posture("--center", self.center, arm)
        amplitude = None if self.amplitude is None else numbers("--amplitude", self.amplitude)
        return cosine(arm, center=center, amplitude=amplitude, period=self.period)

    def middle(self, arm: ArmModel) -> Array:
        """Return the configuration at which the motion of a frame begins, shape (nq,)."""
        if self.center is None:
            return dexterous_configuration(arm, arm.tool_frame)
        return _posture("--center", self.center, arm)

    def start_of(self, arm: ArmModel, usual: Array) -> Array:
        """Return the configuration to start from, shape (nq,)."""
        return usual if self.start is None else _posture("--start", self.start, arm)


@dataclass(frozen=True, kw_only=True)
class UnknownOptions:
    """What the controller does not know."""

    payload: Annotated[str, _unknown("At the tool: largest, or a range.", "KG[,KG]")] = "0"
    payload_com: Annotated[str, _unknown("Where, in the tool's axes in m.", "X,Y,Z")] = "0,0,0"
    payload_gyration: Annotated[str, _unknown("Its radius of gyration in m.", "R[,R]")] = "0"
    inertia_scale: Annotated[str, _unknown("Factor on the links' inertia.", "F[,F]")] = "1"
    viscous: Annotated[str, _unknown("Viscous friction in N m s/rad.", "D[,D]")] = "0"
    coulomb: Annotated[str, _unknown("Dry friction in N m.", "C[,C]")] = "0"
    torque_constant: Annotated[float, _unknown("Relative error of the torque.", "X")] = 0.0
    position_noise: Annotated[float, _unknown("Standard deviation in rad.", "X")] = 0.0
    velocity_noise: Annotated[float, _unknown("Standard deviation in rad/s.", "X")] = 0.0
    delay: Annotated[int, _unknown("Of the measurements in ticks.", "N")] = 0
    seed: Annotated[int, _unknown("Of everything random.", "N")] = 0

    def uncertainty(self) -> Uncertainty:
        """Return the ranges."""
        return self._with(dict(self._ranges()), self.torque_constant)

    def is_nothing(self) -> bool:
        """Whether the model is exact and every sensor ideal."""
        return replace(self, seed=0) == UnknownOptions()

    def plant(self, arm: ArmModel) -> PlantSample:
        """Return the arm that is simulated: each range at the number given last."""
        constant = 1.0 + self.torque_constant
        ranges = {name: np.repeat(np.ravel(given)[-1], 2) for name, given in self._ranges()}
        (sample,) = self._with(ranges, (constant, constant)).sample(arm, 1, seed=self.seed)
        return sample

    def _ranges(self) -> Iterator[tuple[str, Array]]:
        for name in ("payload", "payload_gyration", "inertia_scale", "viscous", "coulomb"):
            yield name, numbers(f"--{name.replace('_', '-')}", getattr(self, name))

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

    mass: Annotated[
        str | None,
        _target(
            "M_d, per joint. Default: 1. With --frame in kg and kg m^2, for translation and rotation or six numbers. "
            "Default: 3,0.15.",
            "M[,M..]",
        ),
    ] = None
    damping: Annotated[
        str | None,
        _target(
            "D_d, per joint. Default: 10. With --frame in N s/m and N m s/rad, likewise. Default: critical.",
            "D[,D..]",
        ),
    ] = None
    stiffness: Annotated[
        str | None,
        _target(
            "K_d, per joint. Default: 20. With --frame in N/m and N m/rad, likewise. Default: 600,20.",
            "K[,K..]",
        ),
    ] = None
    accuracy: Annotated[float, _target("Largest error allowed in rad or m.", "X")] = 1e-3
    limits: Annotated[
        str | None,
        _target(
            "Torque limits to keep in N m; urdf: those of the description, the default where it "
            "has any; none: no limits.",
            "T[,T..]",
        ),
    ] = None

    def impedance(self) -> Impedance:
        """Return the target of the joints."""
        return Impedance(
            mass=numbers("--mass", self.mass or "1"),
            damping=numbers("--damping", self.damping or "10"),
            stiffness=numbers("--stiffness", self.stiffness or "20"),
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


@contextmanager
def naming_joints(arm: ArmModel) -> Iterator[None]:
    """Add the names of the joints to errors about how many numbers there are."""
    try:
        yield
    except DimensionError as error:
        names = ", ".join(arm.joint_names)
        raise InputError(f"{error}; the {arm.nv} joints are {names}") from error


@dataclass(frozen=True)
class Task:
    """What a controller is for.

    Attributes:
        arm: The arm as its description says.
        motion: What it follows.
        target: How it is to feel.
        unknown: What the controller does not know.
        tool: The frame that is controlled, if any.
    """

    arm: ArmModel
    motion: MotionOptions
    target: TargetOptions
    unknown: UnknownOptions
    tool: ToolOptions

    def trajectory(self) -> Any:
        """Return the desired motion, of the joints or of the frame."""
        motion = self.motion
        if self.tool.frame is None:
            return motion.trajectory(self.arm)
        if motion.amplitude is not None:
            words = "left out with --frame, whose motion is --line or --circle"
            raise ParameterError("--amplitude", motion.amplitude, words)
        return self.tool.trajectory(self.arm, self._middle, motion.period)

    @functools.cached_property
    def _middle(self) -> Array:
        """Where the motion of a frame begins; a search, which is done once."""
        return self.motion.middle(self.arm)

    def start(self) -> Array:
        """Return the configuration to start from, shape (nq,)."""
        motion, arm = self.motion, self.arm
        is_joints = self.tool.frame is None
        return motion.start_of(arm, self.trajectory()(0.0).q if is_joints else self._middle)

    def impedance(self) -> Any:
        """Return the target, of the joints or of the frame."""
        given = self.target
        if self.tool.frame is None:
            return given.impedance()
        return self.tool.impedance(given.mass, given.damping, given.stiffness)

    def check(self) -> None:
        """Read every option once, so that what cannot be is said before any work is done.

        Raises:
            ParameterError: A value that cannot be.
            InputError: The same, or a motion outside the joints' limits.
        """
        with naming_joints(self.arm):
            self._check()

    def _check(self) -> None:
        dt = positive_number("dt", self.motion.dt, "control period in seconds")
        if dt > LONGEST_DT:
            raise ParameterError("dt", dt, f"a control period in seconds, at most {LONGEST_DT:g}")
        positive_number("duration", self.motion.duration, "length in seconds")
        positive_number("accuracy", self.target.accuracy, "error")
        self.unknown.uncertainty()
        self.unknown.plant(self.arm)
        self.trajectory()
        self.start()
        impedance = self.impedance()
        if isinstance(impedance, Impedance):
            impedance.filter(self.arm.nv, dt)
        limits = self.target.torque_limits(self.arm)
        if limits is not None:
            per_joint("--limits", positive("--limits", limits), self.arm.nv)


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """All options that a `Task` is made of."""

    robot: Robot
    reading: RobotOptions
    unknown: UnknownOptions
    motion: MotionOptions
    target: TargetOptions
    tool: ToolOptions

    def task(self) -> Task:
        """Load the robot, and return the task."""
        arm = self.tool.load(self.reading, self.robot)
        return Task(arm, self.motion, self.target, self.unknown, self.tool)


def _posture(option: str, text: str, arm: ArmModel) -> Array:
    """Read joint positions, one for all or one each [rad or m]; returns a configuration, shape (nq,)."""
    positions = np.ravel(numbers(option, text))
    if len(positions) not in {1, arm.nv}:
        names = ", ".join(arm.joint_names)
        words = f"one number, or {arm.nv} numbers, one for each of the joints {names}"
        raise ParameterError(option, text, words)
    return arm.integrate(arm.zero, np.broadcast_to(positions, arm.nv).copy())
