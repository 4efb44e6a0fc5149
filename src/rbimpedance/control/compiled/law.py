"""The formulas of a tick for one joint: filter, errors, surface, reaching law; and the tables that they read.

They are those of `impedance`, `surfaces` and `super_twisting`, whose NumPy form is the specification, in strict IEEE
arithmetic. A power that is needed twice is taken once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import inline
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .block import A_R, FLAGS, NEXT_Q_E, NEXT_V_E, PAIR, Q_R, Q_R_SIN

# Columns of `LawTables.gains`, one row a joint.
DT, GAMMA, EXPONENT, RATE, SMOOTHING, INNER_SLOPE, INNER_CURVE, BETA = 0, 1, 2, 3, 4, 5, 6, 7
K1, K2, MARGIN = 8, 9, 10
EFFORT, TORQUE_STEP, SEEN = 11, 12, 13  # largest torque, change of it, and error; may be infinite
GAINS = 14

# Entries of `LawTables.choices`.
SURFACE, SCHEME, FILTER, KNOWLEDGE = 0, 1, 2, 3
POWER, FAST_TERMINAL, NONSINGULAR_TERMINAL = 0, 1, 2
EXPLICIT, MATCHED, IMPLICIT = 0, 1, 2
DECOUPLED, COUPLED, GIVEN = 0, 1, 2
FULL, MASS_ONLY = 0, 1


class LawTables(NamedTuple):
    """Everything of a controller but its arm.

    Attributes:
        gains: One row a joint, shape (nv, `GAINS`).
        filter: What takes (q_e, v_e, tau_ext) to a_e and the next q_e, v_e. Decoupled: nine numbers a joint, shape
            (nv, 9). Coupled: a column for each result, (3·nv, 3·nv). Given: not used, the block has them already.
        choices: Surface, scheme, filter and knowledge, shape (1, 4).
    """

    gains: Array
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
        torque: Torque of the model for it, shape (nv,).
        zoh_gain: Of the surface, shape (nv,).
        wanted: Torque before the limits, shape (nv,).
        acceleration_deficit: Acceleration withheld by them, shape (nv,).
        held: Whether the joint is held at its limit, 1 or 0, shape (nv,).
        mass: M(q), shape (nv, nv).
        factor: Its Cholesky factor over the joints at their limits, shape (nv, nv).
        block: Output and next state of the tick, shape (nv, columns of `output`).
        filtered: a_e, next q_e and next v_e of a filter that couples the joints, shape (3·nv,).
    """

    command: Array
    torque: Array
    zoh_gain: Array
    wanted: Array
    acceleration_deficit: Array
    held: Array
    mass: Array
    factor: Array
    block: Array
    filtered: Array


@inline
def sign(x: float) -> float:
    """-1, 0 or 1."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return x


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
    if cos > 1.0:
        return 0.0
    if cos < -1.0:
        return math.copysign(math.pi, sin)
    if 2.0 * cos > 2.0 - 1e-2:
        return math.asin(sin)
    return math.acos(cos) if sin >= 0.0 else -math.acos(cos)


@inline
def surface(law: LawTables, j: int, e1: float, e2: float) -> tuple[float, float, float]:
    """S, feed-forward and hold gain of joint j (paper, eqs. 6 to 8); see `BoundedSurface` for the bound."""
    bound = law.gains[j, SEEN]
    seen = min(max(e1, -bound), bound)
    s, feedforward, gain = _unbounded_surface(law, j, seen, e2)
    if seen != e1:
        return s, 0.0, 1.0
    return s, feedforward, gain


@inline
def _unbounded_surface(law: LawTables, j: int, e1: float, e2: float) -> tuple[float, float, float]:
    gains, kind = law.gains, law.choices[0, SURFACE]
    if kind == POWER:
        return _power_surface(gains, j, e1, e2)
    if kind == FAST_TERMINAL:
        return _fast_terminal_surface(gains, j, e1, e2)
    return _nonsingular_terminal_surface(gains, j, e1, e2)


@inline
def _power_surface(gains: Array, j: int, e1: float, e2: float) -> tuple[float, float, float]:
    gamma, p = gains[j, GAMMA], gains[j, EXPONENT]
    power = abs(e1) ** (p - 1.0)
    return gamma * (power * e1) + e2, gamma * p * power * e2, 1.0


@inline
def _fast_terminal_surface(
    gains: Array, j: int, e1: float, e2: float
) -> tuple[float, float, float]:
    size = abs(e1)
    if size <= gains[j, SMOOTHING]:
        phi = gains[j, INNER_SLOPE] * e1 + gains[j, INNER_CURVE] * e1 * size
        phi_slope = gains[j, INNER_SLOPE] + 2.0 * gains[j, INNER_CURVE] * size
    else:
        power = size ** (gains[j, EXPONENT] - 1.0)
        phi, phi_slope = power * e1, gains[j, EXPONENT] * power
    slope = gains[j, RATE] + gains[j, GAMMA] * phi_slope
    s = e2 + gains[j, RATE] * e1 + gains[j, GAMMA] * phi
    return s, slope * e2, 1.0 + slope * gains[j, DT] / 2.0


@inline
def _nonsingular_terminal_surface(
    gains: Array, j: int, e1: float, e2: float
) -> tuple[float, float, float]:
    beta, p = gains[j, BETA], gains[j, EXPONENT]
    if e2 == 0.0:
        return e1, 0.0, 1.0
    power = abs(e2) ** (p - 1.0)
    return e1 + power * e2 / beta, beta / p * (e2 / power), 1.0


@inline
def reaching(
    law: LawTables, j: int, s: float, z: float, x: float, a: float
) -> tuple[float, float, float, float]:
    """U, and the next z, x and a, of joint j (paper, eq. 8)."""
    gains, scheme = law.gains, law.choices[0, SCHEME]
    dt, k1, k2 = gains[j, DT], gains[j, K1], gains[j, K2]
    if scheme == EXPLICIT:
        u = k1 * (sign(s) * math.sqrt(abs(s))) + k2 * z
        return u, z + dt * sign(s), x, a
    if scheme == MATCHED:
        h, root = gains[j, MARGIN] * dt, math.sqrt(abs(s))
        d = abs(s) + h * k1 * root + h * h * k2
        u = (k1 * root + 2.0 * h * k2) * s / d + k2 * z
        return u, z + dt * s / d, x, a
    return _implicit(dt, k1, k2, s, z, x, a)


@inline
def _implicit(
    h: float, k1: float, k2: float, s: float, z: float, x: float, a: float
) -> tuple[float, float, float, float]:
    b = s + a
    excess = max(abs(b) - h * h * k2, 0.0)
    root = math.sqrt((h * k1 / 2.0) ** 2 + excess) - h * k1 / 2.0
    x_next = sign(b) * (root * root)
    k1_term = h * k1 * sign(b) * root
    xi = min(max(b / (h * h * k2), -1.0), 1.0)
    z_next = z + h * xi
    u = k1_term / h + k2 * z_next - (x - s) / h
    return u, z_next, x_next, x_next - x + k1_term


@inline
def filter_step(
    law: LawTables, scratch: Scratch, j: int, state: Array, tau_ext: Array, block: Array
) -> tuple[float, float, float]:
    """a_e, and the next q_e and v_e, of joint j (paper, eq. 3)."""
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
    filtered[:] = 0.0
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
    """Write q_r = q_d (+) q_e of joint j, and return e1 = q_r (-) q (paper, eq. 4)."""
    i = arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] != CONTINUOUS:
        q_r = q_d[i] + q_e
        block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = q_r, 0.0, 0.0
        return float(q_r - q[i])
    cos, sin = add_angle(q_d[i], q_d[i + 1], q_e)
    block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = cos, sin, PAIR
    return angle_between(q[i], q[i + 1], cos, sin)
