"""What a controller is, for all that runs, wraps or compares controllers."""

from __future__ import annotations

from typing import Literal, Protocol, TypeVar

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
