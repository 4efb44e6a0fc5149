"""The closed loop of `loop` with what `ImperfectController` puts around the law: noise, delay, torque constants."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import fused
from ...control.compiled.block import TAU
from ...control.compiled.law import TickInputs, add_angle
from ...control.compiled.tick import whole_tick
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .environment import Environment
from .log import LogArrays, MetricSums
from .loop import (
    DIVERGED,
    END,
    FINISHED,
    FIRST,
    INTEGRATOR,
    JOINT,
    LAST,
    RUNGE_KUTTA,
    SUBSTEPS,
    TICK,
    UNSOUND,
    Clock,
    CompiledOnce,
    Controlled,
    LoopWorkspace,
    Memory,
    ReferenceSamples,
    physics_step,
    record,
    runaway,
    take_reference,
)
from .plant import PlantMotion, PlantTables, update_acceleration, update_tau_ext


class Imperfections(NamedTuple):
    """What is between the law and the plant.

    Attributes:
        on_q: Noise of every tick of the block, or one row for all, shape (·, nv) [rad or m].
        on_v: The same on v [rad/s or m/s].
        torque_constant: Ratio of true to demanded torque, shape (nv,).
        delay: Ticks from a measurement to its torque, shape (1,).
    """

    on_q: Array
    on_v: Array
    torque_constant: Array
    delay: NDArray[np.int64]


class Measurements(NamedTuple):
    """The last `delay` + 1 measurements, each in the row of its tick modulo their number; and the one that arrives.

    Attributes:
        on_way_q: Shape (delay + 1, nq).
        on_way_v: Shape (delay + 1, nv).
        on_way_tau_ext: Shape (delay + 1, nv).
        q: Shape (nq,).
        v: Shape (nv,).
        tau_ext: Shape (nv,).
    """

    on_way_q: Array
    on_way_v: Array
    on_way_tau_ext: Array
    q: Array
    v: Array
    tau_ext: Array


def measurements(delay: int, nq: int, nv: int) -> Measurements:
    """Return memory for the measurements of arms of this size."""
    rows = delay + 1
    on_way = np.zeros((rows, nq)), np.zeros((rows, nv)), np.zeros((rows, nv))
    return Measurements(*on_way, np.zeros(nq), np.zeros(nv), np.zeros(nv))


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
    imperfect: Imperfections,
    seen: Measurements,
) -> int:
    """Do the ticks from `FIRST` to before `END`; see `loop._rollout`."""
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
        _measure(plant.arm, imperfect, motion, k, k - ticks[FIRST], seen)
        given = TickInputs(seen.q, seen.v, desk.q_d, desk.v_d, desk.a_d, seen.tau_ext)
        arm, law, work = controlled.arm, controlled.law, desk.scratch
        if not whole_tick(arm, law, desk.control, work, state, given, block):
            clock.outcome[TICK] = k
            return UNSOUND
        for j in range(len(motion.tau)):
            motion.tau[j] = imperfect.torque_constant[j] * block[j, TAU]
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
def _measure(
    arm: ArmTables,
    imperfect: Imperfections,
    motion: PlantMotion,
    k: int,
    i: int,
    seen: Measurements,
) -> None:
    """Measure at tick k, the i-th of its block, and write the measurement that the law sees now."""
    rows, noise = imperfect.delay[0] + 1, min(i, len(imperfect.on_q) - 1)
    for j in range(len(motion.v)):
        at = arm.topology[j, Q_INDEX]
        if arm.topology[j, KIND] == CONTINUOUS:
            cos, sin = motion.q[at], motion.q[at + 1]
            seen.q[at], seen.q[at + 1] = add_angle(cos, sin, imperfect.on_q[noise, j])
        else:
            seen.q[at] = motion.q[at] + imperfect.on_q[noise, j]
        seen.v[j] = motion.v[j] + imperfect.on_v[noise, j]
        seen.tau_ext[j] = motion.tau_ext[j]
    for to in range(rows if k == 0 else 1):  # the first one stands until the next arrives
        _put(seen, (k + to) % rows)
    _take(seen, (k + 1) % rows)


@fused
def _put(seen: Measurements, row: int) -> None:
    for j in range(len(seen.q)):
        seen.on_way_q[row, j] = seen.q[j]
    for j in range(len(seen.v)):
        seen.on_way_v[row, j], seen.on_way_tau_ext[row, j] = seen.v[j], seen.tau_ext[j]


@fused
def _take(seen: Measurements, row: int) -> None:
    for j in range(len(seen.q)):
        seen.q[j] = seen.on_way_q[row, j]
    for j in range(len(seen.v)):
        seen.v[j], seen.tau_ext[j] = seen.on_way_v[row, j], seen.on_way_tau_ext[row, j]


imperfect_rollout = CompiledOnce(_rollout)
