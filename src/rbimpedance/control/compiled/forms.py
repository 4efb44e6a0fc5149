"""The compiled forms of the tick: around Pinocchio's algorithms, and with compiled ones."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from ..._common.arrays import Array, vector
from ..._numba.layouts.tables import hold
from ...robot.arm_model import ArmModel
from ...robot.compiled.dynamics import CompiledDynamics
from ...robot.compiled.tables import coordinate_tables, workspace
from ...robot.mimic_dynamics import pinocchio_dynamics
from ..telemetry import ControllerState
from ..tick import ControlLaw, Step
from .block import A_R, COLUMNS, NEXT_Q_E, NEXT_V_E, PackedState
from .law import EFFORT, FILTER, FULL, GIVEN, KNOWLEDGE, TORQUE_STEP
from .pack import pack_law, scratch
from .tick import LawWords, TickWords, after_kernel, before_kernel, limit_kernel, whole_kernel


class PinocchioWorkspace:
    """What one tick around Pinocchio's RNEA at a time works with besides its arguments.

    Attributes:
        rnea: Pinocchio's RNEA, on data of its own.
        mass_matrix: Its CRBA.
        scratch: What the kernels write to.
        held: The same as they take it.

    Args:
        arm: The arm.
    """

    __slots__ = ("held", "mass_matrix", "rnea", "scratch")

    def __init__(self, arm: ArmModel) -> None:
        dynamics = pinocchio_dynamics(arm.raw_dynamics.model)
        self.rnea, self.mass_matrix = dynamics.rnea, dynamics.mass_matrix
        self.scratch = scratch(arm.nv)
        self.held = hold(self.scratch)


_WORKSPACES: weakref.WeakKeyDictionary[ArmModel, list[PinocchioWorkspace]] = (
    weakref.WeakKeyDictionary()
)


class CompiledForm:
    """What the two forms have in common. Threads may share one.

    Attributes:
        step: The tick, and what it takes as its first argument.

    Args:
        law: The controller's law; its filter is called where there is no table for it.
    """

    def __init__(self, law: ControlLaw) -> None:
        self.arm, self.filter, self.law = law.arm, law.filter, pack_law(law)
        self._control_law = law
        self.step = self.in_place(np.empty(0))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._control_law,)

    def init(self) -> ControllerState:
        """Return the state before the first tick."""
        return self.state(np.zeros((self.arm.nv, COLUMNS)))

    def pack(self, state: ControllerState) -> ControllerState:
        """Return a state in the form that `step` takes."""
        given: Any = state
        packed = given if type(given) is PackedState else PackedState.pack(state)
        return cast("ControllerState", packed)

    def memory(self, state: ControllerState) -> Array:
        """Return a state in the form that the tick of `in_place` takes, and writes to."""
        packed: Any = self.pack(state)
        return np.array(packed.rows)

    def state(self, memory: Array) -> ControllerState:
        """Return the state that is in such a memory."""
        return cast("ControllerState", PackedState(memory))

    def in_place(self, tau: Array) -> tuple[Step, Any]:
        """Return the tick that writes its torque to tau and the next state over the block of the one before.

        Args:
            tau: Where the torque goes, shape (nv,). If it is empty, output and state are new objects.

        Returns:
            The tick, and what it takes as its first argument: a kernel has no place of its own to keep things.
        """
        raise NotImplementedError

    def is_filter_given(self) -> bool:
        """Whether the law has no table for the filter."""
        return bool(self.law.choices[0, FILTER] == GIVEN)

    def put_filtered(self, state: Any, tau_ext: Array, block: Array) -> None:
        """Write the share of a filter that has no table.

        Raises:
            TypeError: The state is of another form.
        """
        before = state if type(state) is np.ndarray else getattr(state, "rows", None)
        if before is None:
            raise TypeError("not the state of a compiled tick")
        q_e, v_e = before[:, NEXT_Q_E], before[:, NEXT_V_E]
        torque = vector("tau_ext", tau_ext, self.arm.nv)
        block[:, A_R] = self.filter.acceleration(q_e, v_e, torque)
        block[:, NEXT_Q_E], block[:, NEXT_V_E] = self.filter.advance(q_e, v_e, torque)


class PinocchioTick(CompiledForm):
    """A tick whose elementwise part is one kernel before Pinocchio's RNEA and one after it; see `CompiledForm`."""

    def in_place(self, tau: Array) -> tuple[Step, Any]:
        """See `CompiledForm.in_place`."""
        arm, workspaces = self.arm, _WORKSPACES.setdefault(self.arm, [])
        fixed = hold(LawWords(coordinate_tables(arm), self.law))
        before, after, limit = before_kernel(), after_kernel(), self._limit_kernel()
        knows_all = self.law.choices[0, KNOWLEDGE] == FULL
        put_filtered = self.put_filtered if self.is_filter_given() else None

        def tick(tau: Array, state: Any, q: Array, v: Array, reference: Any, tau_ext: Array) -> Any:
            try:  # in the end there is one for each thread that needed one at once
                workspace = workspaces.pop()
            except IndexError:
                workspace = PinocchioWorkspace(arm)
            held, work = workspace.held, workspace.scratch
            try:
                if put_filtered is not None:
                    put_filtered(state, tau_ext, work.block)
                if before(fixed, held, state, q, v, reference, tau_ext):
                    return None
                a = work.command
                torque = workspace.rnea(q, v, a) if knows_all else workspace.mass_matrix(q) @ a
                answer = after(fixed, held, tau, state, torque, v, tau_ext)
                if answer is None:  # beyond a limit
                    work.mass[:] = workspace.mass_matrix(q)
                    answer = limit(fixed, held, tau, state)
                return answer
            finally:
                workspaces.append(workspace)

        return tick, tau

    def _limit_kernel(self) -> Callable[..., Any]:
        is_limited = np.isfinite(self.law.gains[:, [EFFORT, TORQUE_STEP]]).any()
        return limit_kernel() if is_limited else after_kernel()


class CompiledTick(CompiledForm):
    """A tick that is one kernel, RNEA included; see `CompiledForm`.

    Raises:
        UnsupportedJointError: A joint that the tables do not support.
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """

    def in_place(self, tau: Array) -> tuple[Step, Any]:
        """See `CompiledForm.in_place`."""
        nv, tables = self.arm.nv, CompiledDynamics(self.arm).tables
        whole, free = whole_kernel(), list[Any]()

        def own() -> Any:
            return hold(TickWords(tables, self.law, workspace(nv), scratch(nv), tau))

        def tick(_: Any, state: Any, q: Array, v: Array, reference: Any, tau_ext: Array) -> Any:
            try:
                held = free.pop()
            except IndexError:
                held = own()
            try:
                self.put_filtered(state, tau_ext, held.tables.scratch.block)
                return whole(held, state, q, v, reference, tau_ext)
            finally:
                free.append(held)

        return (tick, None) if self.is_filter_given() else (whole, own())
