"""The closed loop of eight worlds at once: the source of `loop`, compiled for lanes.

It does the ticks that are alike in all lanes. Where a world comes to a case of its own, as at a torque limit, the block
ends before that tick, and that world continues alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ..._numba.lanes import any_of, select
from ..._numba.layouts.lane_arrays import lane_array
from ...control.compiled.block import TAU
from ...control.compiled.law import TickInputs
from ...control.compiled.tick import after_torque, before_torque, zero_if_finite
from ...robot.compiled import rigid_body
from .environment import Environment
from .log import MetricSums, note
from .loop import (
    END,
    FINISHED,
    FIRST,
    JOINT,
    LAST,
    SUBSTEPS,
    TICK,
    Clock,
    CompiledOnce,
    Controlled,
    LoopWorkspace,
    Memory,
    ReferenceSamples,
    semi_implicit_step,
    take_reference,
    update_impedance_error,
)
from .plant import PlantMotion, PlantTables, update_acceleration, update_tau_ext

LEFT, ALONE = 1, -1.0
"""How a block ends where a world has to continue alone; and what stands for its joint."""

# Columns of `LaneLog.columns` that are not in a tick's block.
LOG_Q, LOG_V, LOG_E_IM, LOG_TAU_EXT = -1, -2, -3, -4


class LaneLog(NamedTuple):
    """Samples of chosen columns.

    Attributes:
        samples: One row for each column of each sample, shape (samples·columns, nv, 8).
        columns: Columns of a tick's block, or those above, shape (columns,).
        every: Ticks from one sample to the next, and the number of the block's first sample, shape (2,).
    """

    samples: Array
    columns: NDArray[np.int64]
    every: NDArray[np.int64]


def stacked(parts: Sequence[Any]) -> Any:
    """Return eight like tables as one in lanes; what has one row for all ticks is repeated where others have more.

    Args:
        parts: Arrays, or named tuples of such. Whole numbers are those of the first.
    """
    first = parts[0]
    if isinstance(first, tuple):
        return type(first)(*map(stacked, zip(*parts, strict=True)))
    if first.dtype.kind == "i":
        return first
    lanes = lane_array(*np.broadcast_shapes(*(part.shape for part in parts)))
    for i, part in enumerate(parts):
        lanes[..., i] = part
    return lanes


def put_lane(lanes: Any, i: int, part: Any) -> None:
    """Write one lane to arrays of the same kind.

    Args:
        lanes: Tables in lanes.
        i: Which lane.
        part: Where it goes.
    """
    if isinstance(part, tuple):
        for inner, own in zip(lanes, part, strict=True):
            put_lane(inner, i, own)
    else:
        part[...] = lanes[..., i]


def _rollout(
    controlled: Controlled,
    plant: PlantTables,
    environment: Environment,
    wish: ReferenceSamples,
    memory: Memory,
    desk: LoopWorkspace,
    clock: Clock,
    log: LaneLog,
    figures: MetricSums,
    ended: Array,
) -> int:
    """Do the ticks from that of the outcome to before `END`; see `loop._rollout`.

    Tick (-1 while a lane runs) and joint at which each lane ended are in `ended`, shape (2, 8).
    """
    ticks, motion = clock.ticks, memory.motion
    for k in range(clock.outcome[TICK], ticks[END]):
        row = (k - ticks[FIRST]) * ticks[SUBSTEPS]
        is_even = k % 2 == 0
        state = memory.even if is_even else memory.odd
        block = memory.odd if is_even else memory.even
        take_reference(wish, k - ticks[FIRST], desk)
        update_tau_ext(plant, desk.plant, environment, row, motion.q, motion)
        leaves = _is_special(controlled, desk, motion, state, block) & (ended[TICK] < 0.0)
        if any_of(leaves):
            ended[TICK] = select(leaves, k, ended[TICK])
            ended[JOINT] = select(leaves, ALONE, ended[JOINT])
            clock.outcome[TICK] = k
            return LEFT
        update_acceleration(plant, desk.plant, motion)
        update_impedance_error(controlled, desk, motion, block)
        if k % log.every[0] == 0:
            _write(log, k // log.every[0] - log.every[1], motion, block, desk.e_im)
        if len(figures.table):
            note(figures, k, block, desk.e_im)
        if k == ticks[LAST]:
            break
        for i in range(ticks[SUBSTEPS]):
            semi_implicit_step(plant, environment, desk, clock, row + i, i == 0, motion)
            _stop_runaways(motion, clock.step[1], k, ended)
    return FINISHED


@fused
def _is_special(
    controlled: Controlled, desk: LoopWorkspace, motion: PlantMotion, state: Array, block: Array
) -> bool:
    """Do a tick, and say where it is not as it should be: at unsound inputs, and at torque limits."""
    given = TickInputs(motion.q, motion.v, desk.q_d, desk.v_d, desk.a_d, motion.tau_ext)
    arm, law, work = controlled.arm, controlled.law, desk.scratch
    before_torque(arm, law, work, state, given, block)
    rigid_body.inverse_dynamics(arm, desk.plant, motion.v, work.command, work.torque)
    is_beyond = after_torque(arm, law, work.torque, motion.v, motion.tau_ext, state, block)
    for j in range(len(motion.tau)):
        motion.tau[j] = block[j, TAU]
    return is_beyond | (zero_if_finite(given) != 0.0)


@fused
def _write(log: LaneLog, i: int, motion: PlantMotion, block: Array, e_im: Array) -> None:
    """Write one sample."""
    count = len(log.columns)
    for c in range(count):
        column, row = log.columns[c], i * count + c
        for j in range(len(e_im)):
            if column >= 0:
                log.samples[row, j] = block[j, column]
            elif column == LOG_Q:
                log.samples[row, j] = motion.q[j]
            elif column == LOG_V:
                log.samples[row, j] = motion.v[j]
            else:
                log.samples[row, j] = e_im[j] if column == LOG_E_IM else motion.tau_ext[j]


@fused
def _stop_runaways(motion: PlantMotion, bound: float, k: int, ended: Array) -> None:
    """End the lanes in which a joint has left every range in the period after tick k."""
    is_beyond = False
    for v in range(len(motion.v)):
        speed = abs(motion.v[v])
        is_beyond = is_beyond | (speed >= bound) | (speed != speed)
    if any_of(is_beyond):
        _stop(motion, bound, is_beyond, k, ended)


@routine
def _stop(motion: PlantMotion, bound: float, is_beyond: bool, k: int, ended: Array) -> None:
    """Note tick and joint of such lanes, see `loop.runaway`, and let them rest."""
    q, v = motion.q, motion.v
    fastest, joint = bound + 0.0 * ended[TICK], 0.0 * ended[JOINT]
    for j in range(len(v)):
        speed = abs(v[j])
        is_faster = ((speed >= fastest) | (speed != speed)) & (fastest == fastest)
        fastest, joint = select(is_faster, speed, fastest), select(is_faster, j, joint)
    ends = is_beyond & (ended[TICK] < 0.0)
    ended[TICK], ended[JOINT] = select(ends, k, ended[TICK]), select(ends, joint, ended[JOINT])
    for j in range(len(v)):
        q[j], v[j] = select(is_beyond, 0.0, q[j]), select(is_beyond, 0.0, v[j])


lane_rollout = CompiledOnce(_rollout)
