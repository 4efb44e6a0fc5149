"""Names that have changed: the old ones work for one release, and warn with the new ones."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def warn_renamed(old: str, new: str) -> None:
    """Warn at the caller's caller that a name has changed."""
    words = f"{old} is now {new}; the old name goes with the next release"
    warnings.warn(words, DeprecationWarning, stacklevel=3)


def renamed_arguments(**new_by_old: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Let a function take keyword arguments by their old names, too.

    Args:
        **new_by_old: The new name of each old one.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> T:
            for old in new_by_old.keys() & kwargs.keys():
                warn_renamed(f"{old}=", f"{new_by_old[old]}=")
                kwargs[new_by_old[old]] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate


def renamed_attribute(old: str, new: str) -> Any:
    """Return a property that answers an old attribute, or method, with the new one."""

    def read(self: object) -> Any:
        warn_renamed(f"{type(self).__name__}.{old}", f"{type(self).__name__}.{new}")
        return getattr(self, new)

    read.__doc__ = f"Deprecated: `{new}`."
    return property(read)
