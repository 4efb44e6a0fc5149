"""What controllers that wrap a controller share: what is not theirs goes to the one inside."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..law.impedance import TargetImpedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .protocol import WrappableController
from .telemetry import ControllerOutput, Situation

WrapperStateT = TypeVar("WrapperStateT", bound=Any)
"""A named tuple with the state of the controller inside as `inner`."""

OutputT = TypeVar("OutputT", bound=ControllerOutput)


@dataclass(frozen=True, eq=False, init=False)
class ControllerWrapper(ABC, Generic[WrapperStateT, OutputT]):
    """A controller around a controller; children give `init` and `_step`, and change what else they need to.

    Attributes:
        controller: The controller inside.
    """

    controller: WrappableController[Any]

    @property
    def arm(self) -> ArmModel:
        """The controller's own model of the arm."""
        return self.controller.arm

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return self.controller.dt

    @property
    def impedance(self) -> TargetImpedance:
        """Target impedance of the controller inside."""
        return self.controller.impedance

    @property
    def limits(self) -> Limits | None:
        """Limits of the torque; those of the controller inside."""
        return self.controller.limits

    @abstractmethod
    def init(self) -> WrapperStateT:
        """Return the state before the first tick."""

    @abstractmethod
    def _step(
        self,
        state: WrapperStateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
    ) -> tuple[OutputT, WrapperStateT]:
        """A tick whose measured period is in the state already."""

    def step(
        self,
        state: WrapperStateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> tuple[OutputT, WrapperStateT]:
        """Compute the torque of one tick; see `ImpedanceController.step`.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick.
            tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].
            period: Measured time since the tick before; dt if it is not given [s].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            InputError: A period that `elapsed` refuses.
        """
        if period is not None:
            state = self.elapsed(state, period)
        return self._step(state, q, v, reference, tau_ext)

    def elapsed(self, state: WrapperStateT, period: float) -> WrapperStateT:
        """Return the state at a tick that comes a measured time after the one before, instead of dt after it.

        Args:
            state: From the tick before.
            period: Time since then [s]; see `ImpedanceController.elapsed`.

        Raises:
            InputError: A period that is refused there.
        """
        following: WrapperStateT = state._replace(
            inner=self.controller.elapsed(state.inner, period)
        )
        return following

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
