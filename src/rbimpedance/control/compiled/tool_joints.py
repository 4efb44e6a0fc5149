"""Limits of the joints in a compiled tick at the tool: velocity and position, torque and its rate."""

from __future__ import annotations

import math
from typing import Any

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.formulas import helper
from ...law.formulas import clip
from ...law.joint_bounds import acceleration_bounds
from ...law.limits import allocate_joints, limits_reached, torque_bounds
from ...robot.compiled.rigid_body import friction
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .law import angle_between
from .tool_block import (
    FIXED,
    FLAGS,
    HEAD,
    JOINT_LIMITED,
    RATE_LIMITED,
    SATURATED,
    SIX,
    TAU,
    TICKS,
)
from .tool_inverse import invert
from .tool_tables import (
    APPLIED,
    COLUMN,
    COMMAND,
    DEFICIT,
    DT,
    EFFORT,
    FREE,
    HELD,
    IS_BOUNDED,
    LARGEST,
    LEAST,
    LOWER,
    SPEED,
    TORQUE,
    TORQUE_STEP,
    UPPER,
    WANTED,
    ToolScratch,
    ToolTables,
)

_acceleration_bounds, _clip = helper(acceleration_bounds), helper(clip)
_allocate, _bounds = helper(allocate_joints), helper(torque_bounds)
_reached = helper(limits_reached)


@inline
def keep_joint_limits(arm: ArmTables, tables: ToolTables, work: ToolScratch, given: Any) -> None:
    """Write the accelerations within velocity and position limits; see `law.joint_bounds.JointBounds.keep`."""
    joints, kept, wanted = work.joints, work.joints[COMMAND], work.joints[WANTED]
    low, high, free = joints[LEAST], joints[LARGEST], joints[FREE]
    for j in range(len(kept)):
        kept[j], free[j] = wanted[j], 1.0
    if tables.choices[0, IS_BOUNDED] == 0:
        return
    for j in range(len(kept)):
        i, x, row = arm.topology[j, Q_INDEX], given.q, tables.joints[j]
        turns = arm.topology[j, KIND] == CONTINUOUS
        position = angle_between(1.0, 0.0, x[i], x[i + 1]) if turns else x[i]
        limits = row[LOWER], row[UPPER], row[SPEED]
        low[j], high[j] = _acceleration_bounds(position, given.v[j], *limits, tables.numbers[DT])
    while _hold_beyond(low, high, kept, free):
        for j in range(len(kept)):
            kept[j] = wanted[j] if free[j] != 0.0 else _clip(wanted[j], low[j], high[j])
        _let_others_take_over(tables, work, kept, wanted)
    for j in range(len(kept)):
        if free[j] == 0.0:
            work.block[FIXED + j, FLAGS] += JOINT_LIMITED


@inline
def _hold_beyond(low: Array, high: Array, kept: Array, free: Array) -> bool:
    """Mark free joints beyond a bound as held; whether there is one."""
    found = False
    for j in range(len(kept)):
        if free[j] != 0.0 and (kept[j] < low[j] or kept[j] > high[j]):
            free[j], found = 0.0, True
    return found


@routine
def _let_others_take_over(
    tables: ToolTables, work: ToolScratch, kept: Array, wanted: Array
) -> None:
    """Add to the free joints' accelerations what gives the tool the part that the held ones lack."""
    taken = work.tool[COLUMN]
    for i in range(SIX):
        taken[i] = 0.0
        for j in range(len(kept)):
            taken[i] += work.jacobian[j, i] * (wanted[j] - kept[j])
    invert(tables.numbers, work, work.jacobian, work.joints[FREE])
    for j in range(len(kept)):
        for i in range(SIX):
            kept[j] += work.inverse[j, i] * taken[i]


WITHIN, EXCEEDED = 0, 1
"""Whether the torque of the law is within the limits."""


@inline
def put_torque(
    arm: ArmTables, tables: ToolTables, work: ToolScratch, state: Array, given: Any
) -> int:
    """Write the motor torque from that of the model; `EXCEEDED` where a limit asks for `allocate`."""
    joints, status = work.joints, WITHIN
    for j in range(len(given.v)):
        tau = work.torque[j] + friction(arm.joints, j, given.v[j])
        if len(given.tau_ext) > 0:
            tau -= given.tau_ext[j]
        else:
            for i in range(SIX):
                tau -= work.jacobian[j, i] * given.wrench[i]
        step = tables.joints[j, TORQUE_STEP] if state[HEAD, TICKS] != 0.0 else math.inf
        lower, upper = _bounds(state[FIXED + j, TAU], tables.joints[j, EFFORT], step)
        if tau < lower or tau > upper:
            status = EXCEEDED
        joints[TORQUE, j], joints[LEAST, j], joints[LARGEST, j] = tau, lower, upper
        joints[APPLIED, j], joints[DEFICIT, j] = tau, 0.0
    return status


@routine
def allocate(work: ToolScratch) -> None:
    """Replace the torque by the one within the limits that keeps the free joints' accelerations, with M(q)."""
    joints = work.joints
    _allocate(
        joints[TORQUE], joints[LEAST], joints[LARGEST], work.mass,
        joints[APPLIED], joints[DEFICIT], joints[HELD], work.mass_factor,
    )  # fmt: skip


@inline
def put_flags(tables: ToolTables, work: ToolScratch) -> None:
    """Write the torque, and which of its limits are reached."""
    joints = work.joints
    for j in range(joints.shape[1]):
        tau, row = joints[APPLIED, j], FIXED + j
        given = joints[LEAST, j], joints[LARGEST, j], tables.joints[j, EFFORT]
        saturated, rate_limited = _reached(tau, *given)
        work.block[row, TAU] = tau
        if saturated:
            work.block[row, FLAGS] += SATURATED
        if rate_limited:
            work.block[row, FLAGS] += RATE_LIMITED
