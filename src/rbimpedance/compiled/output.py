"""Output and state of a compiled tick: one block of numbers, from which the named arrays are taken when asked for.

To make all of them at every tick would take longer than the tick.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .._arrays import Array
from ..telemetry import ControllerOutput, ControllerState

# Columns of a block, one row a joint.
TAU, V_R, A_R, E1, E2, S, U, Q_E, V_E, FLAGS = range(10)
NEXT_Q_E, NEXT_V_E, NEXT_Z, NEXT_X, NEXT_A = range(10, 15)
TICKS = 15  # so far, this one included
Q_R, Q_R_SIN = 16, 17  # the second for continuous joints only
COLUMNS = 18

SATURATED, GUARANTEED, PAIR = 1, 2, 4
"""Bits of `FLAGS`; `PAIR`: the joint has two entries of q."""


class _Packed:
    """Has the names of a named tuple and behaves like it; what it holds is the block."""

    __slots__ = ("block",)
    block: Array
    _plain: Any

    def __iter__(self) -> Iterator[Any]:
        return (getattr(self, name) for name in self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __getitem__(self, index: Any) -> Any:
        return tuple(self)[index]

    def __repr__(self) -> str:
        return repr(self._plain(*self))

    def __reduce__(self) -> tuple[Any, ...]:
        return self._plain, tuple(self)

    @property  # type: ignore[misc]
    def __class__(self) -> Any:
        """The named tuple: for `isinstance` this is one."""
        return self._plain

    @property
    def _fields(self) -> tuple[str, ...]:
        fields: tuple[str, ...] = self._plain._fields
        return fields

    def _asdict(self) -> dict[str, Any]:
        return dict(zip(self._fields, self, strict=True))

    def _replace(self, **changes: Any) -> Any:
        return self._plain(*self)._replace(**changes)


def _column(k: int) -> Any:
    return property(lambda self: self.block[:, k].copy())


def _flag(bit: int) -> Any:
    return property(lambda self: (self.block[:, FLAGS].astype(np.int64) & bit) != 0)


class PackedState(_Packed):
    """A `ControllerState` in a block."""

    __slots__ = ()
    _plain = ControllerState

    ticks = property(lambda self: int(self.block[0, TICKS]))
    q_e, v_e = _column(NEXT_Q_E), _column(NEXT_V_E)
    z, x, a = _column(NEXT_Z), _column(NEXT_X), _column(NEXT_A)

    @classmethod
    def of(cls, block: Array) -> PackedState:
        """Return the state that a block holds."""
        state = cls()
        state.block = block
        return state

    @classmethod
    def pack(cls, state: ControllerState) -> PackedState:
        """Return a state with the same contents."""
        block = np.zeros((len(state.q_e), COLUMNS))
        block[:, TICKS] = state.ticks
        block[:, NEXT_Q_E : NEXT_A + 1] = np.transpose(state[1:])
        return cls.of(block)


class PackedOutput(_Packed):
    """A `ControllerOutput` in a block."""

    __slots__ = ()
    _plain = ControllerOutput

    tau, v_r, a_r = _column(TAU), _column(V_R), _column(A_R)
    e1, e2, s, u = _column(E1), _column(E2), _column(S), _column(U)
    q_e, v_e = _column(Q_E), _column(V_E)
    saturated, guaranteed = _flag(SATURATED), _flag(GUARANTEED)

    @property
    def q_r(self) -> Array:
        """Impedance reference."""
        pairs = self.block[:, Q_R : Q_R_SIN + 1]
        second = self.block[:, FLAGS] >= PAIR
        q_r: Array = pairs[np.column_stack([np.ones_like(second), second])]
        return q_r
