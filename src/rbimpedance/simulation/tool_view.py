"""A `CartesianController` in the closed loop: where it starts, and what measures the wrench."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._common.arrays import Array
from ..control.cartesian_base import CartesianControllerBase
from ..control.tool_view import ToolView
from ..exceptions import ParameterError
from ..interaction import Interaction, Perfect, Sensor
from ..interaction.wrenches import AppliedWrench, FrameInteraction, says_where, wrench_at
from ..law.poses import check_cartesian_reference
from ..robot.arm_model import ArmModel
from ..robot.inverse_kinematics import inverse_kinematics
from ..trajectories.cartesian import CartesianTrajectory


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
