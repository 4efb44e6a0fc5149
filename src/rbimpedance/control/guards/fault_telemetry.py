"""What a `FaultGuard` hands out at every tick: the output with its reason, the state, and news of changes."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar

from ..._common.arrays import Array
from ..telemetry import ControllerOutput
from ..tool_view import ToolTick
from .belief import Belief
from .effect_monitor import EffectState
from .faults import Fault
from .input_monitor import MonitorState
from .soft_start import SoftStartState

Policy: TypeAlias = Literal["raise", "hold", "stop"]
"""What to do at a fault: raise an error, hold the last safe torque for a while, or stop at once."""

Response: TypeAlias = Literal["run", "hold", "stop"]
"""What a tick did: the controller's torque, the last safe torque with damping, or damping to rest."""


_GuardedT = TypeVar("_GuardedT", bound="Guarded")


class Guarded:
    """What an output says besides: whether it is the controller's own, and why not.

    Attributes:
        response: What the tick did.
        fault: Why; None while all is well. While a fault is over but not for long enough, the last one.
        brakes_requested: The guard has been blind for too long and its torque decays to zero: only brakes hold the arm.
            Or torque has no effect and the position is bitwise constant: brakes hold the arm, or a sensor is frozen.
    """

    response: Response = "run"
    fault: Fault | None = None
    brakes_requested: bool = False

    @classmethod
    def of(
        cls: type[_GuardedT],
        output: Any,
        response: Response = "run",
        fault: Fault | None = None,
        brakes_requested: bool = False,
    ) -> _GuardedT:
        """Return an output with what is to be said about it."""
        guarded = cls(*output)
        guarded.response, guarded.fault = response, fault
        guarded.brakes_requested = brakes_requested
        return guarded

    def _replace(self: _GuardedT, **changes: Any) -> _GuardedT:
        """Return the output with other fields; what is said about it stays."""
        changed = super()._replace(**changes)  # type: ignore[misc]
        return self.of(changed, self.response, self.fault, self.brakes_requested)


class GuardedOutput(Guarded, ControllerOutput):
    """A `ControllerOutput` that says whether it is the controller's own, and why not; see `Guarded`.

    While a policy is active, tau is the policy's, q_r is where the reference was last, e1 and e2 are its errors as
    far as the state is known, s and u are zero, and nothing is guaranteed.
    """


class GuardedToolTick(Guarded, ToolTick):
    """The same of a controller at the tool: `at_tool` holds its `CartesianOutput`; see `Guarded`."""


def guarded(
    output: Any,
    response: Response = "run",
    fault: Fault | None = None,
    brakes_requested: bool = False,
) -> Any:
    """Return an output of the joints, or of a controller at the tool, with what is to be said about it."""
    kind = GuardedToolTick if isinstance(output, ToolTick) else GuardedOutput
    return kind.of(output, response, fault, brakes_requested)


class FaultEvent(NamedTuple):
    """A change in what a guard does.

    Attributes:
        tick: The tick, counted from 0.
        response: What the guard does from this tick on.
        fault: Why; None where the controller is back.
    """

    tick: int
    response: Response
    fault: Fault | None


class FaultGuardState(NamedTuple):
    """What a `FaultGuard` remembers.

    Attributes:
        inner: State of the soft start around the controller that is guarded.
        monitor: State of the monitor of the inputs.
        effect: State of the monitor of the torque's effect.
        known: What is believed of the arm.
        tau: Torque that left in the tick before, shape (nv,) [N·m or N].
        safe: The last torque of the controller, shape (nv,) [N·m or N].
        tau_ext: Torque of the environment, zero where it is not known, shape (nv,) [N·m or N].
        reference: The last sound desired motion: a `Reference`, or a `CartesianReference`.
        offset: How far the impedance had moved it at the last tick of the controller, and how fast, shape (2, nv); at
            the tool (2, 6).
        response: What the tick before did.
        fault: Why.
        since: How long the response has been active [s].
        sound: Number of ticks in a row without a fault.
        period: Measured time of the coming tick after the one before [s]; None where it was not measured, -1 where what
            was measured cannot be.
    """

    inner: SoftStartState
    monitor: MonitorState
    effect: EffectState
    known: Belief
    tau: Array
    safe: Array
    tau_ext: Array
    reference: Any
    offset: Array
    response: Response
    fault: Fault | None
    since: float
    sound: int
    period: float | None
