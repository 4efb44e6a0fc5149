"""Parts of a loop that not every run has: compiled for themselves when one is needed, and called by their address.

A kernel that calls one does not contain it, and compiles no longer for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from .compile import keep_on_disk
from .layouts.tables import Held

_WORDS, _INTEGER = ir.IntType(8).as_pointer(), ir.IntType(64)
_NATIVE = ir.FunctionType(_INTEGER, [_WORDS, _INTEGER])
_RULES = {"error_model": "numpy", "boundscheck": False}


def compiled_part(function: Callable[..., int], held: Held) -> int:
    """Compile a part, or load it from the disk, and return its address for `call_part`.

    Args:
        function: Takes what `hold` returns and a whole number, and returns one.
        held: Type of the former.
    """
    made = CFunc(function, ((held, types.int64), types.int64), {}, _RULES)
    keep_on_disk(made, function)
    made.compile()
    _KEPT_ALIVE.append(made)
    return int(made.address or 0)


_KEPT_ALIVE: list[CFunc] = []
"""An address does not own the machine code that is there."""


@intrinsic  # type: ignore[untyped-decorator]
def call_part(typing: Any, address: Any, words: Any, k: Any) -> Any:
    """Call the part at an address with the address of its words and a whole number, and return what it returns."""
    del typing, k

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del context, signature
        at, held, number = arguments
        part = builder.inttoptr(at, _NATIVE.as_pointer())
        return builder.call(part, [builder.inttoptr(held, _WORDS), number])

    return types.int64(address, words, types.int64), emit
