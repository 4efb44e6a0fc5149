"""What a `FaultGuard` hands out at every tick: the output with its reason, the state, and news of changes."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias

from ..._common.arrays import Array
from ...interaction.estimators import MomentumState
from ...trajectories import Reference
from ..telemetry import ControllerOutput
from .faults import Fault
from .input_monitor import MonitorState

Policy: TypeAlias = Literal["raise", "hold", "stop"]
"""What to do at a fault: raise an error, hold the last safe torque for a while, or stop at once."""

Response: TypeAlias = Literal["run", "hold", "stop"]
"""What a tick did: the controller's torque, the last safe torque with damping, or damping to rest."""


class GuardedOutput(ControllerOutput):
    """A `ControllerOutput` that says whether it is the controller's own, and why not.

    While a policy is active, tau is the policy's, q_r is where the reference was last, e1 and e2 are its errors as
    far as the state is known, s and u are zero, and nothing is guaranteed.

    Attributes:
        response: What the tick did.
        fault: Why; None while all is well. While a fault is over but not for long enough, the last one.
    """

    response: Response = "run"
    fault: Fault | None = None

    @classmethod
    def of(
        cls, output: ControllerOutput, response: Response = "run", fault: Fault | None = None
    ) -> GuardedOutput:
        """Return an output with what is to be said about it."""
        guarded = cls(*output)
        guarded.response, guarded.fault = response, fault
        return guarded


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
        inner: State of the controller that is guarded.
        monitor: State of the monitor of the inputs.
        observer: State of the observer of what acts beside the motors.
        q: Configuration, measured or as the model says it went on, shape (nq,).
        v: Its velocity, shape (nv,) [rad/s or m/s].
        tau: Torque that left in the tick before, shape (nv,) [N·m or N].
        safe: The last torque of the controller, shape (nv,) [N·m or N].
        tau_ext: Torque of the environment, zero where it is not known, shape (nv,) [N·m or N].
        reference: The last sound desired motion, as (q, v, a).
        q_e: Position of the impedance filter at the last tick of the controller, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        response: What the tick before did.
        fault: Why.
        since: How long the response has been active [s].
        sound: Number of ticks in a row without a fault.
    """

    inner: Any
    monitor: MonitorState
    observer: MomentumState
    q: Array
    v: Array
    tau: Array
    safe: Array
    tau_ext: Array
    reference: Reference
    q_e: Array
    v_e: Array
    response: Response
    fault: Fault | None
    since: float
    sound: int
