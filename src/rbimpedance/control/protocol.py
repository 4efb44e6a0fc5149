"""What a controller is, for all that runs, wraps or compares controllers."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..exceptions import InputError
from ..law.impedance import TargetImpedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .telemetry import ControllerOutput, Situation

Backend = Literal["numpy", "pinocchio", "compiled"]
"""Who computes a tick: NumPy, the specification; compiled code around Pinocchio's algorithms; compiled code alone."""

StateT = TypeVar("StateT")
OutputT = TypeVar("OutputT", bound=ControllerOutput)
GivenT = TypeVar("GivenT")
AnswerT = TypeVar("AnswerT")

LONGEST_PERIOD = 100.0
"""Longest measured period that a tick accepts, in control periods."""


class Controller(Protocol[StateT]):
    """What `simulate` and studies need of a controller."""

    @property
    def arm(self) -> ArmModel:
        """The controller's own model of the arm."""

    @property
    def dt(self) -> float:
        """Control period [s]."""

    def init(self) -> StateT:
        """Return the state before the first tick."""

    def step(
        self, state: StateT, q: ArrayLike, v: ArrayLike, reference: Reference, tau_ext: ArrayLike
    ) -> tuple[ControllerOutput, StateT]:
        """Return the output of one tick and the next state."""

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im of the paper's eq. (5), given the acceleration a that the tick's torque led to."""


class WrappableController(Controller[StateT], Protocol[StateT]):
    """What guards need of the controller inside: the law, the baselines and the guards themselves have it."""

    @property
    def impedance(self) -> TargetImpedance:
        """Target impedance."""

    @property
    def limits(self) -> Limits | None:
        """Limits of the torque that it gives, None where it keeps none."""

    def elapsed(self, state: StateT, period: float) -> StateT:
        """Return the state at a tick that comes a measured time after the one before, instead of dt after it."""

    def handover(self, state: StateT, now: Situation) -> StateT:
        """Return the state with which the controller takes the arm over as it is now, without a jump."""


class Measured(NamedTuple):
    """What a controller is given at a tick.

    Attributes:
        q: Measured configuration, shape (nq,).
        v: Measured velocity, shape (nv,) [rad/s or m/s].
        reference: Desired motion.
        tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].
    """

    q: ArrayLike
    v: ArrayLike
    reference: Reference
    tau_ext: ArrayLike


class TickBase(ABC, Generic[StateT, GivenT, AnswerT]):
    """What controllers of joints and of the tool share: a tick, and a tick that comes late."""

    @abstractmethod
    def init(self) -> StateT:
        """Return the state before the first tick."""

    @abstractmethod
    def _step(self, state: StateT, given: GivenT) -> tuple[AnswerT, StateT]:
        """A tick whose measured period is in the state already."""

    @abstractmethod
    def _elapsed(self, state: StateT, period: float) -> StateT:
        """`elapsed`; it checks the period, or leaves that to the controller inside."""

    def elapsed(self, state: StateT, period: float) -> StateT:
        """Return the state at a tick that comes a measured time after the one before, instead of dt after it.

        The impedance filter repeats its step over the measured time, exact for constant tau_ext; integrals grow in
        proportion. The law's own period stays dt, since the torque of this tick is expected to be held for dt.

        Args:
            state: From the tick before.
            period: Time since then, more than 0 and at most `LONGEST_PERIOD`·dt [s].

        Raises:
            InputError: Not such a number.
        """
        return self._elapsed(state, period)


class ControllerBase(TickBase[StateT, Measured, OutputT]):
    """What every controller of the library offers, described once; children give `init`, `_step` and `_elapsed`.

    One that has a form of its tick besides `_step` (see `backends`) gives its function, and what that takes first.
    """

    _compute: Callable[..., Any] | None = None
    _own: Any = None

    def step(
        self,
        state: StateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> tuple[OutputT, StateT]:
        """Compute the torque of one tick.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick.
            tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].
            period: Measured time since the tick before, see `elapsed`; dt if it is not given [s].

        Returns:
            The output, and the state for the next tick.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            InputError: A period that is not positive, or longer than `LONGEST_PERIOD` control periods.
        """
        if period is not None:
            state = self.elapsed(state, period)
        answer: tuple[OutputT, StateT] | None = None
        if self._compute is not None:
            with contextlib.suppress(TypeError, ValueError):  # not plain vectors
                answer = self._compute(self._own, state, q, v, reference, tau_ext)
        if answer is None:
            return self._step(state, Measured(q, v, reference, tau_ext))
        return answer

    def warm_up(self: Controller[StateT]) -> None:
        """Take one tick and forget it, so that the first one of a run is no slower than the rest.

        Wrappers warm up what is inside them: call it on the outermost controller, before the loop. What has to be
        compiled, or loaded from the disk, is compiled here or when the controller is made.
        """
        zero, q = np.zeros(self.arm.nv), self.arm.ready
        self.step(self.init(), q, zero, Reference(q, zero, zero), zero)


class SensorlessBase(ControllerBase[StateT, OutputT]):
    """What controllers offer that need no force sensor."""

    def step(
        self,
        state: StateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike | None = None,
        period: float | None = None,
    ) -> tuple[OutputT, StateT]:
        """Compute the torque of one tick; see `ControllerBase.step`.

        tau_ext is not used; it is there for whoever runs controllers of all kinds.
        """
        del tau_ext
        return super().step(state, q, v, reference, 0.0, period)


def checked_period(period: float, dt: float) -> float:
    """Return a measured period as a number that is possible.

    Raises:
        InputError: Not more than 0 and at most `LONGEST_PERIOD` control periods.
    """
    words = (
        f"a time in (0, {LONGEST_PERIOD:g}·dt = {LONGEST_PERIOD * dt:g} s]; "
        "after a longer pause restart the controller, as `SoftStart` does"
    )
    try:
        period = float(period)
    except (TypeError, ValueError):
        raise InputError(f"period is {period!r}; it has to be {words}") from None
    if not 0.0 < period <= LONGEST_PERIOD * dt:
        raise InputError(f"period is {period:g} s; it has to be {words}")
    return period
