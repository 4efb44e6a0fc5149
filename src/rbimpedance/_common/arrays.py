"""The border between user input and the library: everything inside is a float64 array of known shape."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..exceptions import DimensionError, NonFiniteError, ParameterError

T = TypeVar("T")

Array: TypeAlias = NDArray[np.float64]
"""What the library returns: float64, C-contiguous, native byte order."""

BoolArray: TypeAlias = NDArray[np.bool_]
"""One truth value per joint."""


def vector(name: str, value: ArrayLike, size: int | None, symbol: str = "nv") -> Array:
    """Check that a run-time input is a finite real vector of the given size.

    Args:
        name: Argument's name, for the error.
        value: The input; float64 arrays pass without a copy.
        size: Expected length; None for any.
        symbol: What that length is called, for the error.

    Returns:
        The input as float64 in native byte order, shape (size,).

    Raises:
        DimensionError: Not a real vector of that length.
        NonFiniteError: Holds NaN or infinity.
    """
    expected = f"a vector of shape ({symbol},)" + ("" if size is None else f" = ({size},)")
    array = real(name, value, expected)
    if array.ndim != 1 or size not in (None, len(array)):
        raise DimensionError(name, expected, f"shape {array.shape}")
    if not np.isfinite(array).all():
        raise NonFiniteError(name, np.flatnonzero(~np.isfinite(array)).tolist())
    return array


def positive(name: str, value: ArrayLike, nv: int | None = None) -> Array:
    """Return a read-only scalar or vector of positive, finite gains, spread over nv joints where nv is given.

    Raises:
        ParameterError: An entry is not a positive finite number, or the shape is neither () nor (nv,).
        DimensionError: They are given for another number of joints.
    """
    array = gain(name, value, "positive", lambda x: x > 0.0)
    return array if nv is None else per_joint(name, array, nv)


def positive_or_infinite(name: str, value: ArrayLike, infinite: str = ": no limit") -> Array:
    """Return a read-only scalar or vector of positive numbers, some of which may be infinite.

    Args:
        name: Parameter's name, for the error.
        value: Scalar or (nv,).
        infinite: What infinity means, for the error.

    Raises:
        ParameterError: Anything else.
    """
    words = f"positive (+inf{infinite}), a scalar or one number per joint"
    try:
        array = np.array(real(name, value, words))
    except DimensionError as error:
        raise ParameterError(name, value, words) from error
    if array.ndim > 1 or not (array > 0.0).all():
        raise ParameterError(name, value, words)
    array.setflags(write=False)
    return array


def positive_or(name: str, value: ArrayLike | None, default: Array) -> Array:
    """Return positive gains for every joint, or a default where none are given, shape (nv,).

    Raises:
        ParameterError: An entry is not a positive finite number.
        DimensionError: They are given for another number of joints.
    """
    return default if value is None else np.array(positive(name, value, len(default)))


def positive_number(name: str, value: Any, meaning: str) -> float:
    """Return a single positive, finite number.

    Args:
        name: Parameter's name, for the error.
        value: What was given.
        meaning: What it is, in words ("control period in seconds").

    Raises:
        ParameterError: It is anything else.
    """
    is_number = isinstance(value, int | float | np.integer | np.floating)
    if not is_number or isinstance(value, bool) or not 0.0 < float(value) < np.inf:
        raise ParameterError(name, value, f"a positive, finite {meaning}")
    return float(value)


def number(name: str, value: ArrayLike, admissible: str, is_admissible: Any) -> float:
    """Return a single, finite number that satisfies a predicate; arguments are those of `gain`.

    Raises:
        ParameterError: It is anything else.
    """
    array = gain(name, value, admissible, is_admissible)
    if array.ndim:
        raise ParameterError(name, value, f"a single number, {admissible}")
    return float(array)


def size(name: str, value: ArrayLike) -> float:
    """Return a single, finite number that is zero or positive.

    Raises:
        ParameterError: It is anything else.
    """
    return number(name, value, "zero or positive", lambda x: x >= 0.0)


def choice(name: str, value: T, choices: Iterable[str]) -> T:
    """Return a value that is one of some names.

    Raises:
        ParameterError: It is none of them.
    """
    names = list(choices)
    if value not in names:
        *others, last = (f'"{each}"' for each in names)
        raise ParameterError(
            name, value, " or ".join([", ".join(others), last] if others else [last])
        )
    return value


def whole_number(name: str, value: Any, at_least: int = 0, meaning: str = "") -> int:
    """Return a whole number that is large enough.

    Args:
        name: Parameter's name, for the error.
        value: What was given.
        at_least: The smallest one allowed, 0 or 1.
        meaning: What it counts, in words, for the error.

    Raises:
        ParameterError: It is anything else.
    """
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or value < at_least:
        words = "a positive whole number" if at_least else "a whole number, 0 or more"
        raise ParameterError(name, value, f"{words}: {meaning}" if meaning else words)
    return int(value)


def read_only(array: Array) -> Array:
    """Return a copy that cannot be written to."""
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def whole_numbers(name: str, value: ArrayLike) -> Array:
    """Return a read-only scalar or per-joint vector of whole numbers from 1 on.

    Args:
        name: Parameter's name, for the error.
        value: Scalar or (nv,).

    Raises:
        ParameterError: Anything else.
    """
    return gain(name, value, "whole, 1 or more,", lambda x: (x >= 1.0) & (x == np.rint(x)))


def gain(name: str, value: ArrayLike, admissible: str, is_admissible: Any) -> Array:
    """Return a read-only scalar or per-joint vector of finite gains that satisfy a predicate.

    Args:
        name: Parameter's name, for the error.
        value: Scalar or (nv,).
        admissible: The admissible set in words.
        is_admissible: Elementwise predicate on the array.

    Returns:
        A read-only copy, shape () or (nv,).

    Raises:
        ParameterError: Outside the admissible set.
    """
    words = f"{admissible} and finite, a scalar or one number per joint"
    try:
        array = np.array(real(name, value, words))
    except DimensionError as error:
        raise ParameterError(name, value, words) from error
    if array.ndim > 1 or not np.isfinite(array).all() or not np.all(is_admissible(array)):
        raise ParameterError(name, value, words)
    array.setflags(write=False)
    return array


def per_joint(name: str, value: Array, nv: int) -> Array:
    """Spread a scalar gain over the joints, or check that there is one for each.

    Raises:
        DimensionError: Neither a scalar nor of shape (nv,).
    """
    if value.shape not in ((), (nv,)):
        raise DimensionError(
            name, f"a scalar or one number per joint, shape (nv,) = ({nv},)", f"shape {value.shape}"
        )
    return np.broadcast_to(value, (nv,))


def check_gains(owner: object, nv: int, **gains: Array) -> None:
    """Check that every gain of an object is a scalar or has one number per joint.

    Args:
        owner: Whose they are.
        nv: Number of joints.
        **gains: The gains by name.

    Raises:
        DimensionError: One is for another number of joints.
    """
    for name, value in gains.items():
        per_joint(f"{type(owner).__name__}.{name}", value, nv)


def not_negative(name: str, value: ArrayLike, nv: int | None = None) -> Array:
    """Return read-only numbers from 0 on, as `positive` does.

    Raises:
        ParameterError: Anything else.
        DimensionError: They are given for another number of joints.
    """
    array = gain(name, value, "zero or positive", lambda x: x >= 0.0)
    return array if nv is None else per_joint(name, array, nv)


def real(name: str, value: ArrayLike, expected: str) -> Array:
    """Convert to native float64 of any shape; complex, bool, text and objects are refused.

    Args:
        name: Argument's name, for the error.
        value: The input; float64 arrays pass without a copy.
        expected: What would be right, in words, for the error.

    Raises:
        DimensionError: Ragged, or of a kind that is no real number.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise DimensionError(name, expected, "a ragged sequence") from error
    if array.dtype.kind not in "fiu":
        raise DimensionError(name, expected, f"dtype {array.dtype}")
    return np.asarray(array, dtype=np.float64, order="C")


def is_finite(value: object) -> bool:
    """Return whether every number in a state or output is finite.

    Args:
        value: An array, a number, or a tuple of such ones; everything that is no number counts as finite.
    """
    value = getattr(value, "rows", value)  # a packed state
    if isinstance(value, tuple):
        return all(map(is_finite, value))
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "f" or isfinite(
            np.vdot(value, value)
        ):  # the quick answer to almost all
            return True
        return bool(np.isfinite(value).all())
    return not isinstance(value, float) or isfinite(value)
