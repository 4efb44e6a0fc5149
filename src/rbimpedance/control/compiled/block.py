"""Output and state of a compiled tick: one block of numbers, from which the named arrays are taken on demand.

To make all of them at every tick would take longer than the tick.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._common.deprecation import renamed_attribute
from ..telemetry import FLAGS as FLAG_NAMES
from ..telemetry import ControllerOutput, ControllerState

# Columns of a block, one row a joint.
TAU, V_R, A_R, E1, E2, S, U, Q_E, V_E, FLAGS = range(10)
NEXT_Q_E, NEXT_V_E, NEXT_Z, NEXT_X, NEXT_A = range(10, 15)
TICKS = 15  # so far, this one included
Z, TAU_EXT = 16, 17
Q_R, Q_R_SIN = 18, 19  # the second for continuous joints only
COLUMNS = 20

OUTPUT = ("tau", "v_r", "a_r", "e1", "e2", "s", "u", "q_e", "v_e")
"""The first of them by the names of `ControllerOutput`; a tick on hardware has the same as rows."""

SATURATED, GUARANTEED, RATE_LIMITED, CLIPPED, PAIR = 1, 2, 4, 8, 16
"""Bits of `FLAGS`; `PAIR`: the joint has two entries of q."""

BIT_OF = {"saturated": SATURATED, "rate_limited": RATE_LIMITED, "clipped": CLIPPED}
"""Bits of the flags by name; those that no compiled tick sets have none."""

_STATE = {
    "q_e": NEXT_Q_E,
    "v_e": NEXT_V_E,
    "z": NEXT_Z,
    "x": NEXT_X,
    "a": NEXT_A,
    "tau": TAU,
    "tau_ext": TAU_EXT,
    "q_e_before": Q_E,
    "v_e_before": V_E,
    "z_before": Z,
}
"""Where a block keeps the arrays of a `ControllerState`, in its order."""


class Packed:
    """Has the names of a named tuple, and can be taken apart like it.

    Attributes:
        block: The numbers of the block, row by row, as bytes: they cannot change.
    """

    __slots__ = ("block",)
    block: bytes
    _plain: Any

    def __init__(self, block: Array) -> None:
        self.block = block.tobytes()

    @property
    def rows(self) -> Array:
        """The block, shape (nv, `COLUMNS`), read-only."""
        return np.frombuffer(self.block).reshape(-1, COLUMNS)

    def __iter__(self) -> Iterator[Any]:
        return (getattr(self, name) for name in self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __getitem__(self, index: Any) -> Any:
        return tuple(self)[index]

    def __repr__(self) -> str:
        return repr(self.unpacked())

    def __reduce__(self) -> tuple[Any, ...]:
        return self._plain, tuple(self)

    def unpacked(self) -> Any:
        """Return the named tuple itself."""
        return self._plain(*self)

    @property
    def _fields(self) -> tuple[str, ...]:
        fields: tuple[str, ...] = self._plain._fields
        return fields

    def _asdict(self) -> dict[str, Any]:
        return dict(zip(self._fields, self, strict=True))

    def _replace(self, **changes: Any) -> Any:
        return self.unpacked()._replace(**changes)


def _view(k: int) -> Any:
    return property(lambda self: np.frombuffer(self.block)[k::COLUMNS])


def _column(k: int) -> Any:
    return property(lambda self: np.frombuffer(self.block)[k::COLUMNS].copy())


def _flag(bit: int) -> Any:
    return property(lambda self: (_flags(self) & bit) != 0)


def _flags(packed: Packed) -> NDArray[np.int64]:
    return np.frombuffer(packed.block)[FLAGS::COLUMNS].astype(np.int64)


class PackedState(Packed):
    """A `ControllerState` in a block; its arrays are read-only."""

    __slots__ = ()
    _plain = ControllerState

    ticks = property(lambda self: int(self.rows[0, TICKS]))
    q_e, v_e, z, x, a, tau, tau_ext, q_e_before, v_e_before, z_before = map(_view, _STATE.values())

    @classmethod
    def pack(cls, state: ControllerState) -> PackedState:
        """Return a state with the same contents."""
        block = np.zeros((len(state.q_e), COLUMNS))
        block[:, TICKS] = state.ticks
        block[:, list(_STATE.values())] = np.transpose(state[1:])
        return cls(block)

    def _replace(self, **changes: Any) -> PackedState:
        block = self.rows.copy()
        for name, value in changes.items():
            block[:, TICKS if name == "ticks" else _STATE[name]] = value
        return type(self)(block)


class PackedOutput(Packed):
    """A `ControllerOutput` in a block; its arrays are copies."""

    __slots__ = ()
    _plain = ControllerOutput

    tau, v_r, a_r = _column(TAU), _column(V_R), _column(A_R)
    e1, e2, s, u = _column(E1), _column(E2), _column(S), _column(U)
    q_e, v_e = _column(Q_E), _column(V_E)
    premise_holds = _flag(GUARANTEED)
    guaranteed = renamed_attribute("guaranteed", "premise_holds")
    held = renamed_attribute("held", "reference_limited")

    def __iter__(self) -> Iterator[Any]:
        """All fields at once, which is faster than one by one."""
        columns = self.rows.T.copy()
        flags = columns[FLAGS].astype(np.int64)
        q_r = self.q_r if flags.max() >= PAIR else columns[Q_R]
        return iter((columns[TAU], q_r, *columns[V_R : V_E + 1], *(flags & _BITS != 0)))

    @property
    def q_r(self) -> Array:
        """Impedance reference."""
        pairs = self.rows[:, Q_R : Q_R_SIN + 1]
        second = (_flags(self) & PAIR) != 0
        q_r: Array = pairs[np.column_stack([np.ones_like(second), second])]
        return q_r


_BITS = np.array(
    [
        [{**BIT_OF, "premise_holds": GUARANTEED}.get(name, 0)]
        for name in ControllerOutput._fields[10:]
    ]
)
"""Bits of the fields of a `ControllerOutput` that are truth values, in its order."""

for _name in FLAG_NAMES:
    setattr(PackedOutput, _name, _flag(BIT_OF.get(_name, 0)))
