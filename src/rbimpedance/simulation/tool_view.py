"""A `CartesianController` in the closed loop: what it measures, and its errors as errors of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from ..control.cartesian_base import CartesianControllerBase
from ..control.cartesian_telemetry import CartesianOutput
from ..control.wrapper import Around
from ..exceptions import ParameterError
from ..interaction import Interaction, Perfect, Sensor
from ..interaction.wrenches import AppliedWrench, FrameInteraction, says_where, wrench_at
from ..law.poses import CartesianReference, check_cartesian_reference
from ..law.rotations import RotationVector
from ..robot.arm_model import ArmModel
from ..robot.inverse_kinematics import inverse_kinematics
from ..trajectories.cartesian import CartesianTrajectory


class ToolTick(NamedTuple):
    """Output of a tick at the tool, with its errors as errors of the joints.

    J^# maps the error of the tool to the joints: q_r is a configuration with the tool at x_r, to first order. Where a
    singularity takes the tool's motion, the joints have no error, and where the posture is off, neither.

    Attributes:
        at_tool: The output itself.
        q_r: q (+) e1, shape (nq,).
        e1: Error of the joints, shape (nv,) [rad or m].
        e2: Its rate, shape (nv,).
        s: Sliding variable, shape (nv,).
        tau: Motor torque, shape (nv,) [N·m or N].
        saturated: Whether the joint is at its torque limit, shape (nv,), bool.
        rate_limited: Whether its torque may not change faster, shape (nv,), bool.
        clipped: False: the surfaces are those of the tool.
        reference_limited: False: no guard limits the reference.
    """

    at_tool: CartesianOutput
    q_r: Array
    e1: Array
    e2: Array
    s: Array
    tau: Array
    saturated: BoolArray
    rate_limited: BoolArray
    clipped: BoolArray
    reference_limited: BoolArray


@dataclass(frozen=True, eq=False)
class ToolView(Around):
    """A `CartesianController` as what the closed loop takes.

    Attributes:
        controller: The controller.
        measures_wrench: Whether the sensor gives the wrench at the frame; otherwise a joint torque, from which the
            wrench is computed.
    """

    controller: CartesianControllerBase[Any]
    measures_wrench: bool

    def init(self) -> Any:
        """Return the state before the first tick."""
        return self.controller.init()

    def step(
        self,
        state: Any,
        q: Array,
        v: Array,
        reference: CartesianReference,
        measured: Array,
    ) -> tuple[ToolTick, Any]:
        """Return the output of one tick and the next state; measured is the wrench or the joint torque."""
        controller = self.controller
        if self.measures_wrench:
            output, following = controller.step(state, q, v, reference, measured)
        else:
            wrench = controller.wrench_from_torque(q, measured)
            output, following = controller.step(state, q, v, reference, wrench, measured)
        return self._in_joints(output, q), following

    def impedance_error(self, output: ToolTick, a: Array) -> Array:
        """Return Jᵀ times the impedance error of the tool, shape (nv,); see `CartesianController`."""
        return self.controller.impedance_error(output.at_tool, a)

    def _in_joints(self, output: CartesianOutput, q: Array) -> ToolTick:
        none = np.zeros(self.arm.nv, dtype=np.bool_)
        to_world = np.eye(6)
        to_world[3:, 3:] = RotationVector(output.e1[3:]).right
        to_joints = output.inverse @ to_world
        e1 = to_joints @ output.e1
        return ToolTick(
            output,
            self.arm.raw_dynamics.integrate(q, e1),
            e1,
            e2=to_joints @ output.e2,
            s=to_joints @ output.s,
            tau=output.tau,
            saturated=output.saturated,
            rate_limited=output.rate_limited,
            clipped=none,
            reference_limited=none,
        )


@dataclass(frozen=True, eq=False)
class WristWrench:
    """A perfect six-axis sensor at a frame: it measures what acts at frames on its link and beyond, not before it.

    Attributes:
        arm: The plant.
        frame: The frame.
        environment: What pushes on the arm.
        dt: Control period [s].
    """

    arm: ArmModel
    frame: str
    environment: Interaction
    dt: float

    def init(self) -> int:
        """Return the number of ticks so far."""
        return 0

    def step(self, state: int, q: Array, v: Array, tau: Array, tau_ext: Array) -> tuple[Array, int]:
        """Return the wrench at the frame in world axes, shape (6,), and the number of ticks; see `Sensor.step`."""
        del tau, tau_ext
        if not isinstance(self.environment, FrameInteraction):
            return np.zeros(6), state + 1
        acting = self.environment.wrenches(self.arm, state * self.dt, q, v)
        beyond = [each for each in acting if self._is_beyond(each)]
        return wrench_at(self.arm, self.frame, beyond, q), state + 1

    def _is_beyond(self, acting: AppliedWrench) -> bool:
        model, ids = self.arm.raw_dynamics.model, self.arm.raw_dynamics.frame_ids
        own, other = (model.frames[ids[name]].parentJoint for name in (self.frame, acting.frame))
        return own in model.supports[other]


def tool_view(
    controller: CartesianControllerBase[Any],
    plant: ArmModel,
    environment: Interaction,
    sensor: Sensor[Any] | None,
) -> tuple[ToolView, Sensor[Any]]:
    """Return the controller and the sensor as the closed loop takes them.

    Raises:
        ParameterError: Without a sensor, the environment has to say which wrenches it exerts.
    """
    if sensor is not None and not isinstance(sensor, Perfect):
        return ToolView(controller, measures_wrench=False), sensor
    if not says_where(environment):
        words = "given: this environment does not say which wrench it exerts at the tool"
        raise ParameterError("sensor", None, words)
    wrist = WristWrench(plant, controller.frame, environment, controller.dt)
    return ToolView(controller, measures_wrench=True), wrist


def start_of(controller: CartesianControllerBase[Any], trajectory: CartesianTrajectory) -> Array:
    """Return a configuration in which the tool is where the trajectory begins, shape (nq,).

    Raises:
        ParameterError: There is none within the arm's limits.
    """
    pose = check_cartesian_reference(trajectory(0.0)).pose
    return inverse_kinematics(controller.arm, pose, frame=controller.frame)
