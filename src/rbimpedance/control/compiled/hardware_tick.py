"""The tick of a `HardwareController` in compiled code: the formulas of `control.estimation`, joint by joint."""

from __future__ import annotations

import numpy as np

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.formulas import helper
from ...law import observed_law
from ...law.lag import lagged as lagged_formula
from ...robot.compiled import rigid_body
from ...robot.compiled.rigid_body import friction, place_joints
from ..estimation import extended_state, friction_learning, noise_gate
from ..estimation.friction_learning import LATE, OWN, PACKED, REFERENCE_SMOOTHING, SMOOTHING, TERMS
from ..estimation.noise_gate import OPENING as RISES
from ..hardware_state import (
    DISTURBANCE,
    INNOVATION,
    NORMAL,
    OPENING,
    PARAMETERS,
    Q_E,
    Q_E_BEFORE,
    REGRESSORS,
    TAU,
    TAU_EXT,
    TORQUE,
    V_E,
    V_E_BEFORE,
    V,
)
from .hardware_tables import (
    ACCURACY,
    ALERT,
    DECAY,
    DT,
    EFFORT,
    EXPECTED,
    FALLS,
    FORGOTTEN,
    K2,
    LEAD,
    LOAD_WEIGHT,
    MEAN,
    OUT_A_R,
    OUT_E1,
    OUT_E2,
    OUT_Q_E,
    OUT_S,
    OUT_TAU,
    OUT_U,
    OUT_V_E,
    OUT_V_R,
    PERIODS,
    QUIET,
    RATIO,
    SCALE_WEIGHT,
    STARTS,
    STRIBECK,
    THRESHOLD,
    TORQUE_STEP,
    HardwareTables,
    TickMemory,
    TickOutput,
    TickSpace,
)
from .law import TickInputs
from .manifold import add_step, difference, factorize, solve

correction = helper(extended_state.correction)
moved = helper(extended_state.moved)
filtered_innovation = helper(noise_gate.filtered_innovation)
opened = helper(noise_gate.opened)
dry_share = helper(friction_learning.dry_share)
released = helper(friction_learning.released)
waves = helper(friction_learning.waves)
mismatch_torque = helper(friction_learning.mismatch_torque)
delay_terms = helper(friction_learning.delay_terms)
at = helper(friction_learning.at)
gather = helper(friction_learning.gather)
eliminate = helper(friction_learning.eliminate)
substitute = helper(friction_learning.substitute)
shared = helper(friction_learning.shared)
commanded = helper(observed_law.commanded)
lagged = helper(lagged_formula)

# Rows of `TickSpace.rows`.
_BIAS, _DA, _OMEGA, _FRICTION, _V, _TORQUE, _X = range(7)
_A, _SCALED, _LOAD, _SINE, _COSINE, _SINE_NOW, _COSINE_NOW = range(7, 14)


@routine
def hardware_tick(
    tables: HardwareTables,
    space: TickSpace,
    ticks: int,
    given: TickInputs,
    memory: TickMemory,
    out: TickOutput,
) -> bool:
    """Do a tick; False where a limit is exceeded, and then the memory is not to be used.

    Args:
        tables: The controller.
        space: Work space.
        ticks: Number of ticks so far.
        given: Sound measurements and reference; the velocity is not used.
        memory: The state.
        out: What the tick computes.
    """
    if ticks == 0:
        _start(tables, space, given.q, memory)
    _track(tables, given, memory, out)
    _correct(tables, space, given.q, memory, out)
    _feed_forward(tables, space, memory, out)
    _look_ahead(tables, space, given.tau_ext, memory, out)
    if not _command(tables, space, ticks, given.tau_ext, memory, out):
        return False
    if ticks > tables.numbers[STARTS]:
        _learn(tables, space, memory, out)
    _predict(tables, space, given.tau_ext, memory, out)
    return True


@routine
def _start(tables: HardwareTables, space: TickSpace, q: Array, memory: TickMemory) -> None:
    """At rest where the encoders say, held by the motors."""
    rows, bias = memory.rows, space.rows[_BIAS]
    for i in range(len(q)):
        memory.q[i] = q[i]
    for j in range(len(bias)):
        rows[V, j], rows[DISTURBANCE, j], space.rows[_X, j] = 0.0, 0.0, 0.0
    place_joints(tables.arm, space.recursions, q)
    rigid_body.inverse_dynamics(tables.arm, space.recursions, rows[V], space.rows[_X], bias)
    for j in range(len(bias)):
        rows[TORQUE, j] = bias[j]
        for i in range(len(memory.pending)):
            memory.pending[i, j] = bias[j]


@routine
def _correct(
    tables: HardwareTables, space: TickSpace, q: Array, memory: TickMemory, out: TickOutput
) -> None:
    """Gate and correction by the measurement, then the model at the estimate."""
    arm, joints, rows, own = tables.arm, tables.joints, memory.rows, space.rows
    h, ratio = tables.numbers[DT], tables.numbers[RATIO]
    n = rows.shape[1]
    for j in range(n):
        nu, error = difference(arm, j, memory.q, q), difference(arm, j, memory.q, out.q_r)
        low, high = joints[QUIET, j], joints[ALERT, j]
        omega = ratio * (low + (high - low) * rows[OPENING, j])
        rows[INNOVATION, j] = filtered_innovation(rows[INNOVATION, j], nu, omega, h)
        rows[OPENING, j] = opened(
            rows[OPENING, j], rows[INNOVATION, j], error, joints[THRESHOLD, j], joints[ACCURACY, j],
            joints[FALLS, j], RISES,
        )  # fmt: skip
        own[_OMEGA, j] = low + (high - low) * rows[OPENING, j]
        step, dv, da = correction(nu, ratio * own[_OMEGA, j], h)
        add_step(arm, j, memory.q, step, memory.q)
        rows[V, j] += dv
        own[_DA, j], own[_X, j] = da, 0.0
    place_joints(arm, space.recursions, memory.q)
    rigid_body.mass_matrix(arm, space.recursions, space.M)
    rigid_body.inverse_dynamics(arm, space.recursions, rows[V], own[_X], own[_BIAS])
    for j in range(n):
        own[_BIAS, j] += friction(arm.joints, j, rows[V, j])
        for i in range(n):
            rows[DISTURBANCE, i] += space.M[i, j] * own[_DA, j]
    factorize(space.M, space.factor)


@routine
def _track(tables: HardwareTables, given: TickInputs, memory: TickMemory, out: TickOutput) -> None:
    """Impedance filter and reference (eqs. (3) and (4))."""
    arm, F, rows, o = tables.arm, tables.filter, memory.rows, out.rows
    for j in range(rows.shape[1]):
        x, v, t = rows[Q_E, j], rows[V_E, j], given.tau_ext[j]
        a_e = F[j, 0] * x + F[j, 1] * v + F[j, 2] * t
        o[OUT_Q_E, j], o[OUT_V_E, j] = x, v
        o[OUT_V_R, j], o[OUT_A_R, j] = given.v_d[j] + v, given.a_d[j] + a_e
        add_step(arm, j, given.q_d, x, out.q_r)
        rows[Q_E_BEFORE, j], rows[V_E_BEFORE, j], rows[TAU_EXT, j] = x, v, t
        rows[Q_E, j] = F[j, 3] * x + F[j, 4] * v + F[j, 5] * t
        rows[V_E, j] = F[j, 6] * x + F[j, 7] * v + F[j, 8] * t


@routine
def _feed_forward(
    tables: HardwareTables, space: TickSpace, memory: TickMemory, out: TickOutput
) -> None:
    """Torque of the model and of one more kilogram, and what is learned along the reference."""
    arm, rows, own, a_r = tables.arm, memory.rows, space.rows, out.rows[OUT_A_R]
    n = rows.shape[1]
    rigid_body.inverse_dynamics(tables.load, space.recursions, rows[V], a_r, own[_LOAD])
    for j in range(n):
        own[_SCALED, j] = own[_BIAS, j]
        for i in range(n):
            own[_SCALED, j] += space.M[j, i] * a_r[i]
        own[_LOAD, j] += friction(arm.joints, j, rows[V, j]) - own[_SCALED, j]
    for j in range(n):
        angle = difference(arm, j, tables.neutral, memory.q)
        N, L, lead = tables.joints[PERIODS, j], rows[TORQUE, j], tables.joints[LEAD, j]
        own[_SINE_NOW, j], own[_COSINE_NOW, j] = waves(angle, N, L)
        own[_SINE, j], own[_COSINE, j] = waves(angle + lead * rows[V, j], N, L)
        own[_FRICTION, j] = _friction(tables, own, rows, j, out)
        v = out.rows[OUT_V_R, j] + tables.joints[LEAD, j] * a_r[j]
        before, rise = v - tables.numbers[DT] * a_r[j], tables.numbers[STRIBECK]
        change = released(rows[DISTURBANCE, j], rows[PARAMETERS, j], v, before, rise)
        _shift(rows, j, -change * (tables.numbers[STARTS] < np.inf))


@routine
def _look_ahead(
    tables: HardwareTables, space: TickSpace, tau_ext: Array, memory: TickMemory, out: TickOutput
) -> None:
    """Errors when the torque of this tick begins to act."""
    arm, own, o, rows = tables.arm, space.rows, out.rows, memory.rows
    for i in range(len(memory.q)):
        space.q[i] = memory.q[i]
    for j in range(rows.shape[1]):
        own[_V, j], own[_TORQUE, j] = rows[V, j], rows[TORQUE, j]
    for i in range(len(memory.pending)):
        _move(tables, space, memory.pending[i], tau_ext, rows, space.q, own[_V], own[_TORQUE])
    late = len(memory.pending) * tables.numbers[DT]
    for j in range(rows.shape[1]):
        v_r, a_r = o[OUT_V_R, j], o[OUT_A_R, j]
        ahead = late * v_r + 0.5 * late * late * a_r
        o[OUT_E1, j] = difference(arm, j, space.q, out.q_r) + ahead
        o[OUT_E2, j] = v_r + late * a_r - own[_V, j]


@routine
def _command(
    tables: HardwareTables,
    space: TickSpace,
    ticks: int,
    tau_ext: Array,
    memory: TickMemory,
    out: TickOutput,
) -> bool:
    """The law; False where a limit is exceeded."""
    joints, own, o, rows = tables.joints, space.rows, out.rows, memory.rows
    n = rows.shape[1]
    for j in range(n):
        e1, e2, a_r, omega = o[OUT_E1, j], o[OUT_E2, j], o[OUT_A_R, j], own[_OMEGA, j]
        o[OUT_S, j], o[OUT_U, j], own[_A, j] = commanded(
            e1, e2, a_r, omega, joints[K2, j], tables.numbers[DT]
        )
    for i in range(n):
        tau = own[_BIAS, i] - (tau_ext[i] + rows[DISTURBANCE, i] - own[_FRICTION, i])
        for j in range(n):
            tau += space.M[i, j] * own[_A, j]
        step = joints[TORQUE_STEP, i] if ticks > 0 else np.inf
        if abs(tau) >= joints[EFFORT, i] or abs(tau - rows[TAU, i]) >= step:
            return False
        o[OUT_TAU, i] = tau
    return True


@routine
def _learn(tables: HardwareTables, space: TickSpace, memory: TickMemory, out: TickOutput) -> None:
    """A step of the least squares; what moves into the friction leaves the disturbance."""
    rows, own, normal, numbers = memory.rows, space.rows, space.normal, tables.numbers
    x = REGRESSORS + (LATE - 1) * (TERMS + 1)
    a, b, c = numbers[SCALE_WEIGHT], 0.0, numbers[LOAD_WEIGHT]
    y3, y4 = 0.0, 0.0
    for j in range(rows.shape[1]):
        omega, v = numbers[RATIO] * own[_OMEGA, j], rows[V, j]
        dry = dry_share(v, SMOOTHING, numbers[STRIBECK])
        sine, cosine = own[_SINE_NOW, j], own[_COSINE_NOW, j]
        terms = (dry, v, 1.0, sine, cosine, own[_SCALED, j], own[_LOAD, j], own[_FRICTION, j])
        share = 1.0 - np.exp(-omega * numbers[DT])
        delay_terms(rows[REGRESSORS:Q_E, j], terms, share)
        y, weight = rows[x + TERMS, j] - rows[DISTURBANCE, j], np.tanh(v / SMOOTHING) ** 2
        gather(rows[NORMAL:REGRESSORS, j], rows[x:Q_E, j], y, weight, numbers[FORGOTTEN])
        for i in range(PACKED):
            normal[i, j] = rows[NORMAL + i, j] + tables.joints[EXPECTED + i, j]
        eliminate(normal[:, j])
        a, c = a + normal[at(OWN, OWN), j], c + normal[at(OWN + 1, OWN + 1), j]
        b = b + normal[at(OWN, OWN + 1), j]
        y3, y4 = y3 + normal[at(OWN, TERMS), j], y4 + normal[at(OWN + 1, TERMS), j]
    scale, load = shared(a, b, c, y3, y4)
    for j in range(rows.shape[1]):
        rows[PARAMETERS + OWN, j], rows[PARAMETERS + OWN + 1, j] = scale, load
        substitute(normal[:, j], rows[PARAMETERS:NORMAL, j])
        for i in range(2):
            rows[PARAMETERS + i, j] = max(rows[PARAMETERS + i, j], 0.0)
        after = _friction(tables, own, rows, j, out)
        moved = after - own[_FRICTION, j]
        own[_FRICTION, j] = after
        _shift(rows, j, moved)


@routine
def _predict(
    tables: HardwareTables, space: TickSpace, tau_ext: Array, memory: TickMemory, out: TickOutput
) -> None:
    """What is expected at the next tick."""
    rows, pending, tau = memory.rows, memory.pending, out.rows[OUT_TAU]
    d, n = len(pending), rows.shape[1]
    for j in range(n):
        rows[TAU, j] = tau[j]
        space.rows[_X, j] = pending[0, j] if d > 0 else tau[j]
        for i in range(d):
            pending[i, j] = pending[i + 1, j] if i + 1 < d else tau[j]
    # `_move` uses _A as its own work space
    _move(tables, space, space.rows[_X], tau_ext, rows, memory.q, rows[V], rows[TORQUE])


@routine
def _move(
    tables: HardwareTables,
    space: TickSpace,
    tau: Array,
    tau_ext: Array,
    rows: Array,
    q: Array,
    v: Array,
    torque: Array,
) -> None:
    """Move q, v and the motors' torque on by a period, while tau is what the motors are to give."""
    own, joints, h = space.rows, tables.joints, tables.numbers[DT]
    a = own[_A]
    for j in range(len(v)):
        mean, torque[j] = lagged(torque[j], tau[j], joints[DECAY, j], joints[MEAN, j])
        a[j] = mean + tau_ext[j] - own[_FRICTION, j] + rows[DISTURBANCE, j] - own[_BIAS, j]
    solve(space.factor, a)
    for j in range(len(v)):
        step, v[j] = moved(v[j], a[j], h)
        add_step(tables.arm, j, q, step, q)


@inline
def _shift(rows: Array, j: int, change: float) -> None:
    """Change the disturbance; what is learned from it does not see that."""
    rows[DISTURBANCE, j] += change
    for k in range(LATE):
        rows[REGRESSORS + k * (TERMS + 1) + TERMS, j] += change


@inline
def _friction(tables: HardwareTables, own: Array, rows: Array, j: int, out: TickOutput) -> float:
    """What is learned, at the reference when the torque will act."""
    v = out.rows[OUT_V_R, j] + tables.joints[LEAD, j] * out.rows[OUT_A_R, j]
    dry = dry_share(v, REFERENCE_SMOOTHING, tables.numbers[STRIBECK])
    theta = rows[PARAMETERS:NORMAL, j]
    torque: float = mismatch_torque(
        theta, dry, v, own[_SINE, j], own[_COSINE, j], own[_SCALED, j], own[_LOAD, j]
    )
    return torque
