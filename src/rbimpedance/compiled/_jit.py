"""How the kernels are compiled: with which floating-point rules, kept on disk how, called from Python how.

This module imports Numba; nothing outside `compiled` does, and `compiled` itself only once a kernel is asked for.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from numba import njit, types
from numba.core.caching import FunctionCache

Function = TypeVar("Function", bound=Callable[..., Any])

_RULES: Any = {"error_model": "numpy", "boundscheck": False, "nogil": False}


def inline(function: Function) -> Function:
    """Compile a helper into its callers, in strict IEEE arithmetic."""
    return njit(forceinline=True, **_RULES)(function)  # type: ignore[no-any-return]


def fused(function: Function) -> Function:
    """The same, with a·b + c rounded once: it is more exact, not less, and a third faster.

    No other relaxation is allowed: terms are not reordered, and NaN, infinity and the sign of zero keep their meaning.
    """
    return njit(forceinline=True, fastmath={"contract", "nsz"}, **_RULES)(function)  # type: ignore[no-any-return]


def routine(function: Function) -> Function:
    """Compile a routine that kernels call; rounding as in `fused`."""
    return njit(fastmath={"contract", "nsz"}, **_RULES)(function)  # type: ignore[no-any-return]


def kernel(function: Callable[..., Any], arguments: tuple[types.Type, ...]) -> Callable[..., Any]:
    """Compile a function for the given argument types, or load it from the disk, ready to be called from Python.

    The call goes to Numba's entry point and not through its dispatcher: argument types are not looked at again.

    Args:
        function: The function; it returns an integer.
        arguments: Types of its arguments.
    """
    dispatcher = njit(**_RULES)(function)
    with contextlib.suppress(RuntimeError):  # no folder can be written to: compile in every process
        dispatcher._cache = _PackageCache(function)
    dispatcher.compile(types.int64(*arguments))
    _KEPT_ALIVE.append(dispatcher)
    entry: Callable[..., Any] = dispatcher.overloads[arguments].entry_point
    return entry


_KEPT_ALIVE: list[Any] = []
"""An entry point does not own the machine code that it jumps to."""


class _PackageCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache on disk, keyed by all sources of this package; a damaged one is replaced.

    Numba itself looks only at the file that holds the kernel, and would miss a change in a helper's.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, or None where it has to be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            self.flush()
            return None

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (str(sig), *super()._index_key(sig, codegen)[1:], _sources())


@functools.cache
def _sources() -> str:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
