"""Surfaces and reaching laws in compiled code: the formulas of `law`, each in a loop over the joints."""

from __future__ import annotations

import functools
from typing import Any

from numba import carray
from numba.np.unsafe.ndarray import to_fixed_tuple

from ..._numba.compile import inline
from ..._numba.formulas import compiled_loop, helper
from ..._numba.lanes import WIDTH
from ..._numba.layouts.lane_arrays import lane_column, lane_matrix
from ...law.baseline_formulas import RESULTS, input_names
from ...law.formulas import Formula, gain_names
from ...law.super_twisting import FormulaReaching, SuperTwisting


def is_formula(reaching: Any) -> bool:
    """Whether a reaching law is what its formula says; see `has_formula` for surfaces."""
    law = type(reaching)
    return (
        isinstance(reaching, FormulaReaching)
        and law.start is FormulaReaching.start
        and law.step is FormulaReaching.step
        and law.anti_windup in (FormulaReaching.anti_windup, SuperTwisting.anti_windup)
    )


def surface_address(formula: Formula, in_lanes: bool = False) -> int:
    """Return the address of a surface's loop: e1 and e2 to feed-forward, gain and s, see `call_loop`.

    Args:
        formula: The surface's.
        in_lanes: Whether it is for matrices of lanes, which take a formula without conditions of its own.
    """
    return int(_surface(formula, in_lanes).address)


def reaching_address(formula: Formula, in_lanes: bool = False) -> int:
    """Return the address of a reaching law's loop: s, z, x and a to u and the next z, x and a.

    Args:
        formula: The reaching law's.
        in_lanes: See `surface_address`.
    """
    return int(_reaching(formula, in_lanes).address)


def baseline_address(formula: Formula) -> int:
    """Return the address of a baseline's loop: what its formula takes to what it gives, a row for each.

    Args:
        formula: One of `law.baseline_formulas`.
    """
    return int(_baseline(formula).address)


@functools.cache
def _baseline(formula: Formula) -> Any:
    joint, count, matrix, column = _parts(formula, in_lanes=False)
    taken = len(input_names(formula))

    def loop(n: int, given: Any, dt: float, gains: Any, results: Any) -> None:
        m, own, r = matrix(given, taken, n), matrix(gains, count, n), matrix(results, RESULTS, n)
        for j in range(m.shape[1]):
            numbers = joint(*column(m, j, taken), dt, *column(own, j, count))
            r[0, j], r[1, j], r[2, j], r[3, j], r[4, j], r[5, j] = numbers

    return compiled_loop(loop, formula, "joint by joint")


@functools.cache
def _surface(formula: Formula, in_lanes: bool) -> Any:
    joint, count, matrix, column = _parts(formula, in_lanes)

    def loop(n: int, given: Any, dt: float, gains: Any, results: Any) -> None:
        e, own, r = matrix(given, 2, n), matrix(gains, count, n), matrix(results, 3, n)
        for j in range(e.shape[1]):
            numbers = column(own, j, count)
            r[2, j], r[0, j], r[1, j] = joint(e[0, j], e[1, j], dt, *numbers)

    return compiled_loop(loop, formula, "in lanes" if in_lanes else "joint by joint")


@functools.cache
def _reaching(formula: Formula, in_lanes: bool) -> Any:
    joint, count, matrix, column = _parts(formula, in_lanes)

    def loop(n: int, given: Any, dt: float, gains: Any, results: Any) -> None:
        m, own, r = matrix(given, 4, n), matrix(gains, count, n), matrix(results, 4, n)
        for j in range(m.shape[1]):
            numbers = column(own, j, count)
            memory = m[0, j], m[1, j], m[2, j], m[3, j]
            r[0, j], r[1, j], r[2, j], r[3, j] = joint(*memory, dt, *numbers)

    return compiled_loop(loop, formula, "in lanes" if in_lanes else "joint by joint")


def _parts(formula: Formula, in_lanes: bool) -> tuple[Any, ...]:
    """The formula, the number of its gains, and how its loop looks at memory."""
    views = (_lanes, lane_column) if in_lanes else (_floats, _float_column)
    return helper(formula), len(gain_names(formula)), *views


@inline
def _floats(pointer: Any, rows: int, n: int) -> Any:
    return carray(pointer, (rows, n))


@inline
def _float_column(matrix: Any, j: int, count: int) -> Any:
    return to_fixed_tuple(matrix[:, j], count)


@inline
def _lanes(pointer: Any, rows: int, n: int) -> Any:
    return lane_matrix(pointer, rows, n // WIDTH)
