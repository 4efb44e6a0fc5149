"""Any controller on estimated position and speed in place of counted ones and their differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..robot.hardware import Hardware
from .errors import check_measurements
from .estimation import ExtendedStateObserver
from .estimation.extended_state import JointEstimate
from .protocol import Controller, Measured
from .telemetry import ControllerOutput, Situation
from .wrapper import ControllerWrapper, of_joints


class ObservedState(NamedTuple):
    """Memory of observer and controller.

    Attributes:
        ticks: Number of ticks so far.
        observer: What is expected at the tick to come.
        inner: State of the controller.
    """

    ticks: int
    observer: JointEstimate
    inner: Any


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class ObservedController(ControllerWrapper[ObservedState, ControllerOutput]):
    """A controller that is given what an `ExtendedStateObserver` expects when its torque will begin to act.

    Position and speed come from the observer, `delay` ticks ahead, and the reference as far ahead. It replaces the
    differences of encoders for every controller; the observer's disturbance is not used, since the controllers of this
    library have integrals of their own. `HardwareController` uses it, raises the bandwidth only where that is needed,
    and learns friction.

    Attributes:
        controller: The controller inside.
        observer: What estimates position and speed.

    Args:
        controller: The controller inside.
        hardware: What is between tick and links: its lag and its delay are inside the observer.
        bandwidth: Of the observer, scalar or (nv,), positive [rad/s].

    Raises:
        ParameterError: A bandwidth that is not positive.
        DimensionError: One that is given for another number of joints.
    """

    observer: ExtendedStateObserver

    def __init__(
        self, controller: Controller[Any], hardware: Hardware, bandwidth: ArrayLike
    ) -> None:
        arm = controller.arm
        lag, delay = hardware.lag(arm), hardware.delay
        observer = ExtendedStateObserver(arm, bandwidth, controller.dt, lag=lag, delay=delay)
        set_fields(self, controller=of_joints(controller), observer=observer)

    def init(self) -> ObservedState:
        """Return the state before the first tick."""
        return ObservedState(0, self.observer.init(self.arm.neutral), self.controller.init())

    def handover(self, state: ObservedState, now: Situation) -> ObservedState:
        """Return the state with which the arm is taken over as it is now; see `ImpedanceController.handover`.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        inner = self.controller.handover(state.inner, now)
        observer = self.observer.init(now.q, now.v, now.tau)
        return ObservedState(max(state.ticks, 1), observer, inner)

    def _step(
        self, state: ObservedState, given: Measured
    ) -> tuple[ControllerOutput, ObservedState]:
        q, _, reference, tau_ext = check_measurements(self.arm, given)
        observer = self.observer
        expected = state.observer if state.ticks else observer.init(q)
        estimate = observer.correct(expected, observer.innovation(expected, q))
        seen = observer.ahead(estimate, tau_ext)
        output, inner = self.controller.step(
            state.inner, *seen, observer.reference_ahead(reference), tau_ext
        )
        output = output._replace(q_r=self.arm.raw_dynamics.integrate(reference.q, output.q_e))
        following = observer.predict(estimate, output.tau, tau_ext)
        return output, ObservedState(state.ticks + 1, following, inner)
