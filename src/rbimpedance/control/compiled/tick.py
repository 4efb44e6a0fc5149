"""One tick as compiled code: the part before the torque of the model, that torque, and the part after it."""

from __future__ import annotations

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ...robot.compiled import rigid_body
from ...robot.compiled.rigid_body import friction, place_joints
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables, Workspace
from .block import (
    A_R,
    CLIPPED,
    E1,
    E2,
    FLAGS,
    NEXT_A,
    NEXT_Q_E,
    NEXT_V_E,
    NEXT_X,
    NEXT_Z,
    PAIR,
    Q_E,
    Q_R,
    Q_R_SIN,
    TAU,
    TAU_EXT,
    TICKS,
    V_E,
    V_R,
    S,
    U,
    Z,
)
from .kernels import (
    COUPLED,
    DECOUPLED,
    FILTER,
    FULL,
    KNOWLEDGE,
    SEEN,
    Law,
    Measured,
    Scratch,
    add_angle,
    angle_between,
    reaching,
    surface,
)
from .limits import bounds, put_flags

DONE, REFUSED, EXCEEDED = 0, 1, 2
"""How a kernel ended: well; with inputs that are not sound; with a torque beyond a limit."""


@routine
def is_sound(arm: ArmTables, given: Measured) -> bool:
    """Whether all sizes are right, all numbers finite, and all (cos, sin) pairs of unit length."""
    topology, n = arm.topology, len(arm.topology)
    q, v, q_d, v_d, a_d, tau_ext = given
    nq = topology[n - 1, Q_INDEX] + (2 if topology[n - 1, KIND] == CONTINUOUS else 1)
    if len(q) != nq or len(q_d) != nq:
        return False
    if len(v) != n or len(v_d) != n or len(a_d) != n or len(tau_ext) != n:
        return False
    zero: float = 0.0  # NaN as soon as one number is not finite
    for i in range(nq):
        zero += q[i] * 0.0 + q_d[i] * 0.0
    for j in range(n):
        zero += v[j] * 0.0 + v_d[j] * 0.0 + a_d[j] * 0.0 + tau_ext[j] * 0.0
    if nq != n:
        for j in range(n):
            i = topology[j, Q_INDEX]
            if topology[j, KIND] == CONTINUOUS and not (_is_unit(q, i) and _is_unit(q_d, i)):
                return False
    return zero == 0.0


@inline
def _is_unit(q: Array, i: int) -> bool:
    excess: float = q[i] * q[i] + q[i + 1] * q[i + 1] - 1.0
    return abs(excess) < 1.9e-6  # a little inside Pinocchio's bound


@routine
def before_torque(
    arm: ArmTables, law: Law, scratch: Scratch, state: Array, given: Measured, block: Array
) -> None:
    """Write reference, errors, s, u, the next state without limits, and the commanded acceleration.

    Args:
        arm: The arm.
        law: The law.
        scratch: Where the command and the hold gain go.
        state: Block of the tick before.
        given: Sound measurements.
        block: Block of this tick; with a filter that is given, it holds a_e and the next q_e and v_e.
    """
    q, v, q_d, v_d, a_d, tau_ext = given
    command, zoh_gain = scratch.command, scratch.zoh_gain
    starts = state[0, TICKS] == 0.0
    if law.choices[0, FILTER] == COUPLED:
        _couple(law, state, tau_ext, scratch.filtered)
    for j in range(len(v)):
        q_e, v_e, z = state[j, NEXT_Q_E], state[j, NEXT_V_E], state[j, NEXT_Z]
        a_e, q_e_next, v_e_next = _filter(law, scratch, j, state, tau_ext, block)  # eq. (3)
        e1 = _track(arm, j, q, q_d, q_e, block)  # eq. (4)
        v_r, a_r = v_d[j] + v_e, a_d[j] + a_e
        e2 = v_r - v[j]
        s, feedforward, gain = surface(law, j, e1, e2)  # eq. (6)
        x, a = state[j, NEXT_X], state[j, NEXT_A]
        if starts:
            z, x, a = 0.0, s, 0.0
        u, z_next, x_next, a_next = reaching(law, j, s, z, x, a)  # eq. (8)
        command[j], zoh_gain[j] = a_r + (feedforward + u) / gain, gain
        block[j, V_R], block[j, A_R], block[j, E1], block[j, E2] = v_r, a_r, e1, e2
        block[j, S], block[j, U], block[j, Q_E], block[j, V_E] = s, u, q_e, v_e
        block[j, NEXT_Q_E], block[j, NEXT_V_E] = q_e_next, v_e_next
        block[j, NEXT_Z], block[j, NEXT_X], block[j, NEXT_A] = z_next, x_next, a_next
        block[j, TICKS], block[j, Z], block[j, TAU_EXT] = state[0, TICKS] + 1.0, z, tau_ext[j]
        if abs(e1) > law.gains[j, SEEN]:
            block[j, FLAGS] += CLIPPED


@routine
def after_torque(
    arm: ArmTables, law: Law, torque: Array, v: Array, tau_ext: Array, state: Array, block: Array
) -> int:
    """Write the motor torque from the model's; `EXCEEDED` where a limit asks for `within_limits`.

    Args:
        arm: The arm.
        law: The law.
        torque: Torque of the model, without friction.
        v: Velocity.
        tau_ext: Torque of the environment.
        state: Block of the tick before.
        block: Block of this tick.
    """
    status = DONE
    for j in range(len(v)):
        tau = torque[j]
        if law.choices[0, KNOWLEDGE] == FULL:
            tau += friction(arm.joints, j, v[j])
        tau -= tau_ext[j]
        lower, upper = bounds(law, j, state)
        if tau < lower or tau > upper:
            status = EXCEEDED
        block[j, TAU] = tau
        put_flags(law, j, state, block, True)
    return status


@routine
def model_torque(
    arm: ArmTables, space: Workspace, law: Law, scratch: Scratch, given: Measured
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


@inline
def _filter(
    law: Law, scratch: Scratch, j: int, state: Array, tau_ext: Array, block: Array
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
def _couple(law: Law, state: Array, tau_ext: Array, filtered: Array) -> None:
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
def _track(arm: ArmTables, j: int, q: Array, q_d: Array, q_e: float, block: Array) -> float:
    """Write q_r = q_d (+) q_e of joint j, and return e1 = q_r (-) q (paper, eq. 4)."""
    i = arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] != CONTINUOUS:
        q_r = q_d[i] + q_e
        block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = q_r, 0.0, 0.0
        return float(q_r - q[i])
    cos, sin = add_angle(q_d[i], q_d[i + 1], q_e)
    block[j, Q_R], block[j, Q_R_SIN], block[j, FLAGS] = cos, sin, PAIR
    return angle_between(q[i], q[i + 1], cos, sin)
