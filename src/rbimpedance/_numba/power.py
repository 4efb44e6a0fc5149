"""x^p for eight lanes at once: the C library takes them one by one, at four times the cost.

Logarithm and exponential are those of fdlibm (its e_log.c and e_exp.c), the former with its rounding error, so that the
result is right to a unit of 2⁻⁵³. Where it or x is not a normal number, the C library takes over.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from .compile import fused, inline
from .lanes import LANES, VECTOR, WIDTH, any_of, fma, select, splat

_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_LOG2_E = 1.44269504088896338700
_LEAST, _LARGEST, _LARGEST_LOG = 2.3e-308, 1.7e308, 700.0


@overload(operator.pow)  # type: ignore[untyped-decorator]
def _power_operator(x: Any, p: Any) -> Any:
    return _power if LANES in (x, p) else None


def _power(x: Any, p: Any) -> Any:
    high, low = _log(x)
    logarithm, left = _product(p, high)
    result = _exp(logarithm, p * low + left)
    is_rare = (x < _LEAST) | (x > _LARGEST) | (x != x) | (abs(logarithm) > _LARGEST_LOG)
    if any_of(is_rare):
        result = select(is_rare, math.pow(x, p), result)
    return result


@inline
def _product(a: float, b: float) -> tuple[float, float]:
    """A·b, and its rounding error: not fused with what follows, which would count that twice."""
    high = a * b
    return high, fma(a, b, -high)


@fused
def _log(x: float) -> tuple[float, float]:
    """The natural logarithm of a normal number, and its rounding error."""
    m, e = _split(x)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    odd = 2.222219843214978396e-01 + w * 1.531383769920937332e-01
    odd = w * (3.999999999940941908e-01 + w * odd)
    even = 1.818357216161805012e-01 + w * 1.479819860511658591e-01
    even = 6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * even)
    half_square = 0.5 * f * f
    left = s * (half_square + (odd + z * even)) + e * _LN2_LOW - half_square
    high = e * _LN2_HIGH + f
    left += (e * _LN2_HIGH - high) + f
    total = high + left
    return total, (high - total) + left


@fused
def _exp(x: float, low: float) -> float:
    """The exponential of x + low."""
    k = math.floor(x * _LOG2_E + 0.5)
    high, left = x - k * _LN2_HIGH, k * _LN2_LOW - low
    r = high - left
    t = r * r
    c = -1.65339022054652515390e-06 + t * 4.13813679705723846039e-08
    c = -2.77777777770155933842e-03 + t * (6.61375632143793436117e-05 + t * c)
    c = r - t * (1.66666666666666019037e-01 + t * c)
    return _scaled(1.0 - ((left - (r * c) / (2.0 - c)) - high), k)  # type: ignore[no-any-return]


_WHOLES = ir.VectorType(ir.IntType(64), WIDTH)
_MAGIC = 0x4338000000000000
"""Bits of 1.5·2⁵²: added to a whole number, and the double subtracted again, they turn it into a double."""


def _wholes(number: int) -> Any:
    return splat(None, ir.IntType(64)(number))


@intrinsic  # type: ignore[untyped-decorator]
def _split(typing: Any, x: Any) -> Any:
    """M in [√½, √2) and the whole number e with x = m·2^e, for a normal positive x."""
    del typing, x

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        bits = builder.bitcast(values[0], _WHOLES)
        above = builder.sub(bits, _wholes(0x3FE6A09E667F3BCD))  # √½
        e = builder.ashr(above, _wholes(52))
        m = builder.bitcast(builder.sub(bits, builder.shl(e, _wholes(52))), VECTOR)
        e = builder.bitcast(builder.add(e, _wholes(_MAGIC)), VECTOR)
        e = builder.fsub(e, builder.bitcast(_wholes(_MAGIC), VECTOR))
        return context.make_tuple(builder, given.return_type, [m, e])

    return types.UniTuple(LANES, 2)(LANES), emit


@intrinsic  # type: ignore[untyped-decorator]
def _scaled(typing: Any, x: Any, k: Any) -> Any:
    """x·2^k for a whole number k."""
    del typing, x, k

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        del context, given
        x, k = values
        whole = builder.bitcast(builder.fadd(k, builder.bitcast(_wholes(_MAGIC), VECTOR)), _WHOLES)
        bits = builder.shl(builder.add(whole, _wholes(1023)), _wholes(52))
        return builder.fmul(x, builder.bitcast(bits, VECTOR))

    return LANES(LANES, LANES), emit
