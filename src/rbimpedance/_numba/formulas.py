"""Formulas of one joint, compiled into loops over the joints that every kernel calls by their address.

A kernel therefore does not contain the formula: one kernel serves all surfaces and reaching laws, the user's own, too.
"""

from __future__ import annotations

import functools
import inspect
import types as python
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from .._common import conditions
from . import (
    lanes,
    power,  # noqa: F401 (defines the power of lanes)
)
from .compile import inline, keep_on_disk
from .layouts.lane_arrays import columns

_NUMBERS, _NUMBER = types.CPointer(types.float64), types.float64
_LOOP = types.void(types.intp, _NUMBERS, _NUMBER, _NUMBERS, _NUMBERS)
_RULES = {"error_model": "numpy", "boundscheck": False}
_DOUBLE = ir.DoubleType()
_NATIVE = ir.FunctionType(
    ir.VoidType(),
    [ir.IntType(64), _DOUBLE.as_pointer(), _DOUBLE, _DOUBLE.as_pointer(), _DOUBLE.as_pointer()],
)


@intrinsic  # type: ignore[untyped-decorator]
def call_loop(
    typing: Any, address: Any, rows: Any, first: Any, dt: Any, gains: Any, result: Any
) -> Any:
    """Call a loop at an address, on a matrix with a column for each joint.

    It takes the number of the first row that the loop is given, dt, the gains, a row for each, and the number of the
    first row of results. A matrix of lanes has eight columns for each joint.
    """
    del typing, first, result

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        at, _, given, dt, _, results = arguments
        matrix, joints = columns(context, builder, signature.args[1], arguments[1])
        own, _ = columns(context, builder, signature.args[4], arguments[4])

        def row(k: Any) -> Any:
            return builder.gep(matrix, [builder.mul(k, joints)])

        loop = builder.inttoptr(at, _NATIVE.as_pointer())
        builder.call(loop, [joints, row(given), dt, own, row(results)])
        return context.get_dummy_value()

    return types.void(address, rows, types.intp, dt, gains, types.intp), emit


def compiled_loop(loop: Callable[..., None], formula: Callable[..., Any], form: str) -> CFunc:
    """Compile a loop, or load it from the disk if its formula is one of the package.

    Args:
        loop: Around the formula: takes the number of joints, and pointers to what `call_loop` is given.
        formula: The formula.
        form: What it is compiled for.
    """
    made = CFunc(loop, (_LOOP.args, _LOOP.return_type), {}, _RULES)
    if formula.__module__.partition(".")[0] == __name__.partition(".")[0]:
        keep_on_disk(made, loop, f"{formula.__module__}.{formula.__qualname__} {form}")
    made.compile()
    return made


_NATIVE_FORMS: dict[Any, Any] = {
    conditions.select: lanes.select,
    conditions.any_of: lanes.any_of,
}


@functools.cache
def helper(function: Callable[..., Any]) -> Any:
    """Compile a plain function into its callers, with the plain functions that it calls, in strict IEEE arithmetic."""

    def ready(value: Any) -> Any:
        if not inspect.isfunction(value):
            return value
        return _NATIVE_FORMS.get(value) or helper(value)

    used = inspect.getclosurevars(function).globals
    cells = [python.CellType(ready(cell.cell_contents)) for cell in function.__closure__ or ()]
    own = python.FunctionType(
        function.__code__,
        function.__globals__ | {name: ready(value) for name, value in used.items()},
        function.__name__,
        function.__defaults__,
        tuple(cells),
    )
    return inline(own)
