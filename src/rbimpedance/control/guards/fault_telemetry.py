"""What a `FaultGuard` hands out at every tick: the output with its reason, the state, and news of changes."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from ..._common.arrays import Array
from ...robot.arm_model import ArmModel
from ...trajectories import Reference
from ..telemetry import ControllerOutput, flags
from .belief import Belief
from .effect_monitor import EffectState
from .faults import Fault
from .input_monitor import MonitorState
from .soft_start import SoftStartState

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
        brakes_requested: The guard has been blind for too long and its torque decays to zero: only brakes hold the arm.
            Or torque has no effect and the position is bitwise constant: brakes hold the arm, or a sensor is frozen.
    """

    response: Response = "run"
    fault: Fault | None = None
    brakes_requested: bool = False

    @classmethod
    def of(
        cls,
        output: ControllerOutput,
        response: Response = "run",
        fault: Fault | None = None,
        brakes_requested: bool = False,
    ) -> GuardedOutput:
        """Return an output with what is to be said about it."""
        guarded = cls(*output)
        guarded.response, guarded.fault = response, fault
        guarded.brakes_requested = brakes_requested
        return guarded

    def _replace(self, **changes: Any) -> GuardedOutput:
        """Return the output with other fields; what is said about it stays."""
        changed = ControllerOutput(*self)._replace(**changes)
        return self.of(changed, self.response, self.fault, self.brakes_requested)


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
        reference: The last sound desired motion, as (q, v, a).
        q_e: Position of the impedance filter at the last tick of the controller, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
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
    reference: Reference
    q_e: Array
    v_e: Array
    response: Response
    fault: Fault | None
    since: float
    sound: int
    period: float | None


def without_controller(arm: ArmModel, state: FaultGuardState, tau: Array) -> ControllerOutput:
    """Return what there is to say of a tick without the controller, whose torque is at no limit.

    Args:
        arm: The arm.
        state: The state at this tick.
        tau: Torque of the tick, shape (nv,) [N·m or N].
    """
    q_d, v_d, a_d = state.reference
    q_r = arm.raw_dynamics.integrate(q_d, state.q_e)
    v_r = v_d + state.v_e
    e1 = arm.raw_dynamics.difference(state.known.q, q_r)
    zero = np.zeros_like(tau)
    return ControllerOutput(
        tau.copy(),
        *(q_r, v_r, a_d.copy(), e1, v_r - state.known.v),
        s=zero,
        u=zero.copy(),
        q_e=state.q_e.copy(),
        v_e=state.v_e.copy(),
        premise_holds=np.zeros(arm.nv, dtype=np.bool_),
        **flags(arm.nv),
    )
