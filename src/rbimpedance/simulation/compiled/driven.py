"""An arm behind drives in compiled code: its steps, and the whole loop with a `HardwareController` behind encoders.

`DrivenPlant` and `closed_loop.run` specify what they compute.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import inline, kernel, routine
from ..._numba.formulas import helper
from ..._numba.layouts.tables import Held
from ..._numba.layouts.tables import opened as opened_words
from ...control.compiled.hardware_tables import (
    OUT_A_R,
    OUT_E1,
    OUT_E2,
    OUT_TAU,
    HardwareTables,
    TickMemory,
    TickOutput,
    TickSpace,
)
from ...control.compiled.hardware_tick import hardware_tick, lagged
from ...control.compiled.law import TickInputs
from ...control.compiled.manifold import add_step, difference, factorize, solve
from ...control.compiled.tick import is_sound
from ...law import impedance
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import ARM, OWN_MATRIX, OWN_VECTOR, SPACE, VECTOR_IN
from ...robot.compiled.rigid_body import place_joints
from ...robot.compiled.tables import ArmTables, Workspace, workspace
from ..plants import dry_friction
from .environment import Environment, environment_torque
from .log import COLUMN_OF
from .loop import CompiledOnce, ReferenceSamples, runaway
from .plant import integrate

impedance_error = helper(impedance.impedance_error)
rub = helper(dry_friction.rub)
sliding_friction = helper(dry_friction.sliding_friction)

# Rows of `DriveTables.joints`.
DECAY, MEAN, RIPPLE, COGGING, PERIODS, COULOMB, VISCOUS = range(7)

# Entries of `DriveTables.numbers`.
H, STRIBECK, SPEED_BOUND = range(3)

# Entries of `DrivenClock.ticks`, and of its outcome.
FIRST, END, LAST, SUBSTEPS = range(4)
TICK, JOINT = range(2)

FINISHED, REFUSED, DIVERGED = 0, 1, 2
"""How a block of ticks ended: at its end, at a tick that is refused, at a joint that left every range."""

_BIAS, _ZERO, _DRY, _VISCOUS, _P, _TORQUE, _V, _A = range(8)


class DriveTables(NamedTuple):
    """The simulated arm and its drives; its dynamics have no friction.

    Attributes:
        arm: The links, with the rotors as armature.
        joints: What there is of every joint, shape (7, nv).
        neutral: Configuration from which ripple and counts go, shape (nq,).
        resolution: A count of the encoders, 0 where they are exact, shape (nv,).
        target: Diagonals of M_d, D_d and K_d, shape (3, nv).
        numbers: Physics step, rise of friction at rest, speed at which a joint has diverged, shape (3,).
    """

    arm: ArmTables
    joints: Array
    neutral: Array
    resolution: Array
    target: Array
    numbers: Array


class DriveMemory(NamedTuple):
    """Where the plant is.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        torque: Of the motors, shape (nv,).
        pending: Torques on their way, one for each step of the dead time, shape (·, nv).
    """

    q: Array
    v: Array
    torque: Array
    pending: Array


class DriveSpace(NamedTuple):
    """Work space: nothing in it outlives a step."""

    recursions: Workspace
    M: Array
    factor: Array
    inverse: Array
    rows: Array
    q: Array
    tau_ext: Array


class DrivenLog(NamedTuple):
    """Channels of `SimulationResult`; `outputs` are rows of a tick's output, in the order of `COLUMN_OF`."""

    q: Array
    v: Array
    q_r: Array
    e_im: Array
    tau_ext: Array
    outputs: tuple[Array, ...]
    row_of: NDArray[np.int64]


class DrivenClock(NamedTuple):
    """Which ticks to do, and where they ended early."""

    ticks: NDArray[np.int64]
    outcome: NDArray[np.int64]


def driven_log(channels: Mapping[str, Array]) -> DrivenLog:
    """Return a log that writes to the given arrays, (samples, nq or nv) by name of the channel."""
    q, v, q_r, e_im, tau_ext = (channels[name] for name in ("q", "v", "q_r", "e_im", "tau_ext"))
    outputs = tuple(channels[name] for name in COLUMN_OF)
    return DrivenLog(q, v, q_r, e_im, tau_ext, outputs, np.array(list(COLUMN_OF.values())))


def drive_space(nq: int, nv: int) -> DriveSpace:
    """Return work space for arms of this size."""
    M, factor, inverse = np.zeros((3, nv, nv))
    return DriveSpace(
        workspace(nv), M, factor, inverse, np.zeros((8, nv)), np.zeros(nq), np.zeros(nv)
    )


class DriveWords(NamedTuple):
    """What a step from outside reads and writes besides its arguments."""

    plant: DriveTables
    space: DriveSpace


_PLANT = types.NamedTuple((ARM, OWN_MATRIX, *[OWN_VECTOR] * 2, OWN_MATRIX, OWN_VECTOR), DriveTables)
_SPACE = types.NamedTuple((SPACE, *[OWN_MATRIX] * 4, OWN_VECTOR, OWN_VECTOR), DriveSpace)
_WORDS = Held(types.NamedTuple((_PLANT, _SPACE), DriveWords))


@functools.cache
def step_kernel() -> Callable[..., Any]:
    """Compile a step of the plant, or load it from the disk."""
    moving = (*[OWN_VECTOR] * 3, OWN_MATRIX)
    return kernel(_step_entry, (_WORDS, VECTOR_IN, VECTOR_IN, *moving))


def _step_entry(
    words: Any, tau: Array, tau_ext: Array, q: Array, v: Array, torque: Array, pending: Array
) -> int:
    plant, space = opened_words(words)
    moving = DriveMemory(q, v, torque, pending)
    for j in range(len(v)):
        space.tau_ext[j] = tau_ext[j]
    place_joints(plant.arm, space.recursions, q)
    _dynamics(plant, space, moving)
    _step(plant, space, tau, moving)
    return 0


def _run(
    controlled: HardwareTables,
    plant: DriveTables,
    environment: Environment,
    wish: ReferenceSamples,
    memory: TickMemory,
    moving: DriveMemory,
    desk: TickSpace,
    space: DriveSpace,
    out: TickOutput,
    log: DrivenLog,
    clock: DrivenClock,
) -> int:
    """Do the ticks from `FIRST` to before `END`, each with the period after it, which the last one does not have."""
    ticks, substeps = clock.ticks, clock.ticks[SUBSTEPS]
    for k in range(ticks[FIRST], ticks[END]):
        i = k - ticks[FIRST]
        _environment(plant, space, environment, i * substeps, moving)
        _count(plant, moving, space)
        given = TickInputs(space.q, moving.v, wish.q[i], wish.v[i], wish.a[i], space.tau_ext)
        sound = is_sound(controlled.arm, given)
        if not (sound and hardware_tick(controlled, desk, k, given, memory, out)):
            clock.outcome[TICK] = k
            return REFUSED
        tau = out.rows[OUT_TAU]
        _write(plant, space, moving, out, log, k)
        if k == ticks[LAST]:
            return FINISHED
        for n in range(substeps):
            if n > 0:
                _environment(plant, space, environment, i * substeps + n, moving)
                _dynamics(plant, space, moving)  # at a tick `_write` has done it
            _step(plant, space, tau, moving)
            joint = runaway(moving.v, plant.numbers[SPEED_BOUND])
            if joint >= 0:
                clock.outcome[TICK], clock.outcome[JOINT] = k, joint
                return DIVERGED
    return FINISHED


@routine
def _count(plant: DriveTables, moving: DriveMemory, space: DriveSpace) -> None:
    """Write the configuration that the encoders count."""
    for j in range(len(moving.v)):
        count, turned = plant.resolution[j], difference(plant.arm, j, plant.neutral, moving.q)
        if count > 0.0:
            turned = round(turned / count) * count
        add_step(plant.arm, j, plant.neutral, turned, space.q)


@routine
def _environment(
    plant: DriveTables, space: DriveSpace, environment: Environment, row: int, moving: DriveMemory
) -> None:
    place_joints(plant.arm, space.recursions, moving.q)
    environment_torque(plant.arm, space.recursions, environment, row, moving.v, space.tau_ext)


@routine
def _dynamics(plant: DriveTables, space: DriveSpace, moving: DriveMemory) -> None:
    """Bias and the factor of the mass matrix, after the joints have been placed."""
    rows = space.rows
    for j in range(len(moving.v)):
        rows[_ZERO, j] = 0.0
    rigid_body.mass_matrix(plant.arm, space.recursions, space.M)
    rigid_body.inverse_dynamics(plant.arm, space.recursions, moving.v, rows[_ZERO], rows[_BIAS])
    factorize(space.M, space.factor)


@inline
def _rippled(plant: DriveTables, j: int, q: Array, torque: float) -> float:
    joints = plant.joints
    if joints[RIPPLE, j] == 0.0 and joints[COGGING, j] == 0.0:
        return torque
    wave = np.sin(joints[PERIODS, j] * difference(plant.arm, j, plant.neutral, q))
    rippled: float = torque + (torque * joints[RIPPLE, j] + joints[COGGING, j]) * wave
    return rippled


@routine
def _step(plant: DriveTables, space: DriveSpace, tau: Array, moving: DriveMemory) -> None:
    """One physics step after `_dynamics`; see `DrivenPlant.step` and `StickingPlant.step`."""
    joints, rows, h = plant.joints, space.rows, plant.numbers[H]
    pending, n = moving.pending, len(moving.v)
    for j in range(n):
        sent = pending[0, j] if len(pending) else tau[j]
        mean, moving.torque[j] = lagged(moving.torque[j], sent, joints[DECAY, j], joints[MEAN, j])
        rows[_A, j] = _rippled(plant, j, moving.q, mean) + space.tau_ext[j] - rows[_BIAS, j]
        rows[_DRY, j], rows[_VISCOUS, j] = h * joints[COULOMB, j], h * joints[VISCOUS, j]
        for i in range(len(pending)):
            pending[i, j] = pending[i + 1, j] if i + 1 < len(pending) else tau[j]
    solve(space.factor, rows[_A])
    for j in range(n):
        moving.v[j] += h * rows[_A, j]
    _invert(space.factor, space.inverse)
    rub(
        moving.v,
        space.inverse,
        rows[_DRY],
        rows[_VISCOUS],
        rows[_P],
        plant.numbers[STRIBECK],
        dry_friction.ROUNDS,
    )
    integrate(plant.arm, moving.q, h, moving.v, moving.q)


@inline
def _invert(L: Array, inverse: Array) -> None:
    """Write M⁻¹, row by row, which is column by column."""
    for i in range(len(L)):
        row = inverse[i]
        for j in range(len(L)):
            row[j] = 1.0 if i == j else 0.0
        solve(L, row)


@routine
def _write(
    plant: DriveTables,
    space: DriveSpace,
    moving: DriveMemory,
    out: TickOutput,
    log: DrivenLog,
    k: int,
) -> None:
    """Write a tick to the log, after the environment's torque."""
    o, rows, joints, target = out.rows, space.rows, plant.joints, plant.target
    for i in range(len(moving.q)):
        log.q[k, i], log.q_r[k, i] = moving.q[i], out.q_r[i]
    _dynamics(plant, space, moving)
    for j in range(len(moving.v)):
        sent = moving.pending[0, j] if len(moving.pending) else o[OUT_TAU, j]
        now = moving.torque[j] if joints[DECAY, j] > 0.0 else sent
        v = moving.v[j]
        slides = sliding_friction(joints[COULOMB, j], joints[VISCOUS, j], v)
        rows[_A, j] = _rippled(plant, j, moving.q, now) + space.tau_ext[j] - rows[_BIAS, j] - slides
    solve(space.factor, rows[_A])
    for j in range(len(moving.v)):
        log.v[k, j], log.tau_ext[k, j] = moving.v[j], space.tau_ext[j]
        e1, e2, e3 = o[OUT_E1, j], o[OUT_E2, j], o[OUT_A_R, j] - rows[_A, j]
        log.e_im[k, j] = impedance_error(target[0, j], target[1, j], target[2, j], e1, e2, e3)
    for c in range(len(log.outputs)):
        for j in range(len(moving.v)):
            log.outputs[c][k, j] = o[log.row_of[c], j]


driven_rollout = CompiledOnce(_run)
