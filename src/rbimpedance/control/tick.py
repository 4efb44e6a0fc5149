"""One control tick: filter, errors, surface, reaching law, torque, limits.

`numpy_tick` is the specification. The compiled forms of the tick compute the same and are compared with it;
docs/how-a-tick-runs.md follows all of them file by file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..law.bounded_surface import clipped, surface_terms
from ..law.impedance import TargetFilter
from ..law.limits import Allocation, Limits
from ..law.super_twisting import FormulaReaching, ReachingState
from ..law.surfaces import Surface, demanded_acceleration
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge, model_torque
from ..trajectories import Reference
from .errors import track
from .protocol import Measured
from .telemetry import ControllerOutput, ControllerState, flags


class ControlLaw(NamedTuple):
    """All that a tick depends on besides its arguments.

    Attributes:
        arm: The controller's model of the arm.
        filter: Filter of the target impedance.
        surface: Sliding surface.
        reaching: Reaching law.
        dt: Control period [s].
        model: "full" or "inertia".
        limits: Limits of the torque, or None.
    """

    arm: ArmModel
    filter: TargetFilter
    surface: Surface
    reaching: FormulaReaching
    dt: float
    model: Knowledge
    limits: Limits | None


def numpy_tick(
    law: ControlLaw,
    state: ControllerState,
    q: ArrayLike,
    v: ArrayLike,
    reference: Reference,
    tau_ext: ArrayLike,
) -> tuple[ControllerOutput, ControllerState]:
    """Return output and next state of one tick; see `ImpedanceController.step`."""
    arm, target, surface, reaching, dt, model, _ = law
    q_e, v_e = state.q_e, state.v_e
    given = Measured(q, v, reference, tau_ext)
    q, v, tau_ext, _, q_r, v_r, a_r, e1, e2 = track(arm, target, q_e, v_e, given)  # eqs. (3), (4)

    s, feedforward, gain = surface_terms(surface, e1, e2, dt)  # eqs. (6), (7)
    before = _reaching_state(reaching, state, s)
    u, after = reaching.step(s, before, dt)
    a = demanded_acceleration(a_r, feedforward, u, gain)  # eq. (8)
    tau = model_torque(arm, model, q, v, a) - tau_ext  # eq. (8)
    allocation = _within_limits(law, state, q, tau)
    unrealised_u = gain * allocation.acceleration_deficit
    after = reaching.anti_windup(before, after, unrealised_u, dt)

    output = ControllerOutput(
        allocation.tau,
        *(q_r, v_r, a_r, e1, e2, s),
        u=u - unrealised_u,
        q_e=q_e.copy(),
        v_e=v_e.copy(),
        premise_holds=unrealised_u == 0.0,
        **flags(
            arm.nv,
            saturated=allocation.saturated,
            rate_limited=allocation.rate_limited,
            clipped=clipped(surface, e1),
        ),
    )
    following = target.advance(q_e, v_e, tau_ext)
    last = output.tau.copy(), np.array(tau_ext), q_e, v_e, before.z
    return output, ControllerState(state.ticks + 1, *following, *after, *last)


def _reaching_state(reaching: FormulaReaching, state: ControllerState, s: Array) -> ReachingState:
    return reaching.start(s) if state.ticks == 0 else ReachingState(state.z, state.x, state.a)


def _within_limits(law: ControlLaw, state: ControllerState, q: Array, tau: Array) -> Allocation:
    if law.limits is None:
        none = np.zeros(tau.shape, dtype=np.bool_)
        return Allocation(tau, none, none.copy(), np.zeros_like(tau))
    before = state.tau if state.ticks else None
    mass_matrix = lambda: law.arm.raw_dynamics.mass_matrix(q)  # noqa: E731
    return law.limits.allocate(tau, mass_matrix, before=before, dt=law.dt)


Step: TypeAlias = Callable[[Any, Any, Any, Any, Reference, Any], Any]
"""A tick as a function: its own first argument, state, q, v, reference, tau_ext -> output and next state.

It may answer None for inputs that are not sound, and raise `TypeError` for what is not a plain vector of float64."""


class TickForm(Protocol):
    """How a backend computes a tick.

    Attributes:
        step: The tick, and its first argument.
    """

    step: tuple[Step, Any]

    def init(self) -> ControllerState:
        """Return the state before the first tick."""

    def pack(self, state: ControllerState) -> ControllerState:
        """Return a state in the form that `step` takes."""

    def memory(self, state: ControllerState) -> Any:
        """Return a state in the form that the tick of `in_place` takes, and writes to."""

    def state(self, memory: Any) -> ControllerState:
        """Return the state that is in such a memory."""

    def in_place(self, tau: Array) -> tuple[Step, Any]:
        """Return the tick that writes to tau, and the next state over the one before, and answers True."""


class NumpyTick:
    """The tick that specifies the others, in NumPy, for every surface and every reaching law.

    Attributes:
        step: `numpy_tick`, and the law.
    """

    def __init__(self, law: ControlLaw) -> None:
        self.step: tuple[Step, Any] = numpy_tick, law

    def init(self) -> ControllerState:
        """Return the state before the first tick."""
        zero = np.zeros(self.step[1].arm.nv)
        zero.setflags(write=False)
        return ControllerState(0, *[zero] * (len(ControllerState._fields) - 1))

    def pack(self, state: ControllerState) -> ControllerState:
        """Return the state."""
        return state

    def memory(self, state: ControllerState) -> list[ControllerState]:
        """Return a place for the state."""
        return [state]

    def state(self, memory: list[ControllerState]) -> ControllerState:
        """Return the state in its place."""
        return memory[0]

    def in_place(self, tau: Array) -> tuple[Step, Any]:
        """Return the tick that writes to tau, and the next state to its place, and answers True."""

        def tick(law: Any, memory: Any, *measured: Any) -> bool:
            output, memory[0] = numpy_tick(law, memory[0], *measured)
            tau[:] = output.tau
            return True

        return tick, self.step[1]
