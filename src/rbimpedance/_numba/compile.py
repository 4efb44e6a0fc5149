"""How the kernels are compiled: with which floating-point rules, kept on disk how, called from Python how.

Numba is imported here and in the `compiled` packages, and only when a kernel is needed.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from numba import njit, types
from numba.core.caching import FunctionCache

from . import COMPILING, warn_once

Function = TypeVar("Function", bound=Callable[..., Any])

_RULES: Any = {"error_model": "numpy", "boundscheck": False, "no_cfunc_wrapper": True}
_HELPER: Any = {**_RULES, "no_cpython_wrapper": True}
"""Nothing but other compiled code calls a helper; doors to it from Python would take half of the time to compile."""


def inline(function: Function) -> Function:
    """Compile a helper into its callers, in strict IEEE arithmetic."""
    return njit(forceinline=True, **_HELPER)(function)  # type: ignore[no-any-return]


def fused(function: Function) -> Function:
    """The same, with a·b + c rounded once: it is more exact, not less, and a third faster.

    No other relaxation is allowed: terms are not reordered, and NaN, infinity and the sign of zero keep their meaning.
    """
    return njit(forceinline=True, fastmath={"contract", "nsz"}, **_HELPER)(function)  # type: ignore[no-any-return]


def routine(function: Function) -> Function:
    """Compile a routine that kernels call; rounding as in `fused`."""
    return njit(fastmath={"contract", "nsz"}, **_HELPER)(function)  # type: ignore[no-any-return]


def kernel(
    function: Callable[..., Any],
    arguments: tuple[types.Type, ...],
    returns: types.Type = types.int64,
    *,
    nogil: bool = False,
) -> Callable[..., Any]:
    """Compile a function for the given argument types, or load it from the disk, ready to be called from Python.

    The call goes to Numba's entry point and not through its dispatcher: argument types are not looked at again.

    Args:
        function: The function.
        arguments: Types of its arguments.
        returns: Type of what it returns.
        nogil: Whether it runs without the interpreter's lock.
    """
    dispatcher = njit(nogil=nogil, **_RULES)(function)
    keep_on_disk(dispatcher, function)
    dispatcher.compile(returns(*arguments))
    _KEPT_ALIVE.append(dispatcher)
    entry: Callable[..., Any] = dispatcher.overloads[arguments].entry_point
    return entry


_KEPT_ALIVE: list[Any] = []
"""An entry point does not own the machine code that it jumps to."""


def keep_on_disk(compiler: Any, function: Callable[..., Any], formula: str | None = None) -> None:
    """Let Numba's compiler of a function load and save the machine code.

    Args:
        compiler: The compiler.
        function: What it compiles.
        formula: Name of the formula that the function contains, if it is a closure around one.
    """
    try:
        compiler._cache = _PackageCache(function)
    except RuntimeError:
        warn_once(
            "compiling again in every process, since no folder can be written to; set NUMBA_CACHE_DIR"
        )
    else:
        compiler._cache.formula = formula


class _PackageCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache on disk, keyed by the sources of compiled code and all module addresses; a damaged one is replaced.

    Numba itself looks only at the file that holds the kernel, and would miss a change in a helper's. Machine code from
    before a module moved names classes by their old addresses, which ends the process.
    """

    formula: str | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, or None where it has to be compiled, which is said."""
        known = None
        try:
            known = super().load_overload(sig, target_context)
        except Exception:
            self.flush()
        if known is None:
            warn_once(COMPILING)
        return known

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        target, contents = super()._index_key(sig, codegen)[1:]
        return str(sig), target, self.formula or contents, _sources()


@functools.cache
def _sources() -> str:
    package = Path(__file__).parents[1]
    patterns = (
        *("_numba/**/*.py", "law/*.py", "*/compiled/*.py"),
        *("control/estimation/*.py", "simulation/plants/dry_friction.py"),
    )
    files = sorted(file for pattern in patterns for file in package.glob(pattern))
    places = sorted(str(file.relative_to(package)) for file in package.rglob("*.py"))
    found = [*(file.read_bytes() for file in files), *map(str.encode, places)]
    return hashlib.sha256(b"".join(found)).hexdigest()
