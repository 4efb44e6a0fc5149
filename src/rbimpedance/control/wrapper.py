"""What controllers that wrap a controller share: what is not theirs goes to the one inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from .._common.arrays import Array
from ..exceptions import ParameterError
from ..law.impedance import TargetImpedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from .cartesian_base import CartesianControllerBase
from .protocol import ControllerBase, OutputT, WrappableController
from .telemetry import ControllerOutput, Situation

WrapperStateT = TypeVar("WrapperStateT", bound=Any)
"""A named tuple with the state of the controller inside as `inner`."""

_Wrapped = TypeVar("_Wrapped")


def tool_inside(controller: Any) -> CartesianControllerBase[Any] | None:
    """Return the controller at the tool that a controller is or wraps; None where there is none."""
    while controller is not None and not isinstance(controller, CartesianControllerBase):
        controller = getattr(controller, "controller", None)
    return controller


def of_joints(controller: _Wrapped) -> _Wrapped:
    """Return the controller that a wrapper is given.

    Args:
        controller: The controller.

    Raises:
        ParameterError: It works at the tool, or wraps one that does.
    """
    tool = tool_inside(controller)
    if tool is not None:
        kind = type(tool).__name__
        words = (
            "one of the joints: this wrapper compares and blends motions of joints; a controller at the tool keeps "
            "its own limits= and joint_limits="
        )
        raise ParameterError("controller", kind, words)
    return controller


@dataclass(frozen=True, eq=False, init=False)
class Around:
    """What has a controller inside has its arm and its period.

    Attributes:
        controller: The controller inside.
    """

    controller: WrappableController[Any] | CartesianControllerBase[Any]

    @property
    def arm(self) -> ArmModel:
        """The controller's own model of the arm."""
        return self.controller.arm

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return self.controller.dt


@dataclass(frozen=True, eq=False, init=False)
class ControllerWrapper(Around, ControllerBase[WrapperStateT, OutputT]):
    """A controller around a controller; children give `init` and `_step`, and change what else they need to.

    Attributes:
        controller: The controller inside.
    """

    controller: WrappableController[Any]

    @property
    def impedance(self) -> TargetImpedance:
        """Target impedance of the controller inside."""
        return self.controller.impedance

    @property
    def limits(self) -> Limits | None:
        """Limits of the torque; those of the controller inside."""
        return self.controller.limits

    def _elapsed(self, state: WrapperStateT, period: float) -> WrapperStateT:
        following: WrapperStateT = state._replace(
            inner=self.controller.elapsed(state.inner, period)
        )
        return following

    def warm_up(self) -> None:
        """Take one tick and forget it; see `ControllerBase.warm_up`."""
        tool = tool_inside(self)
        if tool is None:
            super().warm_up()
            return
        tool.warm_up()
        at_rest: Any = tool.at_rest(self.arm.ready)
        zero = np.zeros(self.arm.nv)
        self.step(self.init(), self.arm.ready, zero, at_rest, zero)

    def handover(self, state: WrapperStateT, now: Situation) -> WrapperStateT:
        """Return the state with which the arm is taken over as it is now; see `ImpedanceController.handover`.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        following: WrapperStateT = state._replace(inner=self.controller.handover(state.inner, now))
        return following

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im of the controller inside; see `ImpedanceController.impedance_error`.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        return self.controller.impedance_error(output, a)
