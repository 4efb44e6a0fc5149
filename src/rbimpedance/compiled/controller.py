"""The tick of an `ImpedanceController` by compiled code, in the two ways that its `backend` chooses between."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numba import types

from .._arrays import Array, vector
from ..dynamics import ArmModel
from ..impedance import TargetFilter
from ..telemetry import ControllerState
from ..trajectories import Reference
from . import rigid_body
from ._jit import kernel
from .dynamics import ARM, OWN_INTEGERS, OWN_MATRIX, OWN_VECTOR, SPACE, VECTOR_IN, CompiledDynamics
from .law import FILTER, FULL, GIVEN, KNOWLEDGE, Law, Measured, Scratch
from .limits import within_limits
from .output import COLUMNS, PackedOutput, PackedState
from .pack import scratch
from .selection import Answer, Step
from .tables import ArmTables, Workspace, coordinate_tables
from .tick import (
    DONE,
    EXCEEDED,
    REFUSED,
    after_torque,
    before_torque,
    is_sound,
    model_torque,
)


class Tick:
    """What the two ways have in common. Each instance owns its work space; two threads must not share one.

    Attributes:
        step: The tick, one closure without a lookup in it: it is shorter than what Python spends on attributes.

    Args:
        arm: The controller's arm.
        law: Its law.
        impedance_filter: Its filter; called where the law has no table for it.
    """

    step: Step

    def __init__(self, arm: ArmModel, law: Law, impedance_filter: TargetFilter) -> None:
        self._arguments = arm, law, impedance_filter
        self.arm, self.law, self.filter = arm, law, impedance_filter
        self.scratch = scratch(arm.nv)
        self.shape = (arm.nv, COLUMNS)
        self.kernels = kernels()
        is_given = law.choices[0, FILTER] == GIVEN
        self.step = self._with_given_filter(self._step()) if is_given else self._step()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments

    def init(self) -> ControllerState:
        """Return the state before the first tick."""
        return cast("ControllerState", PackedState.of(np.zeros(self.shape)))

    def pack(self, state: ControllerState) -> PackedState:
        """Return a state of separate arrays in a block."""
        return PackedState.pack(state)

    def _step(self) -> Step:
        raise NotImplementedError

    def _with_given_filter(self, step: Step) -> Step:
        table, given = self.law.filter, self.filter

        def filtered(
            state: ControllerState, q: Array, v: Array, reference: Reference, tau_ext: Array
        ) -> Answer:
            torque = vector("tau_ext", tau_ext, self.arm.nv)
            table[0] = given.acceleration(state.q_e, state.v_e, torque)
            table[1:] = given.advance(state.q_e, state.v_e, torque)
            return step(state, q, v, reference, tau_ext)

        return filtered


class FusedTick(Tick):
    """A tick whose elementwise part is one kernel before Pinocchio's RNEA and one after it; see `Tick`."""

    def _step(self) -> Step:
        law, work, shape, pack = self.law, self.scratch, self.shape, self.pack
        tables = coordinate_tables(self.arm)
        before, after, limit, _ = self.kernels
        torque_for, mass_matrix = self._model(), self.arm.unchecked.mass_matrix
        command, empty = work.command, np.empty

        def step(state: Any, q: Array, v: Array, reference: Reference, tau_ext: Array) -> Any:
            if type(state) is not PackedState:
                state = pack(state)
            q_d, v_d, a_d = reference
            block = empty(shape)
            if before(tables, law, work, state.block, (q, v, q_d, v_d, a_d, tau_ext), block):
                return None
            if after(tables, law, torque_for(q, v, command), v, tau_ext, block):
                work.mass[:] = mass_matrix(q)
                limit(law, work, state.block, block)
            output, following = PackedOutput(), PackedState()
            output.block = following.block = block
            return output, following

        return step

    def _model(self) -> Callable[[Array, Array, Array], Array]:
        if self.law.choices[0, KNOWLEDGE] == FULL:
            rnea: Callable[[Array, Array, Array], Array] = self.arm.unchecked.rnea
            return rnea
        mass_matrix = self.arm.unchecked.mass_matrix

        def inertial(q: Array, v: Array, a: Array) -> Array:
            del v
            torque: Array = mass_matrix(q) @ a
            return torque

        return inertial


class CompiledTick(Tick):
    """A tick that is one kernel, RNEA included; see `Tick`.

    Raises:
        UnsupportedJointError: A joint that the tables cannot carry.
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """

    def _step(self) -> Step:
        law, work, shape, pack = self.law, self.scratch, self.shape, self.pack
        dynamics = CompiledDynamics(self.arm)
        tables, space = dynamics.tables, dynamics.space
        whole, empty = self.kernels.whole, np.empty

        def step(state: Any, q: Array, v: Array, reference: Reference, tau_ext: Array) -> Any:
            if type(state) is not PackedState:
                state = pack(state)
            q_d, v_d, a_d = reference
            block = empty(shape)
            if whole(tables, space, law, work, state.block, (q, v, q_d, v_d, a_d, tau_ext), block):
                return None
            output, following = PackedOutput(), PackedState()
            output.block = following.block = block
            return output, following

        return step


class Kernels(NamedTuple):
    """Compiled entry points of a tick."""

    before: Callable[..., Any]
    after: Callable[..., Any]
    limit: Callable[..., Any]
    whole: Callable[..., Any]


LAW = types.NamedTuple((OWN_MATRIX, OWN_MATRIX, OWN_INTEGERS), Law)
SCRATCH = types.NamedTuple((*[OWN_VECTOR] * 6, *[OWN_MATRIX] * 2), Scratch)
GIVEN_VECTORS = types.UniTuple(VECTOR_IN, 6)


@functools.cache
def kernels() -> Kernels:
    """Compile the entry points, or load them from the disk."""
    return Kernels(
        kernel(_before, (ARM, LAW, SCRATCH, OWN_MATRIX, GIVEN_VECTORS, OWN_MATRIX)),
        kernel(_after, (ARM, LAW, VECTOR_IN, VECTOR_IN, VECTOR_IN, OWN_MATRIX)),
        kernel(_limit, (LAW, SCRATCH, OWN_MATRIX, OWN_MATRIX)),
        kernel(_whole, (ARM, SPACE, LAW, SCRATCH, OWN_MATRIX, GIVEN_VECTORS, OWN_MATRIX)),
    )


Vectors = tuple[Array, Array, Array, Array, Array, Array]


def _before(
    arm: ArmTables, law: Law, work: Scratch, state: Array, given: Vectors, block: Array
) -> int:
    measured = Measured(*given)
    if state.shape != block.shape or not is_sound(arm, measured):
        return REFUSED
    before_torque(arm, law, work, state, measured, block)
    return DONE


def _after(arm: ArmTables, law: Law, torque: Array, v: Array, tau_ext: Array, block: Array) -> int:
    return after_torque(arm, law, torque, v, tau_ext, block)


def _limit(law: Law, work: Scratch, state: Array, block: Array) -> int:
    within_limits(law, work, state, block)
    return DONE


def _whole(
    arm: ArmTables,
    space: Workspace,
    law: Law,
    work: Scratch,
    state: Array,
    given: Vectors,
    block: Array,
) -> int:
    measured = Measured(*given)
    if state.shape != block.shape or not is_sound(arm, measured):
        return REFUSED
    before_torque(arm, law, work, state, measured, block)
    model_torque(arm, space, law, work, measured)
    if after_torque(arm, law, work.torque, measured.v, measured.tau_ext, block) == EXCEEDED:
        rigid_body.mass_matrix(arm, space, work.mass)
        within_limits(law, work, state, block)
    return DONE
