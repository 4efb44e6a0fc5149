"""Surfaces and reaching laws of a compiled tick at the tool, and what stops their integrals."""

from __future__ import annotations

from ..._common.arrays import Array
from ..._numba.compile import inline
from ..._numba.formulas import call_loop, helper
from ...law.bounded_surface import at_bound
from ...law.formulas import clip
from ...law.super_twisting import corrected_x, rested
from ...law.surfaces import demanded_acceleration
from .law import (
    A_NEXT,
    A_ROW,
    DT,
    E2_ROW,
    FEEDFORWARD,
    K2,
    PREDICTS,
    REACHING,
    S_ROW,
    SEEN,
    SEEN_E1,
    SURFACE,
    U_ROW,
    X_NEXT,
    X_ROW,
    Z_NEXT,
    Z_ROW,
    ZOH_GAIN,
    LawTables,
)
from .tool_block import (
    A_NULL,
    E1,
    E2,
    E3,
    E_NULL,
    FIXED,
    HEAD,
    HOLDS,
    S_NULL,
    SIX,
    TICKS,
    X_NULL,
    Z_BEFORE,
    Z_NULL,
    Z_NULL_BEFORE,
    A,
    S,
    U,
    X,
    Z,
)
from .tool_tables import ERROR_RATE, SPEED_ROW, Y_NULL, ToolScratch, Y

_at_bound, _clip, _demanded = helper(at_bound), helper(clip), helper(demanded_acceleration)
_rested, _corrected_x = helper(rested), helper(corrected_x)


@inline
def slide_at_tool(law: LawTables, work: ToolScratch, state: Array) -> None:
    """Write s, u and the acceleration of the error that they ask for, of the six directions."""
    rows, block = work.at_tool, work.block
    for i in range(SIX):
        rows[Z_ROW, i], rows[X_ROW, i], rows[A_ROW, i] = state[Z, i], state[X, i], state[A, i]
        rows[E2_ROW, i] = block[E2, i]
    _surface(law, rows, block[E1])
    _reach(law, rows, state[HEAD, TICKS] == 0.0)
    for i in range(SIX):
        u = rows[U_ROW, i]
        work.tool[Y, i] = _demanded(0.0, rows[FEEDFORWARD, i], u, rows[ZOH_GAIN, i])
        block[S, i], block[U, i], block[Z_BEFORE, i] = rows[S_ROW, i], u, rows[Z_ROW, i]


@inline
def slide_in_null(law: LawTables, work: ToolScratch, state: Array) -> None:
    """The same of the null space, where the rate of the error is not the velocity: V turns."""
    rows, block, null = work.in_null, work.block, work.null
    n, start = null.shape[1], FIXED + len(work.jacobian)
    if n == 0:
        return
    errors = null[Y_NULL]
    for c in range(n):
        row = start + c
        errors[c], rows[E2_ROW, c] = block[row, E_NULL], null[SPEED_ROW, c]
        rows[Z_ROW, c], rows[X_ROW, c] = state[row, Z_NULL], state[row, X_NULL]
        rows[A_ROW, c] = state[row, A_NULL]
    _surface(law, rows, errors)
    for c in range(n):
        block[start + c, S_NULL], rows[E2_ROW, c] = rows[S_ROW, c], null[ERROR_RATE, c]
    _surface(law, rows, errors)
    for c in range(n):
        rows[S_ROW, c] = block[start + c, S_NULL]
    _reach(law, rows, state[HEAD, TICKS] == 0.0)
    for c in range(n):
        null[Y_NULL, c] = _demanded(0.0, rows[FEEDFORWARD, c], rows[U_ROW, c], rows[ZOH_GAIN, c])
        block[start + c, Z_NULL_BEFORE] = rows[Z_ROW, c]


@inline
def _surface(law: LawTables, rows: Array, e1: Array) -> None:
    """Write s, feed-forward and gain."""
    for j in range(len(e1)):
        rows[SEEN_E1, j] = _clip(e1[j], -law.gains[j, SEEN], law.gains[j, SEEN])
    call_loop(law.choices[0, SURFACE], rows, SEEN_E1, law.gains[0, DT], law.surface, FEEDFORWARD)
    for j in range(len(e1)):
        own = rows[FEEDFORWARD, j], rows[ZOH_GAIN, j]
        rows[FEEDFORWARD, j], rows[ZOH_GAIN, j] = _at_bound(e1[j], law.gains[j, SEEN], *own)


@inline
def _reach(law: LawTables, rows: Array, starts: bool) -> None:
    """Write u, and the next z, x and a."""
    if starts:
        for j in range(rows.shape[1]):
            rows[Z_ROW, j], rows[X_ROW, j], rows[A_ROW, j] = 0.0, rows[S_ROW, j], 0.0
    call_loop(law.choices[0, REACHING], rows, S_ROW, law.gains[0, DT], law.reaching, U_ROW)


@inline
def stop_at_tool(law: LawTables, work: ToolScratch, missing: Array) -> None:
    """Write the next memory at the tool, ė2 and u under the torque.

    Args:
        law: The law.
        work: Work space of the tick.
        missing: Acceleration that the tool misses, in the coordinates of the error, shape (6,).
    """
    rows, block = work.at_tool, work.block
    for i in range(SIX):
        gain = rows[ZOH_GAIN, i]
        unrealised = gain * missing[i]
        block[Z, i], block[X, i] = _memory(law, rows, i, unrealised)
        block[A, i] = rows[A_NEXT, i]
        block[U, i] -= unrealised
        block[E3, i] = unrealised / gain - work.tool[Y, i]
        block[HOLDS, i] = 1.0 if unrealised == 0.0 else 0.0


@inline
def stop_in_null(law: LawTables, work: ToolScratch, withheld: Array) -> None:
    """Write the next memory in the null space; withheld is joint acceleration that limits take, shape (nv,)."""
    rows, V = work.in_null, work.basis
    for c in range(V.shape[1]):
        missing = 0.0
        for j in range(len(V)):
            missing += V[j, c] * withheld[j]
        row = FIXED + len(V) + c
        z, x = _memory(law, rows, c, rows[ZOH_GAIN, c] * missing)
        work.block[row, Z_NULL], work.block[row, X_NULL] = z, x
        work.block[row, A_NULL] = rows[A_NEXT, c]


@inline
def _memory(law: LawTables, rows: Array, j: int, unrealised_u: float) -> tuple[float, float]:
    """Next z and x where part of u is withheld."""
    z_next, x = rows[Z_NEXT, j], rows[X_NEXT, j]
    z = _rested(rows[Z_ROW, j], z_next, unrealised_u)
    if law.choices[0, PREDICTS]:
        x = _corrected_x(x, z_next, z, unrealised_u, law.gains[j, DT], law.gains[j, K2])
    return z, x
