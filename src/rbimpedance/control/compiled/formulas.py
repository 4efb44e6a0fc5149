"""Surfaces and reaching laws in compiled code: the formulas of `law`, each in a loop over the joints."""

from __future__ import annotations

import functools
from typing import Any

from numba import carray
from numba.np.unsafe.ndarray import to_fixed_tuple

from ..._numba.formulas import compiled_loop, helper
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


def surface_address(formula: Formula) -> int:
    """Return the address of a surface's loop: e1 and e2 to feed-forward, gain and s, see `call_loop`."""
    return int(_surface(formula).address)


def reaching_address(formula: Formula) -> int:
    """Return the address of a reaching law's loop: s, z, x and a to u and the next z, x and a."""
    return int(_reaching(formula).address)


@functools.cache
def _surface(formula: Formula) -> Any:
    joint, count = helper(formula), len(gain_names(formula))

    def loop(n: int, given: Any, dt: float, gains: Any, results: Any) -> None:
        e, own, r = carray(given, (2, n)), carray(gains, (count, n)), carray(results, (3, n))
        for j in range(n):
            numbers = to_fixed_tuple(own[:, j], count)
            r[2, j], r[0, j], r[1, j] = joint(e[0, j], e[1, j], dt, *numbers)

    return compiled_loop(loop, formula)


@functools.cache
def _reaching(formula: Formula) -> Any:
    joint, count = helper(formula), len(gain_names(formula))

    def loop(n: int, given: Any, dt: float, gains: Any, results: Any) -> None:
        m, own, r = carray(given, (4, n)), carray(gains, (count, n)), carray(results, (4, n))
        for j in range(n):
            numbers = to_fixed_tuple(own[:, j], count)
            memory = m[0, j], m[1, j], m[2, j], m[3, j]
            r[0, j], r[1, j], r[2, j], r[3, j] = joint(*memory, dt, *numbers)

    return compiled_loop(loop, formula)
