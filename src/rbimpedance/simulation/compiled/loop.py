"""The closed loop in compiled code, over a block of ticks: tick, log, physics steps.

`_rollout` is all of it as one function; between.py has the parts of the same loop around Pinocchio's algorithms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.np.numpy_support import from_dtype
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import fused, kernel
from ..._numba.layouts.arrays import Borrowed
from ..._numba.layouts.lane_arrays import LaneArray, LaneNumbers
from ..._numba.parts import call_part
from ...control.compiled.block import A_R, TAU
from ...control.compiled.law import LawTables, Scratch, TickInputs
from ...control.compiled.tick import whole_tick
from ...robot.compiled.tables import ArmTables, Workspace
from .environment import Environment
from .log import LogArrays, MetricSums, impedance_error, note, write
from .plant import (
    PlantMotion,
    PlantTables,
    Stages,
    damp,
    euler_step,
    runge_kutta_step,
    undamp,
    update_acceleration,
    update_tau_ext,
)

FINISHED, UNSOUND, DIVERGED = 0, 1, 2
"""How a block of ticks ended: at its end; at inputs that no controller takes; at a joint that left every range."""

SEMI_IMPLICIT, STIFF, RUNGE_KUTTA = 0, 1, 2
"""Semi-implicit Euler; the same with friction taken at the step's end; the classical Runge-Kutta method."""

# Entries of `Clock.ticks`.
FIRST, END, LAST, SUBSTEPS, INTEGRATOR = 0, 1, 2, 3, 4
LAW_PART, LAW_WORDS, MEASURING_PART, MEASURING_WORDS, DRIVES_PART, DRIVES_WORDS = 5, 6, 7, 8, 9, 10

# Entries of `Clock.outcome`.
TICK, JOINT = 0, 1

SENT, LEAVES, ARRIVED = 0, 1, 2
"""When the part of the drives is called: with the torque of a tick, before a physics step, after it."""


class Controlled(NamedTuple):
    """The controller.

    Attributes:
        arm: Its model of the arm.
        law: Its law.
        target: M_d, D_d, K_d; see `journal.impedance_error`.
    """

    arm: ArmTables
    law: LawTables
    target: Array


class Memory(NamedTuple):
    """What is passed from one block of ticks to the next.

    Attributes:
        motion: Of the plant.
        even: Block of the tick before an even one, shape (nv, `output.COLUMNS`).
        odd: Of the one before an odd one.
    """

    motion: PlantMotion
    even: Array
    odd: Array


class LoopWorkspace(NamedTuple):
    """Work space: nothing in it outlives a tick.

    Attributes:
        scratch: Of the tick.
        control: Of the controller's recursions.
        plant: Of the plant's.
        stages: Of the Runge-Kutta method.
        q_d: Reference of the tick, shape (nq,).
        v_d: Its velocity, shape (nv,).
        a_d: Its acceleration, shape (nv,).
        e_im: Impedance error, shape (nv,).
        seen_q: Measured configuration, shape (nq,).
        seen_v: Measured velocity, shape (nv,).
        seen_tau_ext: Measured torque of the environment, shape (nv,).
        rest: Room for zeros, shape (nv,).
        torque_constant: Ratio of true to demanded torque, shape (nv,).
    """

    scratch: Scratch
    control: Workspace
    plant: Workspace
    stages: Stages
    q_d: Array
    v_d: Array
    a_d: Array
    e_im: Array
    seen_q: Array
    seen_v: Array
    seen_tau_ext: Array
    rest: Array
    torque_constant: Array


class ReferenceSamples(NamedTuple):
    """The trajectory, sampled: one row for each tick of the block, or one for all.

    Attributes:
        q: Shape (·, nq).
        v: Shape (·, nv).
        a: Shape (·, nv).
    """

    q: Array
    v: Array
    a: Array


class Clock(NamedTuple):
    """Which ticks to do, and how.

    Attributes:
        ticks: First tick, end of the block, last tick of the run, physics steps in a period, integrator; addresses of
            a part and of its words, 0 where there is none, each for a tick that is not the impedance law's, for
            instruments and for drives; shape (11,).
        step: Length of a physics step [s], and the speed at which a joint has diverged, shape (2,).
        outcome: Tick and joint at which the block ended early, shape (2,).
    """

    ticks: NDArray[np.int64]
    step: Array
    outcome: NDArray[np.int64]


def _rollout(
    controlled: Controlled,
    plant: PlantTables,
    environment: Environment,
    wish: ReferenceSamples,
    memory: Memory,
    desk: LoopWorkspace,
    clock: Clock,
    journal: LogArrays,
    figures: MetricSums,
) -> int:
    """Do the ticks from `FIRST` to before `END`, each with the period after it, which the last one does not have."""
    ticks, motion = clock.ticks, memory.motion
    stages = 3 if ticks[INTEGRATOR] == RUNGE_KUTTA else 1
    rows = stages * ticks[SUBSTEPS]
    for k in range(ticks[FIRST], ticks[END]):
        row = (k - ticks[FIRST]) * rows
        is_even = k % 2 == 0
        state = memory.even if is_even else memory.odd
        block = memory.odd if is_even else memory.even
        take_reference(wish, k - ticks[FIRST], desk)
        update_tau_ext(plant, desk.plant, environment, row, motion.q, motion)
        _measure(desk, motion, clock, k)
        if not _control(controlled, desk, motion, clock, k, state, block):
            clock.outcome[TICK] = k
            return UNSOUND
        for j in range(len(motion.tau)):
            motion.tau[j] *= desk.torque_constant[j]
        _drive(clock, SENT)
        update_acceleration(plant, desk.plant, motion)
        record(controlled, desk, motion, k, block, journal, figures)
        if k == ticks[LAST]:
            break
        for i in range(ticks[SUBSTEPS]):
            physics_step(plant, environment, desk, clock, row + i * stages, i == 0, motion)
            joint = runaway(motion.v, clock.step[1])
            if joint >= 0:
                clock.outcome[TICK], clock.outcome[JOINT] = k, joint
                return DIVERGED
    return FINISHED


@fused
def take_reference(wish: ReferenceSamples, i: int, desk: LoopWorkspace) -> None:
    """Write the reference of the i-th tick of a block to the desk."""
    i = min(i, len(wish.q) - 1)
    for j in range(len(desk.q_d)):
        desk.q_d[j] = wish.q[i, j]
    for j in range(len(desk.v_d)):
        desk.v_d[j], desk.a_d[j] = wish.v[i, j], wish.a[i, j]


@fused
def _measure(desk: LoopWorkspace, motion: PlantMotion, clock: Clock, k: int) -> None:
    """Write what the controller is given to the desk."""
    if clock.ticks[MEASURING_PART] != 0:
        call_part(clock.ticks[MEASURING_PART], clock.ticks[MEASURING_WORDS], k)
        return
    for i in range(len(motion.q)):
        desk.seen_q[i] = motion.q[i]
    for j in range(len(motion.v)):
        desk.seen_v[j], desk.seen_tau_ext[j] = motion.v[j], motion.tau_ext[j]


@fused
def _drive(clock: Clock, when: int) -> bool:
    """Let the drives do their part; whether there are any."""
    if clock.ticks[DRIVES_PART] == 0:
        return False
    call_part(clock.ticks[DRIVES_PART], clock.ticks[DRIVES_WORDS], when)
    return True


@fused
def _control(
    controlled: Controlled,
    desk: LoopWorkspace,
    motion: PlantMotion,
    clock: Clock,
    k: int,
    state: Array,
    block: Array,
) -> bool:
    """Do a tick of the controller, and hand its torque to the plant; False for inputs that are not sound."""
    if clock.ticks[LAW_PART] != 0:
        return call_part(clock.ticks[LAW_PART], clock.ticks[LAW_WORDS], k) != 0  # type: ignore[no-any-return]
    given = TickInputs(desk.seen_q, desk.seen_v, desk.q_d, desk.v_d, desk.a_d, desk.seen_tau_ext)
    arm, law, space, work = controlled.arm, controlled.law, desk.control, desk.scratch
    if not whole_tick(arm, law, space, work, state, given, block):
        return False
    for j in range(len(motion.tau)):
        motion.tau[j] = block[j, TAU]
    return True


@fused
def record(
    controlled: Controlled,
    desk: LoopWorkspace,
    motion: PlantMotion,
    k: int,
    block: Array,
    journal: LogArrays,
    figures: MetricSums,
) -> None:
    """Write a tick to the journal and the figures of merit."""
    update_impedance_error(controlled, desk, motion, block)
    if k % journal.every[0] == 0:
        write(journal, controlled.arm, k // journal.every[0], motion, block, desk.e_im)
    if len(figures.table):
        note(figures, k, block, desk.e_im)


@fused
def update_impedance_error(
    controlled: Controlled, desk: LoopWorkspace, motion: PlantMotion, block: Array
) -> None:
    """Write the impedance error of a tick to the desk."""
    e3 = desk.v_d  # the reference's buffer is reused
    for j in range(len(e3)):
        e3[j] = block[j, A_R] - motion.a[j]
    impedance_error(controlled.target, block, e3, desk.e_im)


@fused
def physics_step(
    plant: PlantTables,
    environment: Environment,
    desk: LoopWorkspace,
    clock: Clock,
    row: int,
    is_first: bool,
    motion: PlantMotion,
) -> None:
    """One step of the plant; the acceleration at the first one of a period is known from the tick."""
    if clock.ticks[INTEGRATOR] != RUNGE_KUTTA:
        acts_anew = _drive(clock, LEAVES) or not is_first
        semi_implicit_step(plant, environment, desk, clock, row, not acts_anew, motion)
        _drive(clock, ARRIVED)
        return
    if not is_first:
        update_tau_ext(plant, desk.plant, environment, row, motion.q, motion)
        update_acceleration(plant, desk.plant, motion)
    runge_kutta_step(plant, desk.plant, environment, desk.stages, row, motion, clock.step[0])


@fused
def semi_implicit_step(
    plant: PlantTables,
    environment: Environment,
    desk: LoopWorkspace,
    clock: Clock,
    row: int,
    is_first: bool,
    motion: PlantMotion,
) -> None:
    """One step of semi-implicit Euler, which may take friction at the step's end; see `physics_step`."""
    h = clock.step[0]
    if not is_first:
        update_tau_ext(plant, desk.plant, environment, row, motion.q, motion)
    if clock.ticks[INTEGRATOR] == STIFF:
        damp(plant, motion.v, h)
        update_acceleration(plant, desk.plant, motion)
        undamp(plant)
    elif not is_first:
        update_acceleration(plant, desk.plant, motion)
    euler_step(plant, motion, h)


@fused
def runaway(v: Array, bound: float) -> int:
    """The joint that is fastest, where one is beyond the bound, or the first that is NaN; else -1."""
    fastest, joint = bound, -1
    for j in range(len(v)):
        speed = abs(v[j])
        if not speed < fastest:
            fastest, joint = speed, j
            if speed != speed:
                return j
    return joint


def own_type(value: Any) -> types.Type:
    """Return the type of an array that the package itself has made, or of a named tuple of such."""
    if isinstance(value, LaneNumbers):
        return LaneArray(value.ndim - 1)
    if isinstance(value, np.ndarray):
        return Borrowed(from_dtype(value.dtype), value.ndim, trusted=True)
    if type(value) is tuple:  # of arrays of one kind
        return types.UniTuple(own_type(value[0]), len(value))
    return types.NamedTuple([own_type(part) for part in value], type(value))


class CompiledOnce:
    """A function that is compiled at its first call, for the types of its arguments, or loaded from the disk.

    It runs without the interpreter's lock.

    Attributes:
        kernel: The compiled function; None before the first call.
    """

    def __init__(self, function: Callable[..., int]) -> None:
        self._function = function
        self.kernel: Callable[..., int] | None = None

    def __call__(self, *arguments: Any) -> int:
        """Run the function; the types of the arguments are those of the first call."""
        if self.kernel is None:
            kinds = tuple(own_type(argument) for argument in arguments)
            self.kernel = kernel(self._function, kinds, nogil=True)
        return self.kernel(*arguments)


rollout = CompiledOnce(_rollout)
