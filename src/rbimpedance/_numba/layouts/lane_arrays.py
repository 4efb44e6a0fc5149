"""Arrays whose elements are lanes: NumPy arrays of float64 whose last axis is the world."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.imputils import lower_builtin, lower_getattr
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import NativeValue, intrinsic, register_model, unbox

from ..._common.arrays import Array
from ..lanes import LANES, VECTOR, WIDTH, Lanes
from .arrays import address_of_data, lengths_of

ALIGNMENT = 64
"""Of the memory of such an array, in bytes."""


class LaneArray(types.Type):  # type: ignore[misc]
    """Type of a vector or a matrix of lanes; the library itself makes all of them.

    Args:
        ndim: 1 or 2, without the axis of the lanes.
    """

    def __init__(self, ndim: int) -> None:
        self.ndim = ndim
        super().__init__(f"lane_array({ndim}d)")

    @property
    def index(self) -> types.Type:
        """Type of an index."""
        return types.intp if self.ndim == 1 else types.UniTuple(types.intp, 2)


LANE_VECTOR, LANE_MATRIX = LaneArray(1), LaneArray(2)


class LaneNumbers(np.ndarray[Any, np.dtype[np.float64]]):
    """An array in which the last axis are the lanes; it marks what compiled code takes as a `LaneArray`."""


def lane_array(*shape: int) -> Array:
    """Return zeros, aligned for lanes, with the lanes as an axis more."""
    count = int(np.prod(shape)) * WIDTH
    memory = np.zeros(count + WIDTH)
    skipped = -memory.ctypes.data % ALIGNMENT // memory.itemsize
    return memory[skipped : skipped + count].reshape(*shape, WIDTH).view(LaneNumbers)


@register_model(LaneArray)
class _LaneArrayModel(models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: LaneArray) -> None:
        shape = types.UniTuple(types.intp, kind.ndim)
        super().__init__(manager, kind, [("data", types.voidptr), ("shape", shape)])


@unbox(LaneArray)  # type: ignore[untyped-decorator]
def _unbox(kind: LaneArray, obj: Any, c: Any) -> NativeValue:
    native = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    native.data = address_of_data(c.builder, obj)
    native.shape = cgutils.pack_array(c.builder, lengths_of(obj, kind.ndim, c.builder))
    return NativeValue(native._getvalue())


@infer_getattr
class _Attributes(AttributeTemplate):  # type: ignore[misc]
    key = LaneArray

    def resolve_shape(self, kind: LaneArray) -> types.Type:
        return types.UniTuple(types.intp, kind.ndim)


@lower_getattr(LaneArray, "shape")  # type: ignore[untyped-decorator]
def _shape(context: Any, builder: Any, kind: LaneArray, value: Any) -> Any:
    return cgutils.create_struct_proxy(kind)(context, builder, value).shape


@infer_global(len)
class _LenTyping(AbstractTemplate):  # type: ignore[misc]
    def generic(self, given: Any, named: Any) -> Any:
        del named
        return signature(types.intp, *given) if isinstance(given[0], LaneArray) else None


@lower_builtin(len, LaneArray)  # type: ignore[untyped-decorator]
def _len(context: Any, builder: Any, given: Any, values: Any) -> Any:
    shape = _shape(context, builder, given.args[0], values[0])
    return builder.extract_value(shape, 0)


@infer_global(operator.getitem)
class _GetTyping(AbstractTemplate):  # type: ignore[misc]
    def generic(self, given: Any, named: Any) -> Any:
        del named
        if isinstance(given[0], LaneArray):
            return signature(LANES, given[0], given[0].index)
        return None


@infer_global(operator.setitem)
class _SetTyping(AbstractTemplate):  # type: ignore[misc]
    def generic(self, given: Any, named: Any) -> Any:
        del named
        if isinstance(given[0], LaneArray):
            return signature(types.none, given[0], given[0].index, LANES)
        return None


@lower_builtin(operator.getitem, LaneArray, types.Any)  # type: ignore[untyped-decorator]
def _get(context: Any, builder: Any, given: Any, values: Any) -> Any:
    address = element_address(context, builder, given.args[0], *values)
    return builder.load(address, align=ALIGNMENT)


@lower_builtin(operator.setitem, LaneArray, types.Any, Lanes)  # type: ignore[untyped-decorator]
def _set(context: Any, builder: Any, given: Any, values: Any) -> Any:
    array, index, lanes = values
    address = element_address(context, builder, given.args[0], array, index)
    builder.store(lanes, address, align=ALIGNMENT)
    return context.get_dummy_value()


def element_address(context: Any, builder: Any, kind: LaneArray, array: Any, index: Any) -> Any:
    """Emit the address of an element.

    Args:
        context: Numba's.
        builder: Numba's.
        kind: Type of the array.
        array: The array.
        index: Its index, of the type `kind.index`.
    """
    native = cgutils.create_struct_proxy(kind)(context, builder, array)
    if kind.ndim == 2:
        row, column = index if isinstance(index, tuple) else cgutils.unpack_tuple(builder, index)
        index = builder.add(builder.mul(row, builder.extract_value(native.shape, 1)), column)
    data = builder.bitcast(native.data, VECTOR.as_pointer())
    return builder.gep(data, [index], inbounds=True)


def columns(context: Any, builder: Any, kind: Any, array: Any) -> tuple[Any, Any]:
    """Emit the address of a matrix of floats or lanes, and how many floats are in a row of it."""
    if not isinstance(kind, LaneArray):
        matrix = context.make_array(kind)(context, builder, array)
        return matrix.data, builder.extract_value(matrix.shape, 1)
    native = cgutils.create_struct_proxy(kind)(context, builder, array)
    lanes = builder.extract_value(native.shape, 1)
    data = builder.bitcast(native.data, ir.DoubleType().as_pointer())
    return data, builder.mul(lanes, lanes.type(WIDTH))


@intrinsic  # type: ignore[untyped-decorator]
def lane_matrix(typing: Any, pointer: Any, rows: Any, columns: Any) -> Any:
    """Numbers at an address as a matrix of lanes."""
    del typing, rows, columns

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        del given
        native = cgutils.create_struct_proxy(LANE_MATRIX)(context, builder)
        native.data = builder.bitcast(values[0], native.data.type)
        native.shape = cgutils.pack_array(builder, values[1:])
        return native._getvalue()

    return LANE_MATRIX(pointer, types.intp, types.intp), emit


@intrinsic  # type: ignore[untyped-decorator]
def lane_column(typing: Any, matrix: Any, column: Any, count: Any) -> Any:
    """The first entries of a column as a tuple; their count is a literal."""
    del typing, matrix, column
    if not isinstance(count, types.IntegerLiteral):
        return None
    number = count.literal_value

    def emit(context: Any, builder: Any, given: Any, values: Any) -> Any:
        addresses = [
            element_address(
                context, builder, LANE_MATRIX, values[0], (values[1].type(i), values[1])
            )
            for i in range(number)
        ]
        lanes = [builder.load(address, align=ALIGNMENT) for address in addresses]
        return context.make_tuple(builder, given.return_type, lanes)

    return types.UniTuple(LANES, number)(LANE_MATRIX, types.intp, count), emit
