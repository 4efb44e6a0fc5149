"""Torque limits: the closest torque within them, and the integrals at rest; see `limits` and `super_twisting`."""

from __future__ import annotations

import math

from .._arrays import Array
from ._jit import inline, routine
from .law import DT, EFFORT, IMPLICIT, K2, SCHEME, Law, Scratch
from .output import FLAGS, GUARANTEED, NEXT_X, NEXT_Z, PAIR, SATURATED, TAU, TICKS, U


@routine
def within_limits(law: Law, scratch: Scratch, state: Array, block: Array) -> None:
    """Replace the torque by the closest within the limits and stop the integrals there; see `Limits.allocate`.

    Args:
        law: The law.
        scratch: With M(q).
        state: Block of the tick before.
        block: Block of this tick, with the torque that the law asks for.
    """
    n, gains, lacking = len(scratch.wanted), law.gains, scratch.lacking
    _allocate(law, scratch, block)
    for j in range(n):
        missing = scratch.hold_gain[j] * lacking[j]
        z = 0.0 if state[0, TICKS] == 0.0 else state[j, NEXT_Z]
        z_next = block[j, NEXT_Z]
        if (z_next - z) * missing > 0.0:
            block[j, NEXT_Z] = z
        if law.choices[0, SCHEME] == IMPLICIT:
            block[j, NEXT_X] += gains[j, DT] * (
                missing - gains[j, K2] * (z_next - block[j, NEXT_Z])
            )
        block[j, U] -= missing
        put_flags(block, j, abs(block[j, TAU]) >= gains[j, EFFORT], missing == 0.0)


@inline
def put_flags(block: Array, j: int, saturated: bool, guaranteed: bool) -> None:
    """Write whether joint j is at its limit, and whether its reaching law acts in full."""
    flags = PAIR if block[j, FLAGS] >= PAIR else 0
    block[j, FLAGS] = flags + (SATURATED if saturated else 0) + (GUARANTEED if guaranteed else 0)


@inline
def _allocate(law: Law, scratch: Scratch, block: Array) -> None:
    """Torque within the limits, and the acceleration that it lacks."""
    wanted, lacking, held, M = scratch.wanted, scratch.lacking, scratch.held, scratch.mass
    n, exceeds = len(wanted), True
    for j in range(n):
        wanted[j], lacking[j], held[j] = block[j, TAU], 0.0, 0.0
    while exceeds:
        for j in range(n):
            limit = law.gains[j, EFFORT]
            if abs(block[j, TAU]) > limit:
                held[j] = 1.0
                block[j, TAU] = math.copysign(limit, block[j, TAU])
        _solve_held(scratch, block)
        exceeds = False
        for i in range(n):
            if held[i] == 0.0:
                tau = wanted[i]
                for j in range(n):
                    tau -= M[i, j] * lacking[j]
                block[i, TAU] = tau
                if abs(tau) > law.gains[i, EFFORT]:
                    exceeds = True


@inline
def _solve_held(scratch: Scratch, block: Array) -> None:
    """Solve M_SS·lacking_S = (wanted - tau)_S over the held joints S by Cholesky; elsewhere lacking stays zero."""
    wanted, lacking, held = scratch.wanted, scratch.lacking, scratch.held
    M, L, n = scratch.mass, scratch.factor, len(scratch.wanted)
    for i in range(n):
        if held[i] == 0.0:
            continue
        total = wanted[i] - block[i, TAU]
        for j in range(i + 1):
            if held[j] == 0.0:
                continue
            entry = M[i, j]
            for k in range(j):
                if held[k] != 0.0:
                    entry -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = entry / L[j, j]
                total -= L[i, j] * lacking[j]
            else:
                L[i, i] = math.sqrt(entry)
        lacking[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        if held[i] == 0.0:
            continue
        total = lacking[i]
        for k in range(i + 1, n):
            if held[k] != 0.0:
                total -= L[k, i] * lacking[k]
        lacking[i] = total / L[i, i]
