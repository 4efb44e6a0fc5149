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

BYTE, SIZE = ir.IntType(8), ir.IntType(64)
POINTER = BYTE.as_pointer()
_INT = ir.IntType(32)

HEAD = [
    ir.ArrayType(BYTE, object.__basicsize__ - 8),
    POINTER,
]  # the type is the last word of every object's head
_ARRAY = ir.LiteralStructType(
    [*HEAD, POINTER, _INT, SIZE.as_pointer(), SIZE.as_pointer(), POINTER, POINTER, _INT]
)
_DATA, _NDIM, _SHAPE, _DTYPE, _FLAGS = 2, 3, 4, 7, 8
_DESCRIPTOR = ir.LiteralStructType([*HEAD, POINTER, *[BYTE] * 4, _INT])
_BYTE_ORDER, _TYPE_NUMBER = 5, 7

_C_CONTIGUOUS, _ALIGNED, _WRITEABLE = 0x0001, 0x0100, 0x0400
_FOREIGN_ORDER = ">" if sys.byteorder == "little" else "<"


def symbol_of(kind: type) -> str:
    """Return the name under which compiled code finds a type, which is looked up each time that the code is loaded.

    Call it when a module is imported: code from the disk is loaded without being compiled again.
    """
    symbol = f"rbimpedance.{kind.__module__}.{kind.__qualname__}"
    binding.add_symbol(symbol, id(kind))
    return symbol


_NDARRAY = symbol_of(np.ndarray)


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
        """What distinguishes two of these types."""
        return str(self.name)


@register_model(Borrowed)
class BorrowedModel(models.ArrayModel):  # type: ignore[misc]
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
    if kind.trusted:
        fill(kind, native, obj, builder)
        return NativeValue(native._getvalue())
    fails = cgutils.alloca_once_value(builder, cgutils.true_bit)
    with builder.if_then(is_plain_array(kind, obj, builder), likely=True):
        fill(kind, native, obj, builder)
        builder.store(cgutils.false_bit, fails)
    failed = builder.load(fails)
    with builder.if_then(failed, likely=False):
        c.pyapi.err_set_string("PyExc_TypeError", f"not a plain NumPy array, {kind}")
    return NativeValue(native._getvalue(), is_error=failed)


def is_instance(obj: Any, symbol: str, builder: Any) -> Any:
    """Emit the comparison of an object's own type with another; one bit.

    Args:
        obj: Pointer to the object.
        symbol: Name of the type, from `symbol_of`.
        builder: Numba's.
    """
    head = builder.bitcast(obj, ir.LiteralStructType(HEAD).as_pointer())
    return builder.icmp_unsigned("==", field(builder, head, 1), address_of(symbol, builder))


def address_of(symbol: str, builder: Any) -> Any:
    """Emit the address of a type."""
    known = builder.module.globals.get(symbol)
    return known or cgutils.add_global_variable(builder.module, BYTE, symbol)


def is_plain_array(kind: Borrowed, obj: Any, builder: Any) -> Any:
    """Emit the checks that an object is an array as declared; one bit."""
    verdict = cgutils.alloca_once_value(builder, cgutils.false_bit)
    with builder.if_then(is_instance(obj, _NDARRAY, builder), likely=True):
        builder.store(_is_as_declared(kind, obj, builder), verdict)
    return builder.load(verdict)


def address_of_data(builder: Any, obj: Any) -> Any:
    """Emit the code that finds where an array, which has to be one, keeps its elements."""
    return field(builder, builder.bitcast(obj, _ARRAY.as_pointer()), _DATA)


def field(builder: Any, structure: Any, index: int) -> Any:
    """Emit the reading of one field."""
    return builder.load(cgutils.gep_inbounds(builder, structure, 0, index))


def _is_as_declared(kind: Borrowed, obj: Any, builder: Any) -> Any:
    array = builder.bitcast(obj, _ARRAY.as_pointer())
    number = np.dtype(str(kind.dtype)).num
    required = _C_CONTIGUOUS | _ALIGNED | (_WRITEABLE if kind.mutable else 0)
    descriptor = builder.bitcast(field(builder, array, _DTYPE), _DESCRIPTOR.as_pointer())
    flags = builder.and_(field(builder, array, _FLAGS), _INT(required))
    order = field(builder, descriptor, _BYTE_ORDER)
    checks = (
        builder.icmp_signed("==", field(builder, array, _NDIM), _INT(kind.ndim)),
        builder.icmp_signed("==", flags, _INT(required)),
        builder.icmp_signed("==", field(builder, descriptor, _TYPE_NUMBER), _INT(number)),
        builder.icmp_signed("!=", order, BYTE(ord(_FOREIGN_ORDER))),
    )
    verdict = checks[0]
    for check in checks[1:]:
        verdict = builder.and_(verdict, check)
    return verdict


def fill(kind: Borrowed, native: Any, obj: Any, builder: Any) -> None:
    """Emit the copy of an array's address and shape to Numba's structure."""
    lengths = lengths_of(obj, kind.ndim, builder)
    put_array(kind, native, address_of_data(builder, obj), lengths, builder)


def lengths_of(obj: Any, ndim: int, builder: Any) -> list[Any]:
    """Emit the code that reads the lengths of the first axes of an array, which has to be one."""
    shape = field(builder, builder.bitcast(obj, _ARRAY.as_pointer()), _SHAPE)
    return [builder.load(cgutils.gep(builder, shape, i)) for i in range(ndim)]


def put_array(kind: Borrowed, native: Any, data: Any, lengths: list[Any], builder: Any) -> None:
    """Emit Numba's structure of an array; the strides follow from contiguity."""
    itemsize = SIZE(np.dtype(str(kind.dtype)).itemsize)
    strides = [itemsize]
    for length in lengths[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    count = SIZE(1)
    for length in lengths:
        count = builder.mul(count, length)
    native.meminfo = cgutils.get_null_value(native.meminfo.type)
    native.parent = cgutils.get_null_value(native.parent.type)
    native.nitems = count
    native.itemsize = itemsize
    native.data = builder.bitcast(data, native.data.type)
    native.shape = cgutils.pack_array(builder, lengths)
    native.strides = cgutils.pack_array(builder, strides)
