"""A controller at the tool as one of the joints, for closed loops, sensors and actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from .._common.arrays import Array, BoolArray
from ..law.cartesian_impedance import CartesianImpedance
from ..law.limits import Limits
from ..law.poses import CartesianReference
from ..law.rotations import RotationVector
from ..robot.arm_model import ArmModel
from .cartesian_base import CartesianControllerBase
from .cartesian_telemetry import CartesianOutput
from .protocol import Controller
from .telemetry import Situation
from .wrapper import Around

AnyController: TypeAlias = Controller[Any] | CartesianControllerBase[Any]
"""A controller of the joints, or one at the tool."""


class ToolTick(NamedTuple):
    """Output of a tick at the tool, with its errors as errors of the joints.

    J^# maps the error of the tool to the joints: q_r is a configuration with the tool at x_r, to first order. Where a
    singularity takes the tool's motion, the joints have no error, and where the posture is off, neither.

    Attributes:
        at_tool: The output itself; its torque is the controller's own, also where a guard sends another one.
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
    """A controller at the tool as one of the joints, which takes poses.

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
        return tool_tick(self.arm, output, q), following

    @property
    def impedance(self) -> CartesianImpedance:
        """Target impedance at the frame."""
        return self.controller.impedance

    @property
    def limits(self) -> Limits | None:
        """Limits of the torque; None where the controller has none."""
        return getattr(self.controller, "limits", None)

    def elapsed(self, state: Any, period: float) -> Any:
        """Return the state at a tick that comes a measured time after the one before; see `TickBase.elapsed`."""
        return self.controller.elapsed(state, period)

    def handover(self, state: Any, now: Situation) -> Any:
        """Return the state with which the arm is taken over as it is now; see `CartesianController.handover`."""
        return self.controller.handover(state, now)

    def impedance_error(self, output: ToolTick, a: Array) -> Array:
        """Return Jᵀ times the impedance error of the tool, shape (nv,); see `CartesianController`."""
        return self.controller.impedance_error(output.at_tool, a)


def tool_tick(arm: ArmModel, output: CartesianOutput, q: Array) -> ToolTick:
    """Return the output of a tick at the tool as one of the joints.

    Args:
        arm: The controller's model of the arm.
        output: Of the tick.
        q: Configuration, shape (nq,).
    """
    none = np.zeros(arm.nv, dtype=np.bool_)
    to_joints, at_tool = output.inverse.copy(), output.e1
    to_joints[:, 3:] = to_joints[:, 3:] @ RotationVector(at_tool[3:]).right
    e1 = to_joints @ at_tool
    return ToolTick(
        output,
        arm.raw_dynamics.integrate(q, e1),
        e1,
        e2=to_joints @ output.e2,
        s=to_joints @ output.s,
        tau=output.tau,
        saturated=output.saturated,
        rate_limited=output.rate_limited,
        clipped=none,
        reference_limited=none,
    )


def in_joints(controller: AnyController) -> Any:
    """Return a controller as one that takes the torque of the environment on the joints.

    Args:
        controller: One of the joints, which comes back as it is, or one at the tool.
    """
    if isinstance(controller, CartesianControllerBase):
        return ToolView(controller, measures_wrench=False)
    return controller
