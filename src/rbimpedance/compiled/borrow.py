"""NumPy arrays as arguments of compiled functions at 2 ns each, where Numba's own way takes 35.

Numba takes a counted reference to every array argument. A kernel here uses its arguments only while it runs, and its
caller holds them meanwhile, so reading the array's C structure is enough (`PyArrayObject_fields` of NumPy's C API, the
same in NumPy 1 and 2). What users hand over is checked in full: exact type, number of dimensions, element type, byte
order, contiguity, alignment, and whether it may be written to. Anything else is a `TypeError` before the kernel starts.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.extending import NativeValue, register_model, unbox

_BYTE, _INT, _SIZE = ir.IntType(8), ir.IntType(32), ir.IntType(64)
_POINTER = _BYTE.as_pointer()

_HEAD = [
    ir.ArrayType(_BYTE, object.__basicsize__ - 8),
    _POINTER,
]  # the type is the last word of every object's head
_ARRAY = ir.LiteralStructType(
    [*_HEAD, _POINTER, _INT, _SIZE.as_pointer(), _SIZE.as_pointer(), _POINTER, _POINTER, _INT]
)
_TYPE, _DATA, _NDIM, _SHAPE, _DTYPE, _FLAGS = 1, 2, 3, 4, 7, 8
_DESCRIPTOR = ir.LiteralStructType([*_HEAD, _POINTER, *[_BYTE] * 4, _INT])
_BYTE_ORDER, _TYPE_NUMBER = 5, 7

_C_CONTIGUOUS, _ALIGNED, _WRITEABLE = 0x0001, 0x0100, 0x0400
_FOREIGN_ORDER = ">" if sys.byteorder == "little" else "<"

_NDARRAY = "rbimpedance.ndarray"
binding.add_symbol(
    _NDARRAY, id(np.ndarray)
)  # resolved when code is loaded, so that it can be kept on disk


class Borrowed(types.Array):  # type: ignore[misc]
    """Type of an array that is borrowed for one call.

    Args:
        dtype: Numba's type of the elements.
        ndim: Number of dimensions.
        readonly: Whether read-only arrays are welcome; the kernel then cannot write to it.
        trusted: Whether the library itself made the array, so that nothing needs to be checked.
    """

    def __init__(
        self, dtype: types.Type, ndim: int, readonly: bool = False, trusted: bool = False
    ) -> None:
        self.trusted = trusted
        words = ("readonly" if readonly else "mutable") + (", trusted" if trusted else "")
        super().__init__(
            dtype, ndim, "C", readonly=readonly, name=f"borrowed({dtype}, {ndim}d, {words})"
        )

    @property
    def key(self) -> str:
        """What tells two of these types apart."""
        return str(self.name)


@register_model(Borrowed)
class _BorrowedModel(models.ArrayModel):  # type: ignore[misc]
    """Numba's array structure, of which no references are counted."""

    def traverse(self, builder: Any) -> list[Any]:
        """Return the parts that own memory: none."""
        del builder
        return []


@unbox(Borrowed)  # type: ignore[untyped-decorator]
def _unbox(kind: Borrowed, obj: Any, c: Any) -> NativeValue:
    """Emit the code that turns a NumPy array into Numba's array structure, without a reference to it."""
    builder = c.builder
    native = c.context.make_array(kind)(c.context, builder)
    array = builder.bitcast(obj, _ARRAY.as_pointer())
    if kind.trusted:
        _fill(kind, native, array, builder)
        return NativeValue(native._getvalue())
    fails = cgutils.alloca_once_value(builder, cgutils.true_bit)
    with builder.if_then(_is_array(array, builder), likely=True):  # noqa: SIM117 (nested blocks of code)
        with builder.if_then(_is_as_declared(kind, array, builder), likely=True):
            _fill(kind, native, array, builder)
            builder.store(cgutils.false_bit, fails)
    failed = builder.load(fails)
    with builder.if_then(failed, likely=False):
        c.pyapi.err_set_string("PyExc_TypeError", f"not a plain NumPy array, {kind}")
    return NativeValue(native._getvalue(), is_error=failed)


def _field(builder: Any, structure: Any, index: int) -> Any:
    return builder.load(cgutils.gep_inbounds(builder, structure, 0, index))


def _is_array(array: Any, builder: Any) -> Any:
    known = builder.module.globals.get(_NDARRAY)
    ndarray = known or cgutils.add_global_variable(builder.module, _BYTE, _NDARRAY)
    return builder.icmp_unsigned("==", _field(builder, array, _TYPE), ndarray)


def _is_as_declared(kind: Borrowed, array: Any, builder: Any) -> Any:
    """Emit the checks; one bit."""
    number = np.dtype(str(kind.dtype)).num
    required = _C_CONTIGUOUS | _ALIGNED | (_WRITEABLE if kind.mutable else 0)
    descriptor = builder.bitcast(_field(builder, array, _DTYPE), _DESCRIPTOR.as_pointer())
    flags = builder.and_(_field(builder, array, _FLAGS), _INT(required))
    order = _field(builder, descriptor, _BYTE_ORDER)
    checks = (
        builder.icmp_signed("==", _field(builder, array, _NDIM), _INT(kind.ndim)),
        builder.icmp_signed("==", flags, _INT(required)),
        builder.icmp_signed("==", _field(builder, descriptor, _TYPE_NUMBER), _INT(number)),
        builder.icmp_signed("!=", order, _BYTE(ord(_FOREIGN_ORDER))),
    )
    verdict = checks[0]
    for check in checks[1:]:
        verdict = builder.and_(verdict, check)
    return verdict


def _fill(kind: Borrowed, native: Any, array: Any, builder: Any) -> None:
    """Emit the copy of pointer and shape; the strides follow from contiguity."""
    itemsize = _SIZE(np.dtype(str(kind.dtype)).itemsize)
    shape = _field(builder, array, _SHAPE)
    lengths = [builder.load(cgutils.gep(builder, shape, i)) for i in range(kind.ndim)]
    strides = [itemsize]
    for length in lengths[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    count = _SIZE(1)
    for length in lengths:
        count = builder.mul(count, length)
    native.meminfo = cgutils.get_null_value(native.meminfo.type)
    native.parent = cgutils.get_null_value(native.parent.type)
    native.nitems = count
    native.itemsize = itemsize
    native.data = builder.bitcast(_field(builder, array, _DATA), native.data.type)
    native.shape = cgutils.pack_array(builder, lengths)
    native.strides = cgutils.pack_array(builder, strides)
