"""The kernels of a tick: what Python calls, made of the routines of `tick`."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from ..._common.arrays import Array
from ..._numba.compile import inline, kernel
from ..._numba.table_arguments import Held, opened
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import ARM, OWN_INTEGERS, OWN_MATRIX, OWN_VECTOR, SPACE, VECTOR_IN
from ...robot.compiled.tables import ArmTables, Workspace
from .block import COLUMNS, TAU
from .kernels import Law, Measured, Scratch
from .limits import within_limits
from .object_arguments import DONE, NOTHING, OBJECTS, Answer, ReferenceIn, StateIn, answer
from .tick import EXCEEDED, after_torque, before_torque, is_sound, model_torque


class Fixed(NamedTuple):
    """What a tick around Pinocchio's RNEA reads and nobody writes."""

    arm: ArmTables
    law: Law


class Own(NamedTuple):
    """What a compiled tick needs besides its arguments: what it reads, what it writes, and where the torque goes."""

    arm: ArmTables
    law: Law
    space: Workspace
    scratch: Scratch
    tau: Array


LAW = types.NamedTuple((OWN_MATRIX, OWN_MATRIX, OWN_INTEGERS), Law)
SCRATCH = types.NamedTuple((*[OWN_VECTOR] * 6, *[OWN_MATRIX] * 3, OWN_VECTOR), Scratch)
_FIXED, _WORK = Held(types.NamedTuple((ARM, LAW), Fixed)), Held(SCRATCH)
_OWN = Held(types.NamedTuple((ARM, LAW, SPACE, SCRATCH, OWN_VECTOR), Own))
_STATE, _ANSWER = StateIn(), Answer()
_GIVEN = (VECTOR_IN, VECTOR_IN, ReferenceIn(VECTOR_IN), VECTOR_IN)


@functools.cache
def before_kernel() -> Callable[..., Any]:
    """Compile what comes before the torque of the model, or load it from the disk."""
    return kernel(_before, (_FIXED, _WORK, _STATE, *_GIVEN))


@functools.cache
def after_kernel() -> Callable[..., Any]:
    """Compile what comes after it, or load it."""
    vectors = (VECTOR_IN,) * 3
    return kernel(_after, (_FIXED, _WORK, OWN_VECTOR, _STATE, *vectors), _ANSWER)


@functools.cache
def limit_kernel() -> Callable[..., Any]:
    """Compile what comes then, where a limit is exceeded, or load it."""
    return kernel(_limit, (_FIXED, _WORK, OWN_VECTOR, _STATE), _ANSWER)


@functools.cache
def whole_kernel() -> Callable[..., Any]:
    """Compile the whole tick, or load it."""
    return kernel(_whole, (_OWN, _STATE, *_GIVEN), _ANSWER)


def _before(
    fixed: Any, held: Any, state: Array, q: Array, v: Array, reference: Any, tau_ext: Array
) -> int:
    arm, law = opened(fixed)
    work = opened(held)
    given = Measured(q, v, reference[0], reference[1], reference[2], tau_ext)
    if state.shape != work.block.shape or not is_sound(arm, given):
        return 1
    before_torque(arm, law, work, state, given, work.block)
    return 0


def _after(
    fixed: Any, held: Any, tau: Array, state: Array, torque: Array, v: Array, tau_ext: Array
) -> Any:
    arm, law = opened(fixed)
    block = opened(held).block
    if after_torque(arm, law, torque, v, tau_ext, state, block) == EXCEEDED:
        return answer(NOTHING, block)
    return _made(block, state, tau)


def _limit(fixed: Any, held: Any, tau: Array, state: Array) -> Any:
    _, law = opened(fixed)
    work = opened(held)
    within_limits(law, work, state, work.block)
    return _made(work.block, state, tau)


def _whole(own: Any, state: Array, q: Array, v: Array, reference: Any, tau_ext: Array) -> Any:
    arm, law, space, work, tau = opened(own)
    given = Measured(q, v, reference[0], reference[1], reference[2], tau_ext)
    if state.shape != work.block.shape or not is_sound(arm, given):
        return answer(NOTHING, work.block)
    before_torque(arm, law, work, state, given, work.block)
    model_torque(arm, space, law, work, given)
    if after_torque(arm, law, work.torque, v, tau_ext, state, work.block) == EXCEEDED:
        rigid_body.mass_matrix(arm, space, work.mass)
        within_limits(law, work, state, work.block)
    return _made(work.block, state, tau)


@inline
def _made(block: Array, state: Array, tau: Array) -> Any:
    """New objects; or torque and next state in memory of the caller's, where it gives a place for the torque."""
    if len(tau) == 0:
        return answer(OBJECTS, block)
    for j in range(len(tau)):
        tau[j] = block[j, TAU]
        for k in range(COLUMNS):
            state[j, k] = block[j, k]
    return answer(DONE, block)
