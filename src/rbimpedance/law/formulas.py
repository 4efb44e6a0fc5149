"""Formulas of one joint: functions of plain numbers, from which arrays and compiled code take the law.

Each formula of a surface or a reaching law is one such function: `elementwise` applies it to arrays, joint by joint,
and `control.compiled.formulas` compiles it. It is made of what Numba compiles: arithmetic, `math`, `abs`, `min`,
`max`, conditions, and other functions of this kind. With `select` and `any_of` for its conditions it also runs in
lanes, for eight arms at once; with Python's own it runs for one at a time.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, check_gains
from .._common.conditions import any_of as any_of  # noqa: PLC0414 (part of this module's interface)
from .._common.conditions import select as select  # noqa: PLC0414

Formula: TypeAlias = Callable[..., tuple[float, ...]]
"""Numbers of one joint, the control period dt and the joint's gains to some results."""


def sign(x: float) -> float:
    """Return -1, 0 or 1."""
    return select(x > 0.0, 1.0, select(x < 0.0, -1.0, x))


def signed_power(x: float, p: float) -> float:
    """Return sign(x)·abs(x)^p."""
    return math.copysign(abs(x) ** p, x)


def clip(x: float, low: float, high: float) -> float:
    """Return the number in [low, high] that is nearest to x."""
    return min(max(x, low), high)


def elementwise(formula: Callable[..., Any], results: int, *arguments: ArrayLike) -> Any:
    """Return what a formula gives for arrays, which are broadcast against each other.

    Args:
        formula: Takes and returns numbers.
        results: How many it returns.
        *arguments: Its arguments, each a number or an array.

    Returns:
        An array, or a tuple of `results` arrays if there are several.
    """
    function = _on_arrays(formula, results)
    try:
        given = function(*arguments)
    except ArithmeticError:  # plain numbers raise it where NumPy's become infinite or NaN
        with np.errstate(all="ignore"):
            given = function(*map(_as_numpy_numbers, arguments))
    if results == 1:
        return np.asarray(given, dtype=np.float64)
    return tuple(np.asarray(x, dtype=np.float64) for x in given)


_as_numpy_numbers = np.frompyfunc(np.float64, 1, 1)


@functools.cache
def _on_arrays(formula: Callable[..., Any], results: int) -> Callable[..., Any]:
    taken = len(inspect.signature(formula).parameters)
    function: Callable[..., Any] = np.frompyfunc(formula, taken, results)
    return function


@functools.cache
def gain_names(formula: Formula) -> tuple[str, ...]:
    """Return the names of a formula's gains: its parameters after dt."""
    names = list(inspect.signature(formula).parameters)
    return tuple(names[names.index("dt") + 1 :])


class FormulaPart:
    """A part of the law with one formula for every joint.

    Attributes:
        formula: A function of numbers; its gains are the attributes that its parameters after dt name, each a scalar or
            of shape (nv,). A class gives it as a static method.
    """

    formula: Formula

    @property
    def gains(self) -> dict[str, Array]:
        """Gains of the formula by name, in its order."""
        return {name: getattr(self, name) for name in gain_names(self.formula)}

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, **self.gains)
