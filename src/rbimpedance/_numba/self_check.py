"""A check that NumPy's arrays are laid out as `borrow` reads them."""

from __future__ import annotations

import numpy as np
from numba import types

from .._common.arrays import Array
from .array_arguments import Borrowed
from .compile import kernel


def check_borrowing() -> None:
    """Read arrays of known content.

    Raises:
        RuntimeError: They are read wrongly, or something else than a plain array is taken for one.
    """
    own = Borrowed(types.float64, 1, trusted=True)
    matrix = Borrowed(types.float64, 2, trusted=True)
    probe = kernel(_probe, (Borrowed(types.float64, 1, readonly=True), matrix, own))
    vector, table, seen = np.array([3.0, 5.0, 7.0]), np.arange(8.0).reshape(2, 4), np.zeros(5)
    probe(vector, table, seen)
    if seen.tolist() != [3.0, 7.0, 2.0, 4.0, 6.0]:
        raise RuntimeError("the memory layout of NumPy's arrays is not the known one")
    for wrong in ([1.0], vector[::2], vector.astype(np.int64), table):
        try:
            probe(wrong, table, seen)
        except TypeError:
            continue
        raise RuntimeError(f"{wrong!r} was taken for a plain vector of float64")


def _probe(vector: Array, table: Array, seen: Array) -> int:
    seen[0], seen[1] = len(vector), vector[2]
    seen[2], seen[3], seen[4] = table.shape[0], table.shape[1], table[1, 2]
    return 0
