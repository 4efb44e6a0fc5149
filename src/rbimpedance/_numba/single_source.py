"""Plain Python functions compiled as they are: a formula stands once, for NumPy and for kernels."""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any

from .compile import inline

_PACKAGE = __name__.partition(".")[0]


@functools.cache
def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a helper for kernels with the source of a plain function, and of those of the package that it calls.

    Args:
        function: A function of numbers, which may call others of its kind, NumPy's and `math`'s.
    """
    plain: Any = function
    called = {
        name: compiled(value)
        for name in plain.__code__.co_names
        if isinstance(value := plain.__globals__.get(name), FunctionType)
        and value.__module__.startswith(_PACKAGE)
    }
    copy = FunctionType(
        plain.__code__, plain.__globals__ | called, plain.__name__, plain.__defaults__
    )
    copy.__module__, copy.__qualname__ = plain.__module__, plain.__qualname__
    return inline(copy)
