"""Limits of the torque in compiled code: the formulas of `law.limits`, on the blocks of a tick."""

from __future__ import annotations

import math

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.formulas import helper
from ..._numba.lanes import select
from ...law.limits import allocate_joints, limits_reached, torque_bounds
from ...law.super_twisting import corrected_x, rested
from .block import (
    CLIPPED,
    FLAGS,
    GUARANTEED,
    NEXT_X,
    NEXT_Z,
    RATE_LIMITED,
    SATURATED,
    TAU,
    TICKS,
    U,
    Z,
)
from .law import DT, EFFORT, K2, PREDICTS, TORQUE_STEP, ZOH_GAIN, LawTables, Scratch

_allocate, _bounds, _reached = (
    helper(allocate_joints),
    helper(torque_bounds),
    helper(limits_reached),
)
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
    gains, deficit, n = law.gains, scratch.acceleration_deficit, len(block)
    for j in range(n):
        scratch.wanted[j] = block[j, TAU]
        scratch.lower[j], scratch.upper[j] = bounds(law, j, state)
    _allocate(
        scratch.wanted, scratch.lower, scratch.upper, scratch.mass,
        scratch.torque, deficit, scratch.held, scratch.factor,
    )  # fmt: skip
    for j in range(n):
        block[j, TAU] = scratch.torque[j]
        unrealised_u = scratch.joints[ZOH_GAIN, j] * deficit[j]
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
    step = select(state[0, TICKS] != 0.0, law.gains[j, TORQUE_STEP], math.inf)
    return _bounds(state[j, TAU], law.gains[j, EFFORT], step)  # type: ignore[no-any-return]


@inline
def put_flags(law: LawTables, j: int, state: Array, block: Array, premise_holds: bool) -> None:
    """Write which limits joint j is at, and whether its reaching law acts in full; the other flags stay."""
    tau = block[j, TAU]
    lower, upper = bounds(law, j, state)
    flags = CLIPPED * math.floor(block[j, FLAGS] / CLIPPED)  # keeps `CLIPPED` and `PAIR`
    saturated, rate_limited = _reached(tau, lower, upper, law.gains[j, EFFORT])
    flags += select(saturated, SATURATED, 0.0) + select(rate_limited, RATE_LIMITED, 0.0)
    block[j, FLAGS] = flags + (GUARANTEED if premise_holds else 0.0)
