"""Python objects on their way into a kernel and out of it.

To take named tuples apart in Python, and to make an array and two objects there, costs as much as the tick. The kernels
do it themselves: they look into objects whose one slot holds numbers as bytes, and into named tuples of vectors, and
make such objects by Python's C API. What comes in is checked first; anything else is a `TypeError`.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.extending import NativeValue, box, intrinsic, register_model, unbox

from .arrays import (
    BYTE,
    HEAD,
    POINTER,
    SIZE,
    Borrowed,
    BorrowedModel,
    address_of,
    field,
    fill,
    is_instance,
    is_plain_array,
    put_array,
    symbol_of,
)

_PACKED = ir.LiteralStructType([*HEAD, POINTER])
_BYTES = ir.LiteralStructType([*HEAD, SIZE, SIZE, BYTE])
_MORE_HEAD = ir.ArrayType(BYTE, tuple.__basicsize__ - object.__basicsize__ - 8)
_ITEMSIZE = 8
_BLOCK = symbol_of(bytes)


class BlockArgument(Borrowed):
    """Type of a block of numbers: in the one slot of an object, or an array of the caller's, which may be overwritten.

    Args:
        packed: Class of the object.
        columns: Of the block.
    """

    def __init__(self, packed: type, columns: int) -> None:
        self.packed, self.columns = symbol_of(packed), columns
        super().__init__(types.float64, 2)
        self.name = f"block({self.packed}, {columns})"


register_model(BlockArgument)(BorrowedModel)


@unbox(BlockArgument)  # type: ignore[untyped-decorator]
def _unbox_block(kind: BlockArgument, obj: Any, c: Any) -> NativeValue:
    builder = c.builder
    native = c.context.make_array(kind)(c.context, builder)
    fails = cgutils.alloca_once_value(builder, cgutils.true_bit)
    with builder.if_else(is_instance(obj, kind.packed, builder), likely=True) as (packed, other):
        with packed:
            block = field(builder, builder.bitcast(obj, _PACKED.as_pointer()), 2)
            with builder.if_then(_is_bytes(block, builder), likely=True):
                content = builder.bitcast(block, _BYTES.as_pointer())
                rows = builder.udiv(field(builder, content, 2), SIZE(kind.columns * _ITEMSIZE))
                data = cgutils.gep_inbounds(builder, content, 0, 4)
                put_array(kind, native, data, [rows, SIZE(kind.columns)], builder)
                builder.store(cgutils.false_bit, fails)
        with other, builder.if_then(is_plain_array(kind, obj, builder)):
            fill(kind, native, obj, builder)
            builder.store(cgutils.false_bit, fails)
    failed = builder.load(fails)
    with builder.if_then(failed, likely=False):
        c.pyapi.err_set_string("PyExc_TypeError", "not the state of a compiled tick")
    return NativeValue(native._getvalue(), is_error=failed)


def _is_bytes(obj: Any, builder: Any) -> Any:
    """Emit the check of a slot, which may be empty."""
    verdict = cgutils.alloca_once_value(builder, cgutils.false_bit)
    with builder.if_then(cgutils.is_not_null(builder, obj), likely=True):
        builder.store(is_instance(obj, _BLOCK, builder), verdict)
    return builder.load(verdict)


class VectorsArgument(types.UniTuple):  # type: ignore[misc]
    """Type of a named tuple of plain vectors.

    Args:
        named_tuple: Its class.
        vector: Type of a vector.
    """

    def __init__(self, named_tuple: Any, vector: Borrowed) -> None:
        super().__init__(vector, len(named_tuple._fields))
        self.named_tuple = symbol_of(named_tuple)
        self.name = f"vectors({self.named_tuple}, {vector})"

    @property
    def key(self) -> str:
        """What distinguishes two of these types."""
        return str(self.name)

    def __unliteral__(self) -> VectorsArgument:
        return self


register_model(VectorsArgument)(models.UniTupleModel)


def _layout(kind: VectorsArgument) -> Any:
    return ir.LiteralStructType([*HEAD, SIZE, _MORE_HEAD, ir.ArrayType(POINTER, kind.count)])


@unbox(VectorsArgument)  # type: ignore[untyped-decorator]
def _unbox_vectors(kind: VectorsArgument, obj: Any, c: Any) -> NativeValue:
    builder = c.builder
    value = cgutils.alloca_once(builder, c.context.get_value_type(kind))
    fails = cgutils.alloca_once_value(builder, cgutils.true_bit)
    with builder.if_else(_is_named_tuple(kind, obj, builder), likely=True) as (given, other):
        with given:
            content = builder.bitcast(obj, _layout(kind).as_pointer())
            items = cgutils.gep_inbounds(builder, content, 0, 4)
            failed = cgutils.false_bit
            for i in range(kind.count):
                part = c.unbox(kind.dtype, field(builder, items, i))
                builder.store(part.value, cgutils.gep_inbounds(builder, value, 0, i))
                failed = builder.or_(failed, part.is_error)
            builder.store(failed, fails)
        with other:
            c.pyapi.err_set_string("PyExc_TypeError", f"not a {kind.named_tuple}")
    return NativeValue(builder.load(value), is_error=builder.load(fails))


def _is_named_tuple(kind: VectorsArgument, obj: Any, builder: Any) -> Any:
    verdict = cgutils.alloca_once_value(builder, cgutils.false_bit)
    with builder.if_then(is_instance(obj, kind.named_tuple, builder), likely=True):
        size = field(builder, builder.bitcast(obj, _layout(kind).as_pointer()), 2)
        builder.store(builder.icmp_signed("==", size, SIZE(kind.count)), verdict)
    return builder.load(verdict)


class PairResult(types.Type):  # type: ignore[misc]
    """Type of what a kernel returns by `returned`: two objects around one block of numbers; True; or None.

    Args:
        first: Class of the first object.
        second: Class of the second.
    """

    def __init__(self, first: type, second: type) -> None:
        self.classes = symbol_of(first), symbol_of(second)
        super().__init__(f"pair({self.classes})")


NOTHING, DONE, OBJECTS = 0, 1, 2
"""What to return: None, True, or the two objects."""


@register_model(PairResult)
class _PairModel(models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: PairResult) -> None:
        members = [("which", types.int64), ("data", types.voidptr), ("size", types.int64)]
        super().__init__(manager, kind, members)


def returner(kind: PairResult) -> Any:
    """Return the function with which a kernel returns one of the constants above, and the block for the objects."""

    @intrinsic  # type: ignore[untyped-decorator]
    def returned(typing: Any, which: Any, block: Borrowed) -> Any:
        del typing, which

        def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = context.make_array(block)(context, builder, arguments[1])
            native = cgutils.create_struct_proxy(signature.return_type)(context, builder)
            native.which = arguments[0]
            native.data = builder.bitcast(array.data, POINTER)
            native.size = builder.mul(array.nitems, array.itemsize)
            return native._getvalue()

        return kind(types.int64, block), emit

    return returned


@box(PairResult)  # type: ignore[untyped-decorator]
def _box(kind: PairResult, value: Any, c: Any) -> Any:
    builder, api = c.builder, c.pyapi
    native = cgutils.create_struct_proxy(kind)(c.context, builder, value)
    is_nothing = builder.icmp_signed("==", native.which, SIZE(NOTHING))
    word = builder.select(is_nothing, api.borrow_none(), api.get_c_object("_Py_TrueStruct"))
    result = cgutils.alloca_once_value(builder, word)
    makes_objects = builder.icmp_signed("==", native.which, SIZE(OBJECTS))
    with builder.if_else(makes_objects, likely=True) as (objects, other):
        with objects:
            block = api.bytes_from_string_and_size(native.data, native.size)
            builder.store(_pair(kind, block, c), result)
        with other:
            api.incref(word)
    return builder.load(result)


def _pair(kind: PairResult, block: Any, c: Any) -> Any:
    """Emit the making of the two objects around a block, in a tuple; null where memory is out."""
    builder, api = c.builder, c.pyapi
    made = [block, *(_new(symbol, c) for symbol in kind.classes), api.tuple_new(2)]
    pair = cgutils.alloca_once_value(builder, made[-1])
    is_complete = cgutils.true_bit
    for thing in made:
        is_complete = builder.and_(is_complete, cgutils.is_not_null(builder, thing))
    with builder.if_else(is_complete, likely=True) as (complete, incomplete):
        with complete:
            api.incref(block)
            for i, packed in enumerate(made[1:3]):
                slots = builder.bitcast(packed, _PACKED.as_pointer())
                builder.store(block, cgutils.gep_inbounds(builder, slots, 0, 2))
                api.tuple_setitem(made[-1], i, packed)
        with incomplete:
            for thing in made:
                api.decref(thing)
            builder.store(api.get_null_object(), pair)
    return builder.load(pair)


def _new(symbol: str, c: Any) -> Any:
    """Emit the making of an object whose slots are empty."""
    signature = ir.FunctionType(POINTER, [POINTER, SIZE])
    new = cgutils.get_or_insert_function(c.builder.module, signature, "PyType_GenericAlloc")
    return c.builder.call(new, [address_of(symbol, c.builder), SIZE(0)])
