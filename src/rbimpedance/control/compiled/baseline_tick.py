"""The tick of a baseline in compiled code; `FormulaBaseline` of control/baseline_law.py specifies it."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
from numba import types

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.formulas import call_loop
from ..._numba.lanes import first_lane
from ..._numba.layouts.tables import Held, opened
from ..._numba.parts import compiled_part
from ...law.baseline_formulas import INPUTS, RESULTS, input_names
from ...law.impedance import ImpedanceFilter
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import ARM, OWN_MATRIX, OWN_VECTOR, SPACE
from ...robot.compiled.rigid_body import friction, place_joints
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables, Workspace
from ..baseline_law import FormulaBaseline
from . import law as at
from .block import A_R, E1, E2, NEXT_Z, TAU, V_R, S, U, Z
from .formulas import baseline_address
from .law import (
    COUPLED,
    DT,
    FILTER,
    FULL,
    KNOWLEDGE,
    LawTables,
    Scratch,
    TickInputs,
    angle_between,
)
from .pack import pack_filter, scratch
from .tick import LAW, SCRATCH, follow, is_sound, model_torque

# Entries of `LawTables.choices`: loop, torque of the model, whether tau_ext is subtracted; then the row of each input.
LOOP, TORQUE, CANCELS = at.SURFACE, at.REACHING, at.PREDICTS
ROW_OF = at.CHOICES
INVERSE, PASSIVE, GRAVITY = 0, 1, 2
_TORQUES = {"inverse": INVERSE, "passive": PASSIVE, "gravity": GRAVITY}

# Rows of `Scratch.joints`: inputs of the formula from the first one on, one for those that it does not take, results.
_UNUSED = len(INPUTS)
W, A, ADDED, S_ROW, U_ROW, INTEGRAL = range(_UNUSED + 1, _UNUSED + 1 + RESULTS)
_E1, _E2, _Z, _V_D, _A_D, _V_R, _A_R, _RESTORING, _YIELDING = range(len(INPUTS))


class BaselineWords(NamedTuple):
    """What the tick of a baseline reads and writes.

    Attributes:
        arm: The controller's arm.
        law: Its gains and choices.
        target: D_d and K_d, shape (2·nv, nv).
        space: Work space of its dynamics.
        work: Work space of the tick.
        even: Block of the tick before an even one.
        odd: Of the one before an odd one.
        given: Measurements and reference.
        tau: Where the torque goes, shape (nv,).
    """

    arm: ArmTables
    law: LawTables
    target: Array
    space: Workspace
    work: Scratch
    even: Array
    odd: Array
    given: TickInputs
    tau: Array


def has_compiled_tick(controller: Any) -> bool:
    """Whether a controller is a baseline with a compiled form: a linear target, and no limits."""
    if not isinstance(controller, FormulaBaseline):
        return False
    limits: Any = getattr(controller, "limits", None)
    return type(controller._filter) is ImpedanceFilter and limits is None


def pack_baseline(controller: Any) -> LawTables:
    """Return the tables of a baseline.

    Args:
        controller: One that `has_compiled_tick`.
    """
    nv, formula = controller.arm.nv, controller.formula
    gains = np.zeros((nv, at.GAINS))
    gains[:, [at.EFFORT, at.TORQUE_STEP, at.SEEN]] = np.inf
    gains[:, DT] = controller.dt
    choices = np.full((1, ROW_OF + len(INPUTS)), _UNUSED, dtype=np.int64)
    choices[0, LOOP] = baseline_address(formula)
    choices[0, TORQUE] = _TORQUES[controller.model_torque]
    choices[0, CANCELS] = controller.cancels_contact
    choices[0, FILTER], table = pack_filter(controller._filter, nv)
    choices[0, KNOWLEDGE] = at.FULL if controller.model == "full" else at.MASS_ONLY
    for row, name in enumerate(input_names(formula)):
        choices[0, ROW_OF + INPUTS.index(name)] = row
    rows = np.zeros((len(controller.gains), nv))
    for row, value in zip(rows, controller.gains.values(), strict=True):
        row[:] = value
    return LawTables(gains, rows, np.zeros((0, nv)), table, choices)


def restoring_table(controller: Any) -> Array:
    """Return D_d and K_d of a baseline, one upon the other."""
    _, D_d, K_d = controller._filter.matrices
    return np.vstack([D_d, K_d])


def scratch_of(nv: int) -> Scratch:
    """Return work space of the tick of nv joints."""
    return scratch(nv)._replace(joints=np.zeros((INTEGRAL + 1, nv)))


_GIVEN = types.NamedTuple((OWN_VECTOR,) * 6, TickInputs)
_WORDS = types.NamedTuple(
    (ARM, LAW, OWN_MATRIX, SPACE, SCRATCH, OWN_MATRIX, OWN_MATRIX, _GIVEN, OWN_VECTOR),
    BaselineWords,
)


@functools.cache
def baseline_part() -> int:
    """Compile the tick, or load it from the disk, and return its address for `call_part`."""
    return compiled_part(_part, Held(_WORDS))


def _part(held: Any, k: int) -> int:
    """Do tick k; 0 for inputs that are not sound."""
    words = opened(held)
    is_even = k % 2 == 0
    state = words.even if is_even else words.odd
    block = words.odd if is_even else words.even
    if not is_sound(words.arm, words.given):
        return 0
    _baseline_tick(words, state, block)
    for j in range(len(block)):
        words.tau[j] = block[j, TAU]
    return 1


@routine
def _baseline_tick(words: BaselineWords, state: Array, block: Array) -> None:
    """Write a tick to its block."""
    arm, law, work, given = words.arm, words.law, words.work, words.given
    follow(arm, law, work, state, given, block)  # eqs. (3), (4)
    _gather(words, state, block)
    joints, dt = work.joints, first_lane(law.gains[0, DT])
    call_loop(law.choices[0, LOOP], joints, 0, dt, law.surface, W)
    for j in range(len(block)):
        work.command[j] = joints[A, j]
    _torque_of_model(words)
    cancels = law.choices[0, CANCELS] != 0
    for j in range(len(block)):
        tau = work.torque[j] + joints[ADDED, j]
        block[j, TAU] = tau - given.tau_ext[j] if cancels else tau
        block[j, S], block[j, U] = joints[S_ROW, j], joints[U_ROW, j]
        block[j, Z], block[j, NEXT_Z] = state[j, NEXT_Z], joints[INTEGRAL, j]


@inline
def _gather(words: BaselineWords, state: Array, block: Array) -> None:
    """Write the quantities that the formula takes to its rows."""
    law, work, given = words.law, words.work, words.given
    joints, choices, position, speed = work.joints, law.choices, work.wanted, work.lower
    for j in range(len(block)):
        position[j], speed[j] = _behind(words.arm, given, j), given.v_d[j] - given.v[j]
    for j in range(len(block)):
        joints[choices[0, ROW_OF + _E1], j] = block[j, E1]
        joints[choices[0, ROW_OF + _E2], j] = block[j, E2]
        joints[choices[0, ROW_OF + _Z], j] = state[j, NEXT_Z]
        joints[choices[0, ROW_OF + _V_D], j] = given.v_d[j]
        joints[choices[0, ROW_OF + _A_D], j] = given.a_d[j]
        joints[choices[0, ROW_OF + _V_R], j] = block[j, V_R]
        joints[choices[0, ROW_OF + _A_R], j] = block[j, A_R]
        joints[choices[0, ROW_OF + _RESTORING], j] = _restoring(words.target, position, speed, j)
        joints[choices[0, ROW_OF + _YIELDING], j] = _yielding(
            law, position, speed, given.tau_ext, j
        )


@inline
def _behind(arm: ArmTables, given: TickInputs, j: int) -> float:
    """q_d (-) q of joint j."""
    q, q_d, i = given.q, given.q_d, arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] == CONTINUOUS:
        return angle_between(q[i], q[i + 1], q_d[i], q_d[i + 1])
    return q_d[i] - q[i]  # type: ignore[no-any-return]


@inline
def _restoring(target: Array, position: Array, speed: Array, i: int) -> float:
    """D_d·(v_d - v) + K_d·(q_d (-) q) of joint i."""
    n, torque = len(position), 0.0
    for j in range(n):
        torque += target[i, j] * speed[j] + target[n + i, j] * position[j]
    return torque


@inline
def _yielding(law: LawTables, position: Array, speed: Array, tau_ext: Array, i: int) -> float:
    """Acceleration of the target impedance, away from the desired motion, of joint i; see `filter_step`."""
    F, n = law.filter, len(position)
    if law.choices[0, FILTER] != COUPLED:
        a: float = F[i, 2] * tau_ext[i] - F[i, 0] * position[i] - F[i, 1] * speed[i]
        return a
    a = 0.0
    for k in range(n):
        a += F[2 * n + k, i] * tau_ext[k] - F[k, i] * position[k] - F[n + k, i] * speed[k]
    return a


@inline
def _torque_of_model(words: BaselineWords) -> None:
    """Write the torque of the model."""
    arm, law, space, work, given = words.arm, words.law, words.space, words.work, words.given
    kind, knows_all = law.choices[0, TORQUE], law.choices[0, KNOWLEDGE] == FULL
    v, rest = given.v, work.held
    if kind == INVERSE or not knows_all:
        model_torque(arm, space, law, work, given)
        if knows_all:
            _add_friction(arm, v, work.torque)
        return
    for j in range(len(rest)):
        rest[j] = 0.0
    place_joints(arm, space, given.q)
    rigid_body.inverse_dynamics(arm, space, rest, work.command, work.torque)  # M a + g
    if kind == PASSIVE:
        _add_coriolis(words)
        _add_friction(arm, v, work.torque)


@inline
def _add_friction(arm: ArmTables, v: Array, torque: Array) -> None:
    for j in range(len(v)):
        torque[j] += friction(arm.joints, j, v[j])


@inline
def _add_coriolis(words: BaselineWords) -> None:
    """Add C(q, v) w = [c(v + w) - c(v - w)]/4; see `coriolis_torque`."""
    arm, space, work, v = words.arm, words.space, words.work, words.given.v
    together, result = work.upper, work.acceleration_deficit
    for part in range(2):
        way = 1.0 - 2.0 * part
        for j in range(len(v)):
            together[j] = v[j] + way * work.joints[W, j]
        rigid_body.inverse_dynamics(arm, space, together, work.held, result)
        for j in range(len(v)):
            work.torque[j] += way * result[j] / 4.0
