"""What a controller is, for all that runs, wraps or compares controllers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeAlias, TypeVar

from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..exceptions import InputError
from ..law.impedance import TargetImpedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .telemetry import ControllerOutput, ControllerState, Situation

Backend = Literal["pinocchio", "compiled"]
"""Whose algorithms compute the dynamics: Pinocchio's, or the same as compiled code."""

StateT = TypeVar("StateT")


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

    def step(
        self,
        state: StateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> tuple[ControllerOutput, StateT]:
        """Return the output of one tick and the next state; period is the measured time since the tick before."""

    def elapsed(self, state: StateT, period: float) -> StateT:
        """Return the state at a tick that comes a measured time after the one before, instead of dt after it."""

    def handover(self, state: StateT, now: Situation) -> StateT:
        """Return the state with which the controller takes the arm over as it is now, without a jump."""


Step: TypeAlias = Callable[[Any, Any, Any, Any, Reference, Any], Any]
"""A tick: what it carries along, state, q, v, reference, tau_ext -> output and next state, None where an input is not
sound. `TypeError` where one is not a plain vector of float64, or the state of a tick."""


class Tick(Protocol):
    """A compiled tick.

    Attributes:
        step: The tick, and what it carries along.
    """

    step: tuple[Step, Any]

    def init(self) -> ControllerState:
        """Return the state before the first tick."""

    def pack(self, state: ControllerState) -> ControllerState:
        """Return a state in the form that `step` takes."""

    def block(self, state: ControllerState) -> Array:
        """Return a state in the form that a `ticker` takes, and writes to."""

    def state(self, block: Array) -> ControllerState:
        """Return the state that is in such a block."""

    def ticker(self, tau: Array) -> tuple[Step, Any]:
        """Return the tick that writes to tau, and the next state over the one before, and answers True."""


def checked_period(period: float, dt: float) -> float:
    """Return a measured period as a number that is possible.

    Raises:
        InputError: Not more than 0 and at most `LONGEST_PERIOD` control periods.
    """
    words = (
        f"a time in (0, {LONGEST_PERIOD:g}·dt = {LONGEST_PERIOD * dt:g} s]; "
        "after a longer pause take the arm over anew, as `SoftStart` does"
    )
    try:
        period = float(period)
    except (TypeError, ValueError):
        raise InputError(f"period is {period!r}; it has to be {words}") from None
    if not 0.0 < period <= LONGEST_PERIOD * dt:
        raise InputError(f"period is {period:g} s; it has to be {words}")
    return period
