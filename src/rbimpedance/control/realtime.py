"""The tick of a loop that wants the torque and nothing else, in memory that is made once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..trajectories import Reference
from .protocol import WrappableController
from .telemetry import ControllerState, Situation
from .tick import TickForm


@brief_repr("controller")
class RealtimeController:
    """An `ImpedanceController` that keeps its own state and writes its torque into one array.

    Torques and states are those of `ImpedanceController.step`, to the last bit; a tick makes no objects and hands out
    no telemetry. Inputs are checked as there; after an error, torque and state are what they were. Each loop needs one
    of its own: `controller.realtime()`.

    Attributes:
        controller: The controller.
        tau: Torque of the latest tick, shape (nv,) [N·m or N], always the same array; zero before the first.

    Args:
        controller: The controller.
        form: How it computes a tick.
        state: State to begin with; `controller.init()` by default.
    """

    __slots__ = ("_form", "_memory", "_own", "_tick", "controller", "tau")

    def __init__(
        self,
        controller: WrappableController[ControllerState],
        form: TickForm,
        state: ControllerState | None = None,
    ) -> None:
        self.controller, self.tau = controller, np.zeros(controller.arm.nv)
        self._form = form
        self._tick, self._own = form.in_place(self.tau)
        self.reset(state)

    @property
    def state(self) -> ControllerState:
        """State for the next tick."""
        return self._form.state(self._memory)

    def reset(self, state: ControllerState | None = None) -> None:
        """Continue from another state.

        Args:
            state: The state; `controller.init()` by default.
        """
        state = self.controller.init() if state is None else state
        self._memory = self._form.memory(state)

    def handover(self, now: Situation) -> None:
        """Take the arm over as it is now; see `ImpedanceController.handover`.

        Args:
            now: The arm at the tick to come.
        """
        self.reset(self.controller.handover(self.state, now))

    def torque(
        self,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> Array:
        """Return `tau` after one more tick.

        Plain float64 vectors in a `Reference` are the fast way; everything else that `ImpedanceController.step` takes
        is converted first, and so is a tick with a measured period.

        Args:
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick.
            tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].
            period: Measured time since the tick before; dt if it is not given [s].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            InputError: A period that `ImpedanceController.elapsed` refuses.
        """
        try:
            if period is None and self._tick(self._own, self._memory, q, v, reference, tau_ext):
                return self.tau
        except (TypeError, ValueError):  # not plain vectors
            pass
        state = self.state if period is None else self.controller.elapsed(self.state, period)
        output, state = self.controller.step(state, q, v, reference, tau_ext)
        self.tau[:] = output.tau
        self.reset(state)
        return self.tau
