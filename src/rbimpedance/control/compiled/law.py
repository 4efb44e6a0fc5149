"""The tables that a tick reads, and what it does joint by joint: filter, errors, surface, reaching law.

The formulas of surface and reaching law are those of `law`, compiled by `formulas`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import inline
from ..._numba.formulas import call_loop, helper
from ..._numba.lanes import any_of, first_lane, select
from ...law.bounded_surface import at_bound
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .block import A_R, E1, FLAGS, NEXT_Q_E, NEXT_V_E, PAIR, Q_R, Q_R_SIN

# Columns of `LawTables.gains`, one row a joint.
DT, K2 = 0, 1  # the second for the implicit scheme
EFFORT, TORQUE_STEP, SEEN = 2, 3, 4  # largest torque, change of it, and error; may be infinite
GAINS = 5

# Entries of `LawTables.choices`; the first two are addresses, see `formulas`.
SURFACE, REACHING, PREDICTS, FILTER, KNOWLEDGE = 0, 1, 2, 3, 4
CHOICES = 5
DECOUPLED, COUPLED, GIVEN = 0, 1, 2
FULL, MASS_ONLY = 0, 1


# Rows of `Scratch.joints`: two for the surface, which gives three; then four for the reaching law, which gives four.
SEEN_E1, E2_ROW = 0, 1
FEEDFORWARD, ZOH_GAIN, S_ROW = 2, 3, 4
Z_ROW, X_ROW, A_ROW = 5, 6, 7
U_ROW, Z_NEXT, X_NEXT, A_NEXT = 8, 9, 10, 11
ROWS = 12


class LawTables(NamedTuple):
    """Everything of a controller but its arm.

    Attributes:
        gains: One row a joint, shape (nv, `GAINS`).
        surface: Gains of the surface's formula, a row for each, shape (number of gains, nv).
        reaching: Those of the reaching law's formula.
        filter: What takes (q_e, v_e, tau_ext) to a_e and the next q_e, v_e. Decoupled: nine numbers a joint, shape
            (nv, 9). Coupled: a column for each result, (3·nv, 3·nv). Given: not used, the block has them already.
        choices: Loops of surface and reaching law, whether the latter predicts s, filter and knowledge, shape
            (1, `CHOICES`).
    """

    gains: Array
    surface: Array
    reaching: Array
    filter: Array
    choices: NDArray[np.int64]


class TickInputs(NamedTuple):
    """What a tick is given.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        q_d: Desired configuration, shape (nq,).
        v_d: Its velocity, shape (nv,).
        a_d: Its acceleration, shape (nv,).
        tau_ext: Torque of the environment, shape (nv,).
    """

    q: Array
    v: Array
    q_d: Array
    v_d: Array
    a_d: Array
    tau_ext: Array


class Scratch(NamedTuple):
    """What a tick writes besides its output.

    Attributes:
        command: Acceleration that the torque is to bring about, shape (nv,).
        torque: Torque of the model for it, later the one within the limits, shape (nv,).
        joints: What surface and reaching law are given and give, shape (`ROWS`, nv).
        wanted: Torque before the limits, shape (nv,).
        lower: Least torque within the limits, shape (nv,).
        upper: Largest one.
        acceleration_deficit: Acceleration withheld by them, shape (nv,).
        held: Whether the joint is held at its limit, 1 or 0, shape (nv,).
        mass: M(q), shape (nv, nv).
        factor: Its Cholesky factor over the joints at their limits, shape (nv, nv).
        block: Output and next state of the tick, shape (nv, columns of `output`).
        filtered: a_e, next q_e and next v_e of a filter that couples the joints, shape (3·nv,).
    """

    command: Array
    torque: Array
    joints: Array
    wanted: Array
    lower: Array
    upper: Array
    acceleration_deficit: Array
    held: Array
    mass: Array
    factor: Array
    block: Array
    filtered: Array


@inline
def add_angle(cos: float, sin: float, angle: float) -> tuple[float, float]:
    """(cos, sin) (+) angle, kept on the circle as Pinocchio keeps it."""
    c, s = math.cos(angle), math.sin(angle)
    x, y = c * cos - s * sin, s * cos + c * sin
    to_unit = (3.0 - (x * x + y * y)) / 2.0
    return x * to_unit, y * to_unit


@inline
def angle_between(cos0: float, sin0: float, cos1: float, sin1: float) -> float:
    """(cos1, sin1) (-) (cos0, sin0), in Pinocchio's cases."""
    cos, sin = cos0 * cos1 + sin0 * sin1, cos0 * sin1 - sin0 * cos1
    angle, is_small = 0.0 * cos, 2.0 * cos > 2.0 - 1e-2
    if any_of(is_small):
        angle = select(cos > 1.0, 0.0, math.asin(max(-1.0, min(sin, 1.0))))
    if any_of(2.0 * cos <= 2.0 - 1e-2):
        size = math.acos(max(cos, -1.0))
        angle = select(is_small, angle, select(sin >= 0.0, size, -size))
    return angle


_at_bound = helper(at_bound)


@inline
def surface(law: LawTables, scratch: Scratch, block: Array, is_clipped: bool) -> None:
    """Write s, feed-forward and gain of all joints.

    Args:
        law: The law.
        scratch: With the errors that the surface sees.
        block: With the errors.
        is_clipped: Whether one is beyond the bound of a `BoundedSurface`.
    """
    joints, dt = scratch.joints, first_lane(law.gains[0, DT])
    call_loop(law.choices[0, SURFACE], joints, SEEN_E1, dt, law.surface, FEEDFORWARD)
    if is_clipped:
        for j in range(len(block)):
            own = joints[FEEDFORWARD, j], joints[ZOH_GAIN, j]
            given = _at_bound(block[j, E1], law.gains[j, SEEN], *own)
            joints[FEEDFORWARD, j], joints[ZOH_GAIN, j] = given


@inline
def reaching(law: LawTables, scratch: Scratch, starts: bool) -> None:
    """Write u, and the next z, x and a, of all joints."""
    joints, dt = scratch.joints, first_lane(law.gains[0, DT])
    if starts:
        for j in range(joints.shape[1]):
            joints[Z_ROW, j], joints[X_ROW, j], joints[A_ROW, j] = 0.0, joints[S_ROW, j], 0.0
    call_loop(law.choices[0, REACHING], joints, S_ROW, dt, law.reaching, U_ROW)


@inline
def filter_step(
    law: LawTables, scratch: Scratch, j: int, state: Array, tau_ext: Array, block: Array
) -> tuple[float, float, float]:
    """a_e, and the next q_e and v_e, of joint j."""
    F, kind, n = law.filter, law.choices[0, FILTER], len(tau_ext)
    if kind == DECOUPLED:
        x, v, t = state[j, NEXT_Q_E], state[j, NEXT_V_E], tau_ext[j]
        return (
            F[j, 0] * x + F[j, 1] * v + F[j, 2] * t,
            F[j, 3] * x + F[j, 4] * v + F[j, 5] * t,
            F[j, 6] * x + F[j, 7] * v + F[j, 8] * t,
        )
    if kind == COUPLED:
        return scratch.filtered[j], scratch.filtered[n + j], scratch.filtered[2 * n + j]
    return block[j, A_R], block[j, NEXT_Q_E], block[j, NEXT_V_E]


@inline
def couple_joints(law: LawTables, state: Array, tau_ext: Array, filtered: Array) -> None:
    """Write a_e, and the next q_e and v_e, of all joints: column by column, in long loops."""
    n = len(tau_ext)
    for i in range(3 * n):
        filtered[i] = 0.0
    for k in range(n):
        _add_column(law.filter, k, state[k, NEXT_Q_E], filtered)
        _add_column(law.filter, n + k, state[k, NEXT_V_E], filtered)
        _add_column(law.filter, 2 * n + k, tau_ext[k], filtered)


@inline
def _add_column(F: Array, k: int, factor: float, total: Array) -> None:
    for i in range(len(total)):
        total[i] += F[k, i] * factor


@inline
def position_error(arm: ArmTables, j: int, q: Array, q_d: Array, q_e: float, block: Array) -> float:
    """Write q_r = q_d (+) q_e of joint j, and return e1 = q_r (-) q."""
    i = arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] != CONTINUOUS:
        q_r = q_d[i] + q_e
        block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = q_r, 0.0, 0.0
        return q_r - q[i]  # type: ignore[no-any-return]
    cos, sin = add_angle(q_d[i], q_d[i + 1], q_e)
    block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = cos, sin, PAIR
    return angle_between(q[i], q[i + 1], cos, sin)
