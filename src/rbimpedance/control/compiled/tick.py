"""The tick in compiled code: `whole_tick` shows its sequence, `numpy_tick` of control/tick.py specifies it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from ..._common.arrays import Array
from ..._numba.compile import inline, kernel, routine
from ..._numba.formulas import helper
from ..._numba.lanes import any_of, select
from ..._numba.layouts.objects import (
    DONE,
    NOTHING,
    OBJECTS,
    BlockArgument,
    PairResult,
    VectorsArgument,
    returner,
)
from ..._numba.layouts.tables import Held, opened
from ...law.formulas import clip
from ...law.surfaces import demanded_acceleration
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import ARM, OWN_INTEGERS, OWN_MATRIX, OWN_VECTOR, SPACE, VECTOR_IN
from ...robot.compiled.rigid_body import friction, place_joints
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables, Workspace
from ...trajectories import Reference
from .block import (
    A_R,
    CLIPPED,
    COLUMNS,
    E1,
    E2,
    FLAGS,
    NEXT_A,
    NEXT_Q_E,
    NEXT_V_E,
    NEXT_X,
    NEXT_Z,
    Q_E,
    TAU,
    TAU_EXT,
    TICKS,
    V_E,
    V_R,
    PackedOutput,
    PackedState,
    S,
    U,
    Z,
)
from .law import (
    A_NEXT,
    A_ROW,
    COUPLED,
    E2_ROW,
    FEEDFORWARD,
    FILTER,
    FULL,
    KNOWLEDGE,
    S_ROW,
    SEEN,
    SEEN_E1,
    U_ROW,
    X_NEXT,
    X_ROW,
    Z_NEXT,
    Z_ROW,
    ZOH_GAIN,
    LawTables,
    Scratch,
    TickInputs,
    couple_joints,
    filter_step,
    position_error,
    reaching,
    surface,
)
from .limits import bounds, put_flags, within_limits

_clip, _demanded = helper(clip), helper(demanded_acceleration)


@inline
def whole_tick(
    arm: ArmTables,
    law: LawTables,
    space: Workspace,
    work: Scratch,
    state: Array,
    given: TickInputs,
    block: Array,
) -> bool:
    """Write a tick to its block; False for inputs that are not sound.

    Args:
        arm: The controller's arm.
        law: Its law.
        space: Work space of its dynamics.
        work: Work space of the tick.
        state: Block of the tick before.
        given: Measurements and reference.
        block: Where output and next state go.
    """
    if not is_sound(arm, given):
        return False
    before_torque(arm, law, work, state, given, block)  # filter, errors, surface, reaching law
    model_torque(arm, space, law, work, given)
    if after_torque(arm, law, work.torque, given.v, given.tau_ext, state, block):
        rigid_body.mass_matrix(arm, space, work.mass)
        within_limits(law, work, state, block)
    return True


@routine
def is_sound(arm: ArmTables, given: TickInputs) -> bool:
    """Whether all sizes are right, all numbers finite, and all (cos, sin) pairs of unit length."""
    topology, n = arm.topology, len(arm.topology)
    q, v, q_d, v_d, a_d, tau_ext = given
    nq = topology[n - 1, Q_INDEX] + (2 if topology[n - 1, KIND] == CONTINUOUS else 1)
    if len(q) != nq or len(q_d) != nq:
        return False
    if len(v) != n or len(v_d) != n or len(a_d) != n or len(tau_ext) != n:
        return False
    if nq != n:
        for j in range(n):
            i = topology[j, Q_INDEX]
            if topology[j, KIND] == CONTINUOUS and not (_is_unit(q, i) and _is_unit(q_d, i)):
                return False
    return zero_if_finite(given) == 0.0


@inline
def zero_if_finite(given: TickInputs) -> float:
    """NaN as soon as one number is not finite."""
    q, v, q_d, v_d, a_d, tau_ext = given
    zero = 0.0
    for i in range(len(q)):
        zero += q[i] * 0.0 + q_d[i] * 0.0
    for j in range(len(v)):
        zero += v[j] * 0.0 + v_d[j] * 0.0 + a_d[j] * 0.0 + tau_ext[j] * 0.0
    return zero


@inline
def _is_unit(q: Array, i: int) -> bool:
    excess: float = q[i] * q[i] + q[i + 1] * q[i + 1] - 1.0
    return abs(excess) < 1.9e-6  # a little inside Pinocchio's bound


@routine
def before_torque(
    arm: ArmTables, law: LawTables, scratch: Scratch, state: Array, given: TickInputs, block: Array
) -> None:
    """Write reference, errors, s, u, the next state without limits, and the commanded acceleration.

    Args:
        arm: The arm.
        law: The law.
        scratch: Where the command and the results of surface and reaching law go.
        state: Block of the tick before.
        given: Sound measurements.
        block: Block of this tick; with a filter that is given, it holds a_e and the next q_e and v_e.
    """
    is_clipped = follow(arm, law, scratch, state, given, block)  # eqs. (3), (4)
    surface(law, scratch, block, is_clipped)  # eqs. (6), (7)
    reaching(law, scratch, any_of(state[0, TICKS] == 0.0))
    joints = scratch.joints
    for j in range(len(block)):
        u = joints[U_ROW, j]
        a = _demanded(block[j, A_R], joints[FEEDFORWARD, j], u, joints[ZOH_GAIN, j])  # eq. (8)
        scratch.command[j], block[j, S], block[j, U] = a, joints[S_ROW, j], u
        block[j, Z], block[j, NEXT_Z] = joints[Z_ROW, j], joints[Z_NEXT, j]
        block[j, NEXT_X], block[j, NEXT_A] = joints[X_NEXT, j], joints[A_NEXT, j]


@inline
def follow(
    arm: ArmTables, law: LawTables, scratch: Scratch, state: Array, given: TickInputs, block: Array
) -> bool:
    """Write impedance reference, errors and memory of the reaching law; whether the surface sees all of e1."""
    q, v, q_d, v_d, a_d, tau_ext = given
    joints, is_clipped = scratch.joints, False
    if law.choices[0, FILTER] == COUPLED:
        couple_joints(law, state, tau_ext, scratch.filtered)
    for j in range(len(v)):
        q_e, v_e = state[j, NEXT_Q_E], state[j, NEXT_V_E]
        a_e, q_e_next, v_e_next = filter_step(law, scratch, j, state, tau_ext, block)  # eq. (3)
        e1 = position_error(arm, j, q, q_d, q_e, block)  # eq. (4)
        v_r, bound = v_d[j] + v_e, law.gains[j, SEEN]
        e2 = v_r - v[j]
        block[j, V_R], block[j, A_R], block[j, E1], block[j, E2] = v_r, a_d[j] + a_e, e1, e2
        block[j, Q_E], block[j, V_E] = q_e, v_e
        block[j, NEXT_Q_E], block[j, NEXT_V_E] = q_e_next, v_e_next
        block[j, TICKS], block[j, TAU_EXT] = state[0, TICKS] + 1.0, tau_ext[j]
        joints[SEEN_E1, j], joints[E2_ROW, j] = _clip(e1, -bound, bound), e2
        joints[Z_ROW, j], joints[X_ROW, j] = state[j, NEXT_Z], state[j, NEXT_X]
        joints[A_ROW, j] = state[j, NEXT_A]
        is_beyond = abs(e1) > bound
        block[j, FLAGS] += select(is_beyond, CLIPPED, 0.0)
        is_clipped = is_clipped or any_of(is_beyond)
    return is_clipped


@routine
def model_torque(
    arm: ArmTables, space: Workspace, law: LawTables, scratch: Scratch, given: TickInputs
) -> None:
    """Write RNEA(q, v, command), or M(q)·command where only the mass matrix is known."""
    place_joints(arm, space, given.q)
    if law.choices[0, KNOWLEDGE] == FULL:
        rigid_body.inverse_dynamics(arm, space, given.v, scratch.command, scratch.torque)
        return
    rigid_body.mass_matrix(arm, space, scratch.mass)
    n = len(scratch.command)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += scratch.mass[i, j] * scratch.command[j]
        scratch.torque[i] = total


@routine
def after_torque(
    arm: ArmTables,
    law: LawTables,
    torque: Array,
    v: Array,
    tau_ext: Array,
    state: Array,
    block: Array,
) -> bool:
    """Write the motor torque from the model's; whether a limit is exceeded and asks for `within_limits`.

    Args:
        arm: The arm.
        law: The law.
        torque: Torque of the model, without friction.
        v: Velocity.
        tau_ext: Torque of the environment.
        state: Block of the tick before.
        block: Block of this tick.
    """
    exceeded = False
    for j in range(len(v)):
        tau = torque[j]
        if law.choices[0, KNOWLEDGE] == FULL:
            tau += friction(arm.joints, j, v[j])
        tau -= tau_ext[j]
        lower, upper = bounds(law, j, state)
        exceeded = exceeded | (tau < lower) | (tau > upper)
        block[j, TAU] = tau
        put_flags(law, j, state, block, True)
    return exceeded


class LawWords(NamedTuple):
    """What a tick around Pinocchio's RNEA reads and nobody writes."""

    arm: ArmTables
    law: LawTables


class TickWords(NamedTuple):
    """What a compiled tick needs besides its arguments: what it reads, what it writes, and where the torque goes."""

    arm: ArmTables
    law: LawTables
    space: Workspace
    scratch: Scratch
    tau: Array


LAW = types.NamedTuple((*[OWN_MATRIX] * 4, OWN_INTEGERS), LawTables)
SCRATCH = types.NamedTuple(
    (*[OWN_VECTOR] * 2, OWN_MATRIX, *[OWN_VECTOR] * 5, *[OWN_MATRIX] * 3, OWN_VECTOR),
    Scratch,
)
_FIXED, _WORK = Held(types.NamedTuple((ARM, LAW), LawWords)), Held(SCRATCH)
_OWN = Held(types.NamedTuple((ARM, LAW, SPACE, SCRATCH, OWN_VECTOR), TickWords))
_STATE, _RESULT = BlockArgument(PackedState, COLUMNS), PairResult(PackedOutput, PackedState)
_GIVEN = (VECTOR_IN, VECTOR_IN, VectorsArgument(Reference, VECTOR_IN), VECTOR_IN)
_returned = returner(_RESULT)


@functools.cache
def before_kernel() -> Callable[..., Any]:
    """Compile what comes before the torque of the model, or load it from the disk."""
    return kernel(_before, (_FIXED, _WORK, _STATE, *_GIVEN))


@functools.cache
def after_kernel() -> Callable[..., Any]:
    """Compile what comes after it, or load it."""
    vectors = (VECTOR_IN,) * 3
    return kernel(_after, (_FIXED, _WORK, OWN_VECTOR, _STATE, *vectors), _RESULT)


@functools.cache
def limit_kernel() -> Callable[..., Any]:
    """Compile what comes then, where a limit is exceeded, or load it."""
    return kernel(_limit, (_FIXED, _WORK, OWN_VECTOR, _STATE), _RESULT)


@functools.cache
def whole_kernel() -> Callable[..., Any]:
    """Compile the whole tick, or load it."""
    return kernel(_whole, (_OWN, _STATE, *_GIVEN), _RESULT)


def _before(
    fixed: Any, held: Any, state: Array, q: Array, v: Array, reference: Any, tau_ext: Array
) -> int:
    arm, law = opened(fixed)
    work = opened(held)
    given = TickInputs(q, v, reference[0], reference[1], reference[2], tau_ext)
    if state.shape != work.block.shape or not is_sound(arm, given):
        return 1
    before_torque(arm, law, work, state, given, work.block)
    return 0


def _after(
    fixed: Any, held: Any, tau: Array, state: Array, torque: Array, v: Array, tau_ext: Array
) -> Any:
    arm, law = opened(fixed)
    block = opened(held).block
    if after_torque(arm, law, torque, v, tau_ext, state, block):
        return _returned(NOTHING, block)
    return _made(block, state, tau)


def _limit(fixed: Any, held: Any, tau: Array, state: Array) -> Any:
    _, law = opened(fixed)
    work = opened(held)
    within_limits(law, work, state, work.block)
    return _made(work.block, state, tau)


def _whole(own: Any, state: Array, q: Array, v: Array, reference: Any, tau_ext: Array) -> Any:
    arm, law, space, work, tau = opened(own)
    given = TickInputs(q, v, reference[0], reference[1], reference[2], tau_ext)
    if state.shape != work.block.shape or not whole_tick(
        arm, law, space, work, state, given, work.block
    ):
        return _returned(NOTHING, work.block)
    return _made(work.block, state, tau)


@inline
def _made(block: Array, state: Array, tau: Array) -> Any:
    """New objects; or torque and next state in memory of the caller's, where it gives a place for the torque."""
    if len(tau) == 0:
        return _returned(OBJECTS, block)
    for j in range(len(tau)):
        tau[j] = block[j, TAU]
        for k in range(COLUMNS):
            state[j, k] = block[j, k]
    return _returned(DONE, block)
