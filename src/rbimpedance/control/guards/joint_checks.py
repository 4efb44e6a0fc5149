"""The checks of a tick on all joints: compiled where Numba works, the same functions in NumPy elsewhere."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._common.arrays import Array
from ..backends import is_available

V, SINCE_Q, SINCE_V, EXPLAINED, STILL, TRAVEL, EXPECTED, SEEN_V, FOUND = range(9)
"""Rows of the state of a `Monitor`; the last two are of this tick only."""

SPEED, ACCELERATION, LOWER, UPPER = range(4)
"""Rows of the range."""

NO_Q, NO_V, FAR, FROZEN, ALONE, JUMPED, FAST, OUTSIDE = (2**i for i in range(8))
"""What is found on a joint, as bits."""

STRAYED, CARRIED, EXCESS_SPEED, WAY, IMPULSE, SAME, STUCK, FOUND_STUCK = range(8)
"""Rows of the state of an `EffectMonitor`; the last one is of this tick only."""


def judge_q(
    range_: Array,
    before: Array,
    after: Array,
    moved: Array,
    v: Array,
    period: float,
    frozen_ticks: float,
    frozen_travel: float,
) -> float:
    """Count the motion of every joint and find where q cannot be used; see `Monitor`.

    Args:
        range_: The stated range.
        before: State of the tick before.
        after: The next state.
        moved: Motion since the last sound position, shape (nv,).
        v: Measured velocity, shape (nv,); NaN where there is none.
        period: Time since the tick before [s].
        frozen_ticks: See `Monitor`.
        frozen_travel: See `Monitor`.

    Returns:
        The largest of the bits that were found.
    """
    pace, speed = before[V], range_[SPEED]
    repeats = np.isnan(v) | (v == pace) & (v != 0.0)
    mean = np.where(np.isnan(v), pace, (pace + v) / 2.0)
    pace = np.minimum(np.maximum(mean, pace - 2.0 * speed), pace + 2.0 * speed)
    is_still = moved == 0.0
    after[EXPLAINED] = before[EXPLAINED] + period * pace
    after[TRAVEL] = np.where(is_still, before[TRAVEL] + period * pace, 0.0)
    after[EXPECTED] = np.where(is_still & repeats, before[EXPECTED], 0.0)
    should_show = np.maximum(np.abs(after[TRAVEL]), np.abs(after[EXPECTED])) > frozen_travel
    after[STILL] = np.where(should_show, before[STILL] + 1.0, 0.0)
    reach = 2.0 * speed * after[SINCE_Q]
    is_far = (np.abs(moved) > reach) & (np.abs(moved - after[EXPLAINED]) > reach)
    after[FOUND] = FAR * is_far + FROZEN * (after[STILL] >= frozen_ticks)
    return float(after[FOUND].max())


def judge_v(
    range_: Array,
    before: Array,
    after: Array,
    moved: Array,
    position: Array,
    v: Array,
    is_first: int,
) -> float:
    """Find where v cannot be used and what is out of range, after `judge_q`; see `Monitor`.

    `position` are the measured positions, shape (nv,); `is_first` is 1 where there was no tick before. All else is as
    `judge_q` has it.

    Returns:
        The largest sum of the bits that were found on a joint.
    """
    speed, size, change = range_[SPEED], np.abs(v), v - before[V]
    sees_q = after[FOUND] == 0.0
    pace = np.where(sees_q & (is_first == 0), moved / after[SINCE_Q], before[V])
    is_alone = (size > 2.0 * speed) & ((np.abs(v - pace) > speed) | (is_first != 0))
    has_jumped = np.abs(change) > 2.0 * range_[ACCELERATION] * after[SINCE_V]
    has_jumped &= is_first == 0
    is_lost = np.isnan(v) | ~sees_q & (change == 0.0)
    sees_v = ~(is_alone | has_jumped | is_lost)
    seen = np.where(sees_v, v, pace)
    is_outside = sees_q & ((position < range_[LOWER]) | (position > range_[UPPER]))
    after[FOUND] += NO_V * is_lost + ALONE * is_alone + JUMPED * has_jumped
    after[FOUND] += FAST * (np.abs(seen) > speed) + OUTSIDE * is_outside
    after[SEEN_V] = seen
    after[V] = np.where(sees_v | sees_q, seen, before[V])
    after[SINCE_Q] = np.where(sees_q, 0.0, after[SINCE_Q])
    after[SINCE_V] = np.where(sees_v, 0.0, after[SINCE_V])
    after[EXPLAINED] = np.where(sees_q, 0.0, after[EXPLAINED])
    return float(after[FOUND].max())


def look(
    friction: Array,
    before: Array,
    after: Array,
    moved: Array,
    net: Array,
    inertia: Array,
    period: float,
    travel: float,
    missed: float,
    memory: float,
) -> float:
    """Compare the motion of every joint with the torque on it; see `EffectMonitor`.

    Args:
        friction: Torque beyond what it carried that need not move a joint, shape (nv,) [N·m or N].
        before: State of the tick before.
        after: The next state.
        moved: Motion since the tick before, shape (nv,).
        net: Net torque, shape (nv,).
        inertia: Diagonal of M, shape (nv,).
        period: Time since the tick before [s].
        travel: See `EffectMonitor`.
        missed: Way that should have been gone [rad or m].
        memory: Time constant in which the impulse is forgotten [s].

    Returns:
        1 where torque is found to have no effect on some joint at this tick, else 0.
    """
    strayed, was_stuck = before[STRAYED] + moved, before[STUCK] > 0.0
    has_moved = np.abs(strayed) > travel
    is_less = has_moved | ~was_stuck & (np.abs(net) < np.abs(before[CARRIED]))
    carried = np.where(is_less, net, before[CARRIED])
    excess = np.abs(net - carried) - friction
    speed = np.where(excess > 0.0, before[EXCESS_SPEED] + period * excess / inertia, 0.0)
    way = np.where(excess > 0.0, before[WAY] + period * speed, 0.0)
    impulse = before[IMPULSE] + period * (net - carried - before[IMPULSE] / memory)
    is_stuck = way > missed
    after[STRAYED], after[CARRIED] = np.where(has_moved, 0.0, strayed), carried
    after[EXCESS_SPEED] = np.where(is_stuck, 0.0, speed)
    after[WAY] = np.where(is_stuck, 0.0, way)
    after[IMPULSE] = np.where(has_moved, 0.0, impulse)
    after[SAME] = np.where(moved == 0.0, before[SAME] + period, 0.0)
    after[FOUND_STUCK] = np.where(is_stuck, 1.0, 0.0)
    found = after[FOUND_STUCK].max()
    after[STUCK] = np.where(has_moved, 0.0, np.maximum(before[STUCK], found))
    return float(found)


@functools.cache
def checks() -> tuple[Callable[..., float], Callable[..., float], Callable[..., float]]:
    """Return `judge_q`, `judge_v` and `look`, compiled where that works."""
    if not is_available():
        return judge_q, judge_v, look
    from numba import types  # noqa: PLC0415 (Numba is loaded when needed)

    from ..._numba.compile import kernel  # noqa: PLC0415
    from ..._numba.layouts.arrays import Borrowed  # noqa: PLC0415

    f, vector = types.float64, Borrowed(types.float64, 1, readonly=True)
    rows, made = Borrowed(types.float64, 2, readonly=True), Borrowed(types.float64, 2)
    motion: Any = (rows, rows, made, vector)
    return (
        kernel(judge_q, (*motion, vector, f, f, f), f),
        kernel(judge_v, (*motion, vector, vector, types.int64), f),
        kernel(look, (vector, rows, made, vector, vector, vector, f, f, f, f), f),
    )
