"""The check that guards this room: the layouts that it relies on are those of the running CPython and NumPy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from ..._common.arrays import Array
from ..compile import kernel
from .arrays import Borrowed
from .objects import OBJECTS, BlockArgument, PairResult, VectorsArgument, returner
from .tables import Held, hold, opened


class _Packed:
    __slots__ = ("block",)
    block: bytes


class _Vectors(NamedTuple):
    a: Array
    b: Array


class _Tables(NamedTuple):
    seen: Array
    table: Array


_OWN = Borrowed(types.float64, 1, trusted=True)
_TABLE = Borrowed(types.float64, 2, trusted=True)
_PAIR = PairResult(_Packed, _Packed)
_returned = returner(_PAIR)


def check_layouts() -> None:
    """Hand known arrays and objects to a kernel, and take what it makes of them.

    Raises:
        RuntimeError: They are read or made wrongly, or something else than a plain vector is taken for one.
    """
    vector = Borrowed(types.float64, 1, readonly=True)
    tables = Held(types.NamedTuple((_OWN, _TABLE), _Tables))
    arguments = tables, vector, BlockArgument(_Packed, 2), VectorsArgument(_Vectors, vector)
    probe = kernel(_probe, arguments, _PAIR)
    given, seen, packed = np.array([3.0, 5.0, 7.0]), np.zeros(8), _Packed()
    packed.block = np.array([1.0, 2.0, 8.0, 9.0]).tobytes()
    held = hold(_Tables(seen, np.arange(8.0).reshape(2, 4)))
    made = probe(held, given, packed, _Vectors(given[1:], given[:1]))
    if seen.tolist() != [3.0, 7.0, 2.0, 4.0, 6.0, 2.0, 9.0, 10.0]:
        raise RuntimeError("the memory layout of arrays or objects is not the known one")
    if [type(x) for x in made] != [_Packed, _Packed] or made[0].block != given.tobytes():
        raise RuntimeError("compiled code makes no sound objects")
    not_vectors: list[Any] = [[1.0], given[::2], given.astype(np.int64), given[None]]
    for wrong in not_vectors:
        try:
            probe(held, wrong, packed, _Vectors(given, given))
        except TypeError:
            continue
        raise RuntimeError(f"{wrong!r} was taken for a plain vector of float64")


def _probe(held: Any, vector: Array, block: Array, vectors: Any) -> Any:
    seen, table = opened(held)
    seen[0], seen[1] = len(vector), vector[2]
    seen[2], seen[3], seen[4] = table.shape[0], table.shape[1], table[1, 2]
    seen[5], seen[6], seen[7] = len(block), block[1, 1], vectors[0][1] + vectors[1][0]
    return _returned(OBJECTS, vector)
