"""Eight numbers side by side as one number of compiled code: what is written for a float serves eight worlds at once.

`LANES` is one vector of eight float64; code of arithmetic compiles for it as it stands, and rounds every lane as it
rounds a float. A comparison of lanes is a `MASK`. Conditions are written with `select` and `any_of`, which take floats
and lanes alike. Functions of the C library are called lane by lane.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, register_model

WIDTH = 8

_DOUBLE, _WHOLE, _BIT = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_BITS = ir.VectorType(_BIT, WIDTH)
_NUMBERS = types.Float, types.Integer


class _Vector(types.Type):  # type: ignore[misc]
    """A type of eight values; one value of the scalar kinds becomes eight equal ones."""

    def __init__(self, name: str, scalars: tuple[type, ...]) -> None:
        self.scalars = scalars
        super().__init__(name)

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Return how a scalar becomes eight equal values."""
        del typingctx
        return Conversion.safe if isinstance(other, self.scalars) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Return the type of a variable that is assigned both kinds."""
        del typingctx
        return self if isinstance(other, self.scalars) else None


class Lanes(_Vector):
    """Type of eight numbers."""


class Mask(_Vector):
    """Type of eight truth values."""


LANES, MASK = Lanes("lanes", _NUMBERS), Mask("mask", (types.Boolean,))


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


def splat(builder: Any, x: Any) -> Any:
    """Emit eight times the same value."""
    vector = ir.VectorType(x.type, WIDTH)
    if isinstance(x, ir.Constant):
        return ir.Constant(vector, [x.constant] * WIDTH)
    none = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(none, x, ir.IntType(32)(0))
    return builder.shuffle_vector(
        one, none, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    )


@lower_cast(types.Float, Lanes)  # type: ignore[untyped-decorator]
@lower_cast(types.Integer, Lanes)  # type: ignore[untyped-decorator]
def _number_to_lanes(context: Any, builder: Any, given: Any, wanted: Any, x: Any) -> Any:
    del wanted
    return splat(builder, context.cast(builder, x, given, types.float64))


@lower_cast(types.Boolean, Mask)  # type: ignore[untyped-decorator]
def _truth_to_mask(context: Any, builder: Any, given: Any, wanted: Any, x: Any) -> Any:
    del context, given, wanted
    return splat(builder, builder.trunc(x, _BIT) if x.type != _BIT else x)


# --- operators ------------------------------------------------------------------------------------------------------


def _define(
    function: Any, kind: type, returns: Any, emit: Callable[..., Any], arguments: int = 2
) -> None:
    """Define a function of lanes, or of masks, and of scalars beside at least one of them.

    Args:
        function: Python's function or operator.
        kind: `Lanes` or `Mask`.
        returns: Type of the result.
        emit: Takes the builder and the arguments.
        arguments: How many there are.
    """
    own = LANES if kind is Lanes else MASK

    @infer_global(function)
    class _Typing(AbstractTemplate):  # type: ignore[misc]
        def generic(self, given: Any, named: Any) -> Any:
            del named
            fits = all(x == own or isinstance(x, own.scalars) for x in given)
            if len(given) == arguments and fits and own in given:
                return signature(returns, *[own] * arguments)
            return None

    @lower_builtin(function, *[kind] * arguments)  # type: ignore[untyped-decorator]
    def _lower(context: Any, builder: Any, given: Any, values: Any) -> Any:
        del given
        return emit(context, builder, *values)


def _instruction(name: str) -> Callable[..., Any]:
    return lambda _, builder, *values: getattr(builder, name)(*values)


def _compared(symbol: str) -> Callable[..., Any]:
    name = "fcmp_unordered" if symbol == "!=" else "fcmp_ordered"
    return lambda _, builder, x, y: getattr(builder, name)(symbol, x, y)


def _llvm(name: str) -> Callable[..., Any]:
    """The vector form of one of LLVM's own functions."""

    def emit(context: Any, builder: Any, *values: Any) -> Any:
        del context
        kind = ir.FunctionType(VECTOR, [VECTOR] * len(values))
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v8f64")
        return builder.call(function, values)

    return emit


def _lane_by_lane(function: Any) -> Callable[..., Any]:
    """What the scalar function gives, lane by lane."""

    def emit(context: Any, builder: Any, *values: Any) -> Any:
        given = signature(types.float64, *[types.float64] * len(values))
        kind = context.typing_context.resolve_value_type(function)
        kind.get_call_type(context.typing_context, given.args, {})
        scalar, result = context.get_function(kind, given), ir.Constant(VECTOR, ir.Undefined)
        for i in map(ir.IntType(32), range(WIDTH)):
            lane = scalar(builder, [builder.extract_element(x, i) for x in values])
            result = builder.insert_element(result, lane, i)
        return result

    return emit


def _extreme(symbol: str) -> Callable[..., Any]:
    """The second where it is beyond the first, as Python's `min` and `max` choose."""
    return lambda _, builder, x, y: builder.select(builder.fcmp_ordered(symbol, y, x), y, x)


_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "truediv": "fdiv"}
for _name, _instruction_name in _ARITHMETIC.items():
    for _operator in (getattr(operator, _name), getattr(operator, f"i{_name}")):
        _define(_operator, Lanes, LANES, _instruction(_instruction_name))
for _name, _symbol in {
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "eq": "==",
    "ne": "!=",
}.items():
    _define(getattr(operator, _name), Lanes, MASK, _compared(_symbol))
for _operator, _name in ((operator.and_, "and_"), (operator.or_, "or_")):
    _define(_operator, Mask, MASK, _instruction(_name))
_define(operator.neg, Lanes, LANES, _instruction("fneg"), 1)
for _function, _name in ((abs, "fabs"), (math.floor, "floor"), (math.sqrt, "sqrt")):
    _define(_function, Lanes, LANES, _llvm(_name), 1)
_define(math.copysign, Lanes, LANES, _llvm("copysign"))
_define(min, Lanes, LANES, _extreme("<"))
_define(max, Lanes, LANES, _extreme(">"))
for _of_one in (math.cos, math.sin, math.tanh, math.asin, math.acos):
    _define(_of_one, Lanes, LANES, _lane_by_lane(_of_one), 1)
for _of_two in (math.pow, math.atan2):
    _define(_of_two, Lanes, LANES, _lane_by_lane(_of_two))


# --- conditions -----------------------------------------------------------------------------------------------------


@intrinsic  # type: ignore[untyped-decorator]
def select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    """A where the condition holds, else b; both are computed."""
    del typing, a, b
    number = LANES if condition == MASK else types.float64

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        del context, given
        return builder.select(*values)

    return number(condition, number, number), emit


def _across(kind: types.Type, answer: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """Code for what the lanes of a value answer together; a single number or condition answers for itself."""
    return lambda _, builder, given, values: (
        answer(builder, values[0]) if given.args[0] == kind else values[0]
    )


@intrinsic  # type: ignore[untyped-decorator]
def any_of(typing: Any, condition: Any) -> Any:
    """Whether a condition holds, in one lane at least."""
    del typing
    byte = ir.IntType(WIDTH)
    return types.boolean(condition), _across(
        MASK, lambda builder, x: builder.icmp_unsigned("!=", builder.bitcast(x, byte), byte(0))
    )


@intrinsic  # type: ignore[untyped-decorator]
def first_lane(typing: Any, x: Any) -> Any:
    """A number that is the same in all lanes."""
    del typing
    first = ir.IntType(32)(0)
    return types.float64(x), _across(
        LANES, lambda builder, lanes: builder.extract_element(lanes, first)
    )


@intrinsic  # type: ignore[untyped-decorator]
def fma(typing: Any, a: Any, b: Any, c: Any) -> Any:
    """A·b + c of lanes, rounded once."""
    del typing, a, b, c

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        del given
        return _llvm("fma")(context, builder, *values)

    return LANES(LANES, LANES, LANES), emit
