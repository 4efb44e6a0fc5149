"""What a controller is, for all that runs, wraps or compares controllers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeAlias, TypeVar

from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .telemetry import ControllerOutput, ControllerState

Backend = Literal["pinocchio", "compiled"]
"""Whose algorithms compute the dynamics: Pinocchio's, or the same as compiled code."""

StateT = TypeVar("StateT")


class Controller(Protocol[StateT]):
    """What `simulate` needs of a controller; the baselines share it."""

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


class PeriodicController(Controller[StateT], Protocol[StateT]):
    """A controller whose tick takes the measured time since the tick before."""

    def step(
        self,
        state: StateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> tuple[ControllerOutput, StateT]:
        """Return the output of one tick and the next state."""


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
