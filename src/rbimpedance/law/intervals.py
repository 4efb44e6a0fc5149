"""Arrays of intervals with outward rounding: what is shown with them holds for real numbers, not for rounded ones.

IEEE arithmetic rounds +, -, ·, / and √ to the nearest number, so one step outwards on either side encloses the result.
The functions take plain arrays as well, so that one formula is both computed and verified.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._common.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """All arrays between two.

    Attributes:
        low: Lower ends.
        high: Upper ends.
    """

    low: Array
    high: Array

    def __add__(self, other: Any) -> Interval:
        other = enclosed(other)
        return _outward(self.low + other.low, self.high + other.high)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Any) -> Interval:
        return self + (-enclosed(other))

    def __rsub__(self, other: Any) -> Interval:
        return enclosed(other) - self

    def __mul__(self, other: Any) -> Interval:
        other = enclosed(other)
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _outward(np.minimum.reduce(ends), np.maximum.reduce(ends))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Interval:
        """Divide by what is positive or negative throughout."""
        other = enclosed(other)
        return self * _outward(1.0 / other.high, 1.0 / other.low)

    def __rtruediv__(self, other: Any) -> Interval:
        return enclosed(other) / self

    def __getitem__(self, key: Any) -> Interval:
        """Return the part of both ends that an index picks."""
        return Interval(self.low[key], self.high[key])


Interval.__array_ufunc__ = None  # type: ignore[attr-defined]  # an array on the left leaves the operation to this class


def _outward(low: Array, high: Array) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def enclosed(x: Any) -> Interval:
    """Return numbers as intervals without width; intervals as they are."""
    if isinstance(x, Interval):
        return x
    array = np.asarray(x, dtype=np.float64)
    return Interval(array, array)


def root(x: Any) -> Any:
    """Return √x of what is not negative."""
    if isinstance(x, Interval):
        return _outward(np.sqrt(np.maximum(x.low, 0.0)), np.sqrt(np.maximum(x.high, 0.0)))
    return np.sqrt(x)


def size(x: Any) -> Any:
    """Return abs(x)."""
    if isinstance(x, Interval):
        low = np.maximum(np.maximum(x.low, -x.high), 0.0)
        return Interval(low, np.maximum(-x.low, x.high))
    return np.abs(x)


def smaller(x: Any, y: Any) -> Any:
    """Return the smaller one of two, elementwise."""
    if isinstance(x, Interval) or isinstance(y, Interval):
        x, y = enclosed(x), enclosed(y)
        return Interval(np.minimum(x.low, y.low), np.minimum(x.high, y.high))
    return np.minimum(x, y)


def larger(x: Any, y: Any) -> Any:
    """Return the larger one of two, elementwise."""
    return -smaller(-x, -y)


def largest(x: Any) -> Any:
    """Return the largest one along the last axis."""
    if isinstance(x, Interval):
        return Interval(x.low.max(axis=-1), x.high.max(axis=-1))
    return x.max(axis=-1)


def joined(*parts: Any) -> Any:
    """Return arrays of shape (n, any) side by side."""
    if any(isinstance(part, Interval) for part in parts):
        ends = [enclosed(part) for part in parts]
        return Interval(
            np.concatenate([end.low for end in ends], axis=1),
            np.concatenate([end.high for end in ends], axis=1),
        )
    return np.concatenate(parts, axis=1)


def picked(x: Any, index: Any) -> Any:
    """Return the entries of every row that an index of shape (n, any) picks."""
    if isinstance(x, Interval):
        return Interval(
            np.take_along_axis(x.low, index, axis=1), np.take_along_axis(x.high, index, axis=1)
        )
    return np.take_along_axis(x, index, axis=1)


def upper(x: Any) -> Array:
    """Return upper ends, of plain numbers themselves."""
    ends: Array = x.high if isinstance(x, Interval) else np.asarray(x)
    return ends
