"""The null space of a compiled tick at the tool: its basis, and the posture that it is drawn to."""

from __future__ import annotations

from ..._common.arrays import Array
from ..._numba.compile import inline
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .law import angle_between
from .tool_block import E_NULL, FIXED, FLAGS, HEAD, PAIR, POSTURE, POSTURE_SIN, SIX, TICKS
from .tool_inverse import continue_basis, put_basis_rate
from .tool_tables import (
    ERROR_RATE,
    POSTURE_ERROR,
    RATE_V,
    SPEED_ROW,
    ToolScratch,
    ToolTables,
)


@inline
def posture_error(
    arm: ArmTables, tables: ToolTables, work: ToolScratch, state: Array, q: Array
) -> None:
    """Write the posture q_n, that of the first tick where none is given, and q_n (-) q."""
    block = work.block
    for j in range(len(arm.topology)):
        i, row, turns = arm.topology[j, Q_INDEX], FIXED + j, arm.topology[j, KIND] == CONTINUOUS
        block[row, FLAGS] = PAIR if turns else 0.0
        if len(tables.posture) > 0:
            _put_posture(block, row, tables.posture, i, turns)
        elif state[HEAD, TICKS] == 0.0:
            _put_posture(block, row, q, i, turns)
        else:
            block[row, POSTURE] = state[row, POSTURE]
            block[row, POSTURE_SIN] = state[row, POSTURE_SIN]
        x, y = block[row, POSTURE], block[row, POSTURE_SIN]
        error = angle_between(q[i], q[i + 1], x, y) if turns else x - q[i]
        work.joints[POSTURE_ERROR, j] = error


@inline
def _put_posture(block: Array, row: int, q: Array, i: int, turns: bool) -> None:
    block[row, POSTURE] = q[i]
    block[row, POSTURE_SIN] = q[i + 1] if turns else 0.0


@inline
def move_null_space(
    work: ToolScratch, state: Array, numbers: Array, v: Array, is_whole: bool
) -> bool:
    """Write basis, error of the posture and rates of the null space; whether it is near that of the tick before."""
    V, nv, n = work.basis, len(v), work.basis.shape[1]
    if n == 0:
        return True
    start = FIXED + 3 * nv + n
    for j in range(nv):
        for c in range(n):
            place = j * n + c
            V[j, c] = state[start + place // SIX, place % SIX]
    if not continue_basis(work, is_whole):
        return False
    put_basis_rate(work, numbers)
    for j in range(nv):
        for c in range(n):
            place = j * n + c
            work.block[start + place // SIX, place % SIX] = V[j, c]
    for c in range(n):
        error, error_rate, speed, rate_v = 0.0, 0.0, 0.0, 0.0
        for j in range(nv):
            away, change = work.joints[POSTURE_ERROR, j], work.basis_rate[j, c]
            error += V[j, c] * away
            speed += V[j, c] * v[j]
            error_rate += change * away
            rate_v += change * v[j]
        work.block[FIXED + nv + c, E_NULL] = error
        work.null[ERROR_RATE, c], work.null[SPEED_ROW, c] = error_rate - speed, -speed
        work.null[RATE_V, c] = rate_v
    return True
