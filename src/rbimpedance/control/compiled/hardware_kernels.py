"""The entry points of a `HardwareController`'s compiled tick."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from ..._common.arrays import Array
from ..._numba.compile import kernel, routine
from ..._numba.layouts.objects import VectorsArgument
from ..._numba.layouts.tables import Held, opened
from ...robot.compiled.dynamics import ARM, OWN_MATRIX, OWN_VECTOR, SPACE, VECTOR_IN
from ...trajectories import Reference
from .hardware_tables import OUT_TAU, HardwareTables, TickMemory, TickOutput, TickSpace
from .hardware_tick import hardware_tick
from .law import TickInputs
from .tick import is_sound

UNSOUND, EXCEEDED, SENT = 0, 1, 2
"""How a tick ended: at inputs that are not sound, at a torque beyond a limit, or with a torque."""


class RealtimeWords(NamedTuple):
    """What the tick of a real-time loop reads and writes besides its arguments."""

    tables: HardwareTables
    space: TickSpace
    before: TickMemory
    after: TickMemory
    out: TickOutput
    tau: Array


class HardwareWords(NamedTuple):
    """What the entry point reads and writes besides its arguments."""

    tables: HardwareTables
    space: TickSpace


@functools.cache
def hardware_kernel() -> Callable[..., Any]:
    """Compile the tick, or load it from the disk."""
    vectors = (VECTOR_IN, VECTOR_IN, VectorsArgument(Reference, VECTOR_IN), VECTOR_IN)
    memory = (OWN_VECTOR, OWN_MATRIX, OWN_MATRIX)
    return kernel(_entry, (_WORDS, types.int64, *vectors, *memory, *memory, OWN_MATRIX, OWN_VECTOR))


_TABLES = types.NamedTuple(
    (ARM, ARM, OWN_MATRIX, OWN_MATRIX, OWN_VECTOR, OWN_VECTOR), HardwareTables
)
_SPACE = types.NamedTuple((SPACE, *[OWN_MATRIX] * 4, OWN_VECTOR), TickSpace)
_WORDS = Held(types.NamedTuple((_TABLES, _SPACE), HardwareWords))


_MEMORY = types.NamedTuple((OWN_VECTOR, OWN_MATRIX, OWN_MATRIX), TickMemory)
_OUT = types.NamedTuple((OWN_MATRIX, OWN_VECTOR), TickOutput)
_REALTIME = Held(
    types.NamedTuple((_TABLES, _SPACE, _MEMORY, _MEMORY, _OUT, OWN_VECTOR), RealtimeWords)
)


@functools.cache
def realtime_kernel() -> Callable[..., Any]:
    """Compile the tick of a real-time loop, or load it from the disk."""
    vectors = (VECTOR_IN, VECTOR_IN, VectorsArgument(Reference, VECTOR_IN), VECTOR_IN)
    return kernel(_realtime_entry, (_REALTIME, types.int64, *vectors))


def _entry(  # noqa: PLR0913 (a state, and the next one)
    words: Any,
    ticks: int,
    q: Array,
    v: Array,
    reference: Any,
    tau_ext: Array,
    q_before: Array,
    rows_before: Array,
    pending_before: Array,
    q_hat: Array,
    rows: Array,
    pending: Array,
    out: Array,
    q_r: Array,
) -> int:
    tables, space = opened(words)
    given = TickInputs(q, v, reference[0], reference[1], reference[2], tau_ext)
    before = TickMemory(q_before, rows_before, pending_before)
    after, output = TickMemory(q_hat, rows, pending), TickOutput(out, q_r)
    return _whole(tables, space, ticks, given, before, after, output)


def _realtime_entry(
    words: Any, ticks: int, q: Array, v: Array, reference: Any, tau_ext: Array
) -> int:
    tables, space, before, after, out, tau = opened(words)
    given = TickInputs(q, v, reference[0], reference[1], reference[2], tau_ext)
    ending = _whole(tables, space, ticks, given, before, after, out)
    if ending == SENT:
        for j in range(len(tau)):
            tau[j] = out.rows[OUT_TAU, j]
    return ending


@routine
def _whole(
    tables: HardwareTables,
    space: TickSpace,
    ticks: int,
    given: TickInputs,
    before: TickMemory,
    after: TickMemory,
    out: TickOutput,
) -> int:
    """A tick on a copy of the state, which is kept as it was."""
    if not is_sound(tables.arm, given):
        return UNSOUND
    for i in range(len(after.q)):
        after.q[i] = before.q[i]
    for j in range(after.rows.shape[1]):
        for i in range(len(after.rows)):
            after.rows[i, j] = before.rows[i, j]
        for i in range(len(after.pending)):
            after.pending[i, j] = before.pending[i, j]
    return SENT if hardware_tick(tables, space, ticks, given, after, out) else EXCEEDED
