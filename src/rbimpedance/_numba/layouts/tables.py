"""Tables that a kernel is given at every call, as one argument instead of one for each array.

In compiled code an array is a short row of words: address, shape, strides. For tables that never move, those words are
written down once, in the order in which a named tuple of arrays has them, and a kernel reads them from there: no array
is looked at again, and what a kernel does not use costs nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel import models
from numba.extending import NativeValue, intrinsic, register_model, unbox

from .arrays import address_of_data


class Held(types.Type):  # type: ignore[misc]
    """Type of what `hold` returns; `opened` takes a kernel to the tables.

    Args:
        content: Type of the named tuple.
    """

    def __init__(self, content: types.NamedTuple) -> None:
        self.content = content
        super().__init__(f"held({content})")


@register_model(Held)
class _HeldModel(models.PrimitiveModel):  # type: ignore[misc]
    """Address of the words."""

    def __init__(self, manager: Any, kind: Held) -> None:
        super().__init__(manager, kind, ir.IntType(8).as_pointer())


@unbox(Held)  # type: ignore[untyped-decorator]
def _unbox(kind: Held, obj: Any, c: Any) -> NativeValue:
    """Emit the code that finds the words."""
    del kind
    return NativeValue(address_of_data(c.builder, obj))


@intrinsic  # type: ignore[untyped-decorator]
def opened(typing: Any, held: Held) -> Any:
    """Return the named tuple."""
    del typing

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        layout = context.get_value_type(signature.return_type).as_pointer()
        return builder.load(builder.bitcast(arguments[0], layout))

    return held.content(held), emit


class _Words(np.ndarray[Any, Any]):
    """Words that keep alive what they point to."""

    tables: Any


def hold(tables: tuple[Any, ...]) -> Any:
    """Return the words of a named tuple of such named tuples or contiguous arrays, for an argument of type `Held`."""
    words = np.array(_words(tables)).view(_Words)
    words.tables = tables
    return words


def _words(part: Any) -> list[int]:
    if isinstance(part, tuple):
        return [word for member in part for word in _words(member)]
    no_references = 0, 0
    address = part.ctypes.data
    return [*no_references, part.size, part.itemsize, address, *part.shape, *part.strides]
