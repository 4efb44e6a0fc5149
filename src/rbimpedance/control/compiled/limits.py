"""Limits of the torque: the closest one within them, and the integrals at rest; see `limits` and `super_twisting`."""

from __future__ import annotations

import math

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.formulas import helper
from ...law.super_twisting import corrected_x, rested
from .block import (
    CLIPPED,
    FLAGS,
    GUARANTEED,
    NEXT_X,
    NEXT_Z,
    PAIR,
    RATE_LIMITED,
    SATURATED,
    TAU,
    TICKS,
    U,
    Z,
)
from .law import DT, EFFORT, K2, PREDICTS, TORQUE_STEP, ZOH_GAIN, LawTables, Scratch

_rested, _corrected_x = helper(rested), helper(corrected_x)


@routine
def within_limits(law: LawTables, scratch: Scratch, state: Array, block: Array) -> None:
    """Replace the torque by the closest within the limits and stop the integrals there; see `Limits.allocate`.

    Args:
        law: The law.
        scratch: With M(q).
        state: Block of the tick before.
        block: Block of this tick, with the torque that the law demands.
    """
    n, gains, acceleration_deficit = len(scratch.wanted), law.gains, scratch.acceleration_deficit
    _allocate(law, scratch, state, block)
    for j in range(n):
        unrealised_u = scratch.joints[ZOH_GAIN, j] * acceleration_deficit[j]
        z_next = block[j, NEXT_Z]
        block[j, NEXT_Z] = _rested(block[j, Z], z_next, unrealised_u)
        if law.choices[0, PREDICTS]:
            block[j, NEXT_X] = _corrected_x(
                block[j, NEXT_X], z_next, block[j, NEXT_Z], unrealised_u, gains[j, DT], gains[j, K2]
            )
        block[j, U] -= unrealised_u
        put_flags(law, j, state, block, unrealised_u == 0.0)


@inline
def bounds(law: LawTables, j: int, state: Array) -> tuple[float, float]:
    """Least and largest torque of joint j at this tick."""
    effort, step = law.gains[j, EFFORT], law.gains[j, TORQUE_STEP]
    if state[0, TICKS] == 0.0:
        return -effort, effort
    before = state[j, TAU]
    return min(max(before - step, -effort), effort), min(max(before + step, -effort), effort)


@inline
def put_flags(law: LawTables, j: int, state: Array, block: Array, premise_holds: bool) -> None:
    """Write which limits joint j is at, and whether its reaching law acts in full; the other flags stay."""
    tau = block[j, TAU]
    lower, upper = bounds(law, j, state)
    flags = int(block[j, FLAGS]) & (PAIR | CLIPPED)
    if abs(tau) >= law.gains[j, EFFORT]:
        flags |= SATURATED
    elif tau <= lower or tau >= upper:
        flags |= RATE_LIMITED
    if premise_holds:
        flags |= GUARANTEED
    block[j, FLAGS] = flags


@inline
def _allocate(law: LawTables, scratch: Scratch, state: Array, block: Array) -> None:
    """Torque within the limits, and the missing acceleration."""
    wanted, acceleration_deficit, held, M = (
        scratch.wanted,
        scratch.acceleration_deficit,
        scratch.held,
        scratch.mass,
    )
    n, exceeds = len(wanted), True
    for j in range(n):
        wanted[j], acceleration_deficit[j], held[j] = block[j, TAU], 0.0, 0.0
    while exceeds:
        for j in range(n):
            lower, upper = bounds(law, j, state)
            if block[j, TAU] < lower or block[j, TAU] > upper:
                held[j] = 1.0
                block[j, TAU] = min(max(block[j, TAU], lower), upper)
        _solve_held(scratch, block)
        exceeds = False
        for i in range(n):
            if held[i] == 0.0:
                tau = wanted[i]
                for j in range(n):
                    tau -= M[i, j] * acceleration_deficit[j]
                block[i, TAU] = tau
                lower, upper = bounds(law, i, state)
                if tau < lower or tau > upper:
                    exceeds = True


@inline
def _solve_held(scratch: Scratch, block: Array) -> None:
    """Solve M_SS·deficit_S = (wanted - tau)_S over the held joints S by Cholesky; elsewhere the deficit stays zero."""
    wanted, deficit, held = scratch.wanted, scratch.acceleration_deficit, scratch.held
    for i in range(len(held)):
        if held[i] != 0.0:
            deficit[i] = _eliminated(scratch, i, wanted[i] - block[i, TAU])
    for i in range(len(held) - 1, -1, -1):
        if held[i] != 0.0:
            deficit[i] = _substituted(scratch, i)


@inline
def _eliminated(scratch: Scratch, i: int, total: float) -> float:
    """Write row i of the factor; entry i of the solution of L·y = wanted - tau."""
    deficit, held, M, L = scratch.acceleration_deficit, scratch.held, scratch.mass, scratch.factor
    for j in range(i + 1):
        if held[j] == 0.0:
            continue
        entry = M[i, j]
        for k in range(j):
            if held[k] != 0.0:
                entry -= L[i, k] * L[j, k]
        if j < i:
            L[i, j] = entry / L[j, j]
            total -= L[i, j] * deficit[j]
        else:
            L[i, i] = math.sqrt(entry)
    y: float = total / L[i, i]
    return y


@inline
def _substituted(scratch: Scratch, i: int) -> float:
    """Entry i of the solution of Lᵀ·deficit = y."""
    deficit, held, L = scratch.acceleration_deficit, scratch.held, scratch.factor
    total = deficit[i]
    for k in range(i + 1, len(held)):
        if held[k] != 0.0:
            total -= L[k, i] * deficit[k]
    entry: float = total / L[i, i]
    return entry
