"""Ranges as users give them: one number or a pair, checked once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, read_only, real, size, vector
from ..exceptions import DimensionError, ParameterError


def is_positive(x: Array) -> Any:
    """Elementwise, for the predicates below."""
    return x > 0.0


def is_not_negative(x: Array) -> Any:
    """Elementwise, for the predicates below."""
    return x >= 0.0


def range_of(
    name: str, value: ArrayLike, nominal: float, is_admissible: Callable[[Array], Any]
) -> Array:
    """A (lowest, highest) pair; one number means all between nominal and that."""
    words = "a number or a (lowest, highest) pair, both finite and possible"
    array = real(name, value, words)
    if array.ndim == 0:
        array = np.array([np.minimum(nominal, array), np.maximum(nominal, array)])
    if array.ndim > 2 or array.shape[0] != 2:
        raise DimensionError(name, words, f"shape {array.shape}")
    if not np.isfinite(array).all() or not is_admissible(array).all():
        raise ParameterError(name, value, words)
    if (array[0] > array[1]).any():
        raise ParameterError(name, value, "a (lowest, highest) pair in this order")
    return read_only(array)


def scalar_range(
    name: str, value: ArrayLike, nominal: float, is_admissible: Callable[[Array], Any]
) -> Array:
    """The same with a pair of numbers, not of vectors, shape (2,)."""
    array = range_of(name, value, nominal, is_admissible)
    if array.ndim != 1:
        raise DimensionError(name, "a number or a pair of numbers", f"shape {array.shape}")
    return array


def constant_range(name: str, value: ArrayLike) -> Array:
    """(1 - x, 1 + x) from one number, else the pair."""
    if np.ndim(value) == 0:
        error = size(name, value)
        value = (1.0 - error, 1.0 + error)
    return range_of(name, value, 1.0, is_positive)


def box(name: str, value: ArrayLike) -> Array:
    """One point (3,) or two opposite corners (2, 3)."""
    words = "a point of shape (3,) or two corners of shape (2, 3)"
    array = real(name, value, words)
    if array.shape not in ((3,), (2, 3)):
        raise DimensionError(name, words, f"shape {array.shape}")
    corners = array if array.ndim == 2 else np.stack([array, array])
    box = np.stack([vector(name, corner, 3, "x, y, z") for corner in corners])
    if (box[0] > box[1]).any():
        raise ParameterError(name, value, "two corners, the lower one first in every coordinate")
    return read_only(box)


def is_within(value: ArrayLike, low: ArrayLike, high: ArrayLike) -> bool:
    """Whether every entry is between two bounds, but for rounding."""
    value, low, high = (np.asarray(x, dtype=np.float64) for x in (value, low, high))
    slack = 1e-9 * (1.0 + np.abs(value))
    return bool(((value >= low - slack) & (value <= high + slack)).all())
