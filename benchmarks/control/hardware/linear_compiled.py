"""Runs of the laws of `linear_laws` by compiled code: what `simulate` computes, forty times faster.

Compiled pieces of the library make the plant's steps and the model's dynamics. A test compares runs with `simulate`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import Array
from rbimpedance._numba.compile import inline, routine
from rbimpedance.control.compiled.hardware_tick import correction, lagged, moved
from rbimpedance.control.compiled.manifold import add_step, difference, factorize, solve
from rbimpedance.control.pid import pid_gains
from rbimpedance.interaction import as_interaction
from rbimpedance.law.lag import lag_of
from rbimpedance.robot.compiled import rigid_body
from rbimpedance.robot.compiled.dynamics import CompiledDynamics
from rbimpedance.robot.compiled.rigid_body import place_joints
from rbimpedance.robot.compiled.tables import ArmTables, Workspace, workspace
from rbimpedance.simulation.compiled import driven
from rbimpedance.simulation.compiled.driven import DriveMemory, DriveSpace, DriveTables
from rbimpedance.simulation.compiled.environment import Environment, EnvironmentTables
from rbimpedance.simulation.compiled.loop import CompiledOnce, ReferenceSamples, runaway
from rbimpedance.simulation.driven_runs import _rows
from rbimpedance.simulation.plants.compiled_drives import drive_tables
from rbimpedance.simulation.sampling import sample, tick_times

from .cases import LENGTH, PUSH, Case
from .linear_laws import DISTURBANCE, DT, INTEGRAL, OBSERVED, PD, TARGET, Law, Settings

SUBSTEPS = 4

# Entries of `LinearLaw.numbers`.
_OMEGA, _SMOOTH, _OBSERVER, _KP, _KD, _KI, _KIND = range(7)

# Rows of `LinearMemory.rows`: filter, integral, speed and motor torque of the tick before, momentum observer, ESO.
_Q_E, _V_E, _INTEGRAL, _V, _TAU, _R, _BIAS_BEFORE, _EST_V, _EST_D, _EST_TORQUE = range(10)

# Rows of `LinearSpace.rows`.
_BIAS, _ZERO, _A, _E1, _E2, _A_R, _V_SEEN, _L, _DA, _X = range(10)


class LinearLaw(NamedTuple):
    """A law as tables: its model, its numbers, the impedance filter, and the lag of the motors by row."""

    arm: ArmTables
    numbers: Array
    filter: Array
    lag: Array


class LinearMemory(NamedTuple):
    """State: configuration of the tick before, expected configuration, rows, mass matrix, torques on their way."""

    q: Array
    expected: Array
    rows: Array
    M: Array
    pending: Array


class LinearSpace(NamedTuple):
    """Work space."""

    recursions: Workspace
    M: Array
    factor: Array
    rows: Array
    q: Array
    q_r: Array


class LinearLog(NamedTuple):
    """What is logged."""

    q: Array
    q_r: Array
    tau: Array


class LinearRuns:
    """Runs of linear laws on the heaviest plant of a case, from its neutral configuration at rest.

    Args:
        case: The arm.
        hardware: Its drives and encoders.
        length: Of the runs [s].
    """

    def __init__(self, case: Case, hardware: rbi.Hardware, length: float = LENGTH) -> None:
        self.model, self.hardware = case.model(), hardware
        self._known = CompiledDynamics(self.model).tables
        self.engine = rbi.DrivenPlant.for_(hardware, case.plant(), DT)
        self._plant = drive_tables(self.engine, DT / SUBSTEPS, hardware.count(self.model))
        block = range(round(length / DT) + 1)
        self.t = tick_times(block, DT)
        wish = sample(self.model, case.motion(), self.t)
        self._wish = ReferenceSamples(*_rows(wish, len(block)))
        self._environment = EnvironmentTables(as_interaction(PUSH), self.engine.arm)
        steps = (np.array(block)[:, None] * DT + np.arange(SUBSTEPS) * (DT / SUBSTEPS)).ravel()
        self._drive = self._environment.sampled(steps)

    def run(self, law: Law, settings: Settings) -> LinearLog:
        """Return what a law leaves behind; rows after a divergence are NaN.

        Args:
            law: The law.
            settings: Of it.
        """
        arm = self.engine.arm
        q0, nq, nv = np.array(arm.neutral), arm.nq, arm.nv
        started = self.engine.begin(q0, np.zeros(nv), DT / SUBSTEPS)
        pending = np.zeros((self.hardware.delay, nv))
        log = LinearLog(*(np.full((len(self.t), n), np.nan) for n in (nq, nq, nv)))
        arguments = (
            self._tables(law, settings),
            self._plant,
            self._environment.driven(self._drive),
            self._wish,
            LinearMemory(q0.copy(), q0.copy(), np.zeros((10, nv)), np.zeros((nv, nv)), pending),
            _space(nq, nv),
            DriveMemory(q0, np.zeros(nv), np.array(started.torque), np.array(started.pending)),
            driven.drive_space(nq, nv),
            log,
        )
        _compiled(*arguments)
        return log

    def _tables(self, law: Law, settings: Settings) -> LinearLaw:
        omega, second, *more = settings
        gains = pid_gains(np.array(omega), DT)
        numbers = np.array([omega, -np.expm1(-second * DT), second, *gains, law.kind])
        if law.kind == DISTURBANCE:
            numbers[_OBSERVER] = -np.expm1(-more[0] * DT)
        nv = self.model.nv
        maps = TARGET.filter(nv, DT).maps().reshape(3, nv, 3, nv)
        diagonal = np.ascontiguousarray(np.einsum("ijkj->jik", maps).reshape(nv, 9))
        lag = np.array(lag_of(self.hardware.lag(self.model), DT))
        return LinearLaw(self._known, numbers, diagonal, lag)


def _space(nq: int, nv: int) -> LinearSpace:
    (M, factor), (q, q_r) = np.zeros((2, nv, nv)), np.zeros((2, nq))
    return LinearSpace(workspace(nv), M, factor, np.zeros((10, nv)), q, q_r)


def _run(
    law: LinearLaw,
    plant: DriveTables,
    environment: Environment,
    wish: ReferenceSamples,
    memory: LinearMemory,
    space: LinearSpace,
    moving: DriveMemory,
    drives: DriveSpace,
    log: LinearLog,
) -> int:
    for k in range(len(log.tau)):
        for n in range(SUBSTEPS):
            driven._environment(plant, drives, environment, k * SUBSTEPS + n, moving)
            if n == 0:
                _tick(law, plant, wish, memory, space, moving, drives, k)
                for i in range(len(moving.q)):
                    log.q[k, i], log.q_r[k, i] = moving.q[i], space.q_r[i]
                for j in range(len(moving.v)):
                    log.tau[k, j] = memory.rows[_TAU, j]
            driven._dynamics(plant, drives, moving)
            driven._step(plant, drives, memory.rows[_TAU], moving)
            if runaway(moving.v, plant.numbers[driven.SPEED_BOUND]) >= 0:
                return k
    return 0


@routine
def _tick(
    law: LinearLaw,
    plant: DriveTables,
    wish: ReferenceSamples,
    memory: LinearMemory,
    space: LinearSpace,
    moving: DriveMemory,
    drives: DriveSpace,
    k: int,
) -> None:
    rows, own, n = memory.rows, space.rows, len(moving.v)
    for j in range(n):
        turned = difference(plant.arm, j, plant.neutral, moving.q)
        count = plant.resolution[j]
        add_step(law.arm, j, plant.neutral, round(turned / count) * count, space.q)
    if law.numbers[_KIND] == OBSERVED:
        _observe(law, memory, space, drives.tau_ext, k)
    else:
        _differentiate(law, memory, space, k)
    late = len(memory.pending) * DT if law.numbers[_KIND] == OBSERVED else 0.0
    for j in range(n):
        F, x, v, t = law.filter, rows[_Q_E, j], rows[_V_E, j], drives.tau_ext[j]
        add_step(law.arm, j, wish.q[k], x, space.q_r)
        v_d, a_d = wish.v[k, j], wish.a[k, j]
        ahead = late * v_d + 0.5 * late * late * a_d
        own[_E1, j] = difference(law.arm, j, space.q, space.q_r) + ahead
        own[_E2, j] = v_d + late * a_d + v - own[_V_SEEN, j]
        own[_A_R, j] = a_d + F[j, 0] * x + F[j, 1] * v + F[j, 2] * t
        rows[_Q_E, j] = F[j, 3] * x + F[j, 4] * v + F[j, 5] * t
        rows[_V_E, j] = F[j, 6] * x + F[j, 7] * v + F[j, 8] * t
    _command(law, memory, space, drives.tau_ext, k)
    if law.numbers[_KIND] == OBSERVED:
        _predict(law, memory, space, drives.tau_ext)


@routine
def _differentiate(law: LinearLaw, memory: LinearMemory, space: LinearSpace, k: int) -> None:
    """Speed by differences behind a low-pass."""
    v = memory.rows[_V]
    for j in range(len(v)):
        raw = difference(law.arm, j, memory.q, space.q) / DT if k > 0 else 0.0
        space.rows[_V_SEEN, j] = v[j] + law.numbers[_SMOOTH] * (raw - v[j]) if k > 0 else raw
    for i in range(len(space.q)):
        memory.q[i] = space.q[i]


@routine
def _dynamics(law: LinearLaw, space: LinearSpace, q: Array, v: Array) -> None:
    """M and bias of the model."""
    own = space.rows
    for j in range(len(v)):
        own[_ZERO, j] = 0.0
    place_joints(law.arm, space.recursions, q)
    rigid_body.mass_matrix(law.arm, space.recursions, space.M)
    rigid_body.inverse_dynamics(law.arm, space.recursions, v, own[_ZERO], own[_BIAS])


@routine
def _command(
    law: LinearLaw, memory: LinearMemory, space: LinearSpace, tau_ext: Array, k: int
) -> None:
    rows, own, numbers, n = memory.rows, space.rows, law.numbers, len(tau_ext)
    omega = numbers[_OMEGA]
    if law.numbers[_KIND] == PD:
        for j in range(n):
            own[_X, j] = 0.0
        _dynamics(law, space, space.q, own[_X])
        factorize(space.M, space.factor)
    else:
        _dynamics(law, space, space.q, own[_V_SEEN])
    if law.numbers[_KIND] == DISTURBANCE:
        _momentum(law, memory, space, tau_ext, k)
    for j in range(n):
        e1, e2 = own[_E1, j], own[_E2, j]
        u = omega * omega * e1 + 2.0 * omega * e2
        if law.numbers[_KIND] == INTEGRAL or law.numbers[_KIND] == OBSERVED:
            u = numbers[_KP] * e1 + numbers[_KD] * e2 + numbers[_KI] * rows[_INTEGRAL, j]
            rows[_INTEGRAL, j] += DT * e1
        own[_A, j] = own[_A_R, j] + u if law.numbers[_KIND] != PD else u
    for i in range(n):
        tau = own[_BIAS, i] - tau_ext[i]
        if law.numbers[_KIND] == PD:
            tau += _effective_inertia(space, i) * own[_A, i]
        else:
            for j in range(n):
                tau += space.M[i, j] * own[_A, j]
        rows[_TAU, i] = tau - (rows[_R, i] if law.numbers[_KIND] == DISTURBANCE else 0.0)
        rows[_V, i] = own[_V_SEEN, i]


@inline
def _effective_inertia(space: LinearSpace, i: int) -> float:
    column = space.rows[_X]
    for j in range(len(column)):
        column[j] = 1.0 if i == j else 0.0
    solve(space.factor, column)
    inertia: float = 1.0 / column[i]
    return inertia


@routine
def _momentum(
    law: LinearLaw, memory: LinearMemory, space: LinearSpace, tau_ext: Array, k: int
) -> None:
    """A step of the `MomentumObserver`, whose torque is that of the tick before with tau_ext of this one."""
    rows, own, n = memory.rows, space.rows, len(tau_ext)
    for i in range(n):
        w = (own[_BIAS, i] + rows[_BIAS_BEFORE, i]) / 2.0 - (rows[_TAU, i] + tau_ext[i])
        for j in range(n):
            w += (space.M[i, j] + memory.M[i, j]) * (own[_V_SEEN, j] - rows[_V, j]) / (2.0 * DT)
        if k > 0:
            rows[_R, i] += law.numbers[_OBSERVER] * (w - rows[_R, i])
    for i in range(n):
        rows[_BIAS_BEFORE, i] = own[_BIAS, i]
        for j in range(n):
            memory.M[i, j] = space.M[i, j]


@routine
def _observe(
    law: LinearLaw, memory: LinearMemory, space: LinearSpace, tau_ext: Array, k: int
) -> None:
    """Correct the extended-state observer, and look `delay` ticks ahead."""
    rows, own, n = memory.rows, space.rows, len(tau_ext)
    if k == 0:
        _held(law, memory, space)
    for j in range(n):
        nu = difference(law.arm, j, memory.expected, space.q)
        step, dv, own[_DA, j] = correction(nu, law.numbers[_OBSERVER], DT)
        add_step(law.arm, j, memory.expected, step, memory.expected)
        rows[_EST_V, j] += dv
    _dynamics(law, space, memory.expected, rows[_EST_V])
    factorize(space.M, space.factor)
    for i in range(n):
        for j in range(n):
            rows[_EST_D, i] += space.M[i, j] * own[_DA, j]
        rows[_BIAS_BEFORE, i] = own[_BIAS, i]
    for i in range(len(space.q)):
        space.q[i] = memory.expected[i]
    for j in range(n):
        own[_V_SEEN, j], own[_L, j] = rows[_EST_V, j], rows[_EST_TORQUE, j]
    for i in range(len(memory.pending)):
        _move(law, memory, space, memory.pending[i], tau_ext, space.q, own[_V_SEEN], own[_L])


@routine
def _held(law: LinearLaw, memory: LinearMemory, space: LinearSpace) -> None:
    """The observer's first tick: at rest where the encoders say, held by the motors."""
    for i in range(len(space.q)):
        memory.expected[i] = space.q[i]
    _dynamics(law, space, memory.expected, memory.rows[_EST_V])
    for j in range(len(space.M)):
        memory.rows[_EST_TORQUE, j] = space.rows[_BIAS, j]
        for i in range(len(memory.pending)):
            memory.pending[i, j] = space.rows[_BIAS, j]


@routine
def _predict(law: LinearLaw, memory: LinearMemory, space: LinearSpace, tau_ext: Array) -> None:
    rows, pending, sent = memory.rows, memory.pending, space.rows[_X]
    for j in range(len(tau_ext)):
        sent[j] = pending[0, j] if len(pending) else rows[_TAU, j]
        for i in range(len(pending)):
            pending[i, j] = pending[i + 1, j] if i + 1 < len(pending) else rows[_TAU, j]
    _move(law, memory, space, sent, tau_ext, memory.expected, rows[_EST_V], rows[_EST_TORQUE])


@routine
def _move(
    law: LinearLaw,
    memory: LinearMemory,
    space: LinearSpace,
    tau: Array,
    tau_ext: Array,
    q: Array,
    v: Array,
    torque: Array,
) -> None:
    rows, a = memory.rows, space.rows[_A]
    for j in range(len(v)):
        mean, torque[j] = lagged(torque[j], tau[j], law.lag[0, j], law.lag[1, j])
        a[j] = mean + tau_ext[j] + rows[_EST_D, j] - rows[_BIAS_BEFORE, j]
    solve(space.factor, a)
    for j in range(len(v)):
        step, v[j] = moved(v[j], a[j], DT)
        add_step(law.arm, j, q, step, q)


_compiled = CompiledOnce(_run)
