"""Representations of one or two lines: what an object is and what it was made with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

C = TypeVar("C", bound=type)

WIDTH = 120
"""Columns of a line; what does not fit into two is left out."""

_MOST_NUMBERS = 7


def brief_repr(*names: str, omit_defaults: bool = False) -> Callable[[C], C]:
    """Give a class a short `__repr__`.

    Args:
        *names: Attributes that it shows; by default the public fields of a dataclass or named tuple.
        omit_defaults: Leave out what is as in an object made without arguments.
    """

    def decorate(cls: C) -> C:
        def __repr__(self: Any) -> str:  # noqa: N807 (becomes a method)
            shown = names or _public_fields(self)
            values = {name: getattr(self, name) for name in shown}
            plain = vars(type(self)()) if omit_defaults else {}
            parts = [
                f"{name}={shortly(value)}"
                for name, value in values.items()
                if value is not None and not (name in plain and _same(value, plain[name]))
            ]
            return _within_two_lines(type(self).__name__, parts)

        cls.__repr__ = __repr__  # type: ignore[method-assign, assignment]
        return cls

    return decorate


def shortly(value: Any) -> str:
    """Return a value in a few characters: four digits, one number where all are equal, names of arms and functions."""
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, float | np.floating):
        return f"{value:.4g}"
    if hasattr(value, "joint_names") and hasattr(value, "name"):
        return repr(value.name)
    if getattr(type(value), "__repr__", None) is object.__repr__:
        return type(value).__name__
    if callable(value) and hasattr(value, "__name__"):
        return str(value.__name__)
    text = repr(value)
    return text if "\n" not in text else f"{type(value).__name__}(…)"


def _array(array: np.ndarray[Any, Any]) -> str:
    if array.size == 0:
        return "[]"
    if (array == array.flat[0]).all() or array.size == 1:
        return str(array.flat[0]) if array.dtype.kind == "b" else f"{array.flat[0]:.4g}"
    if array.dtype.kind == "b":
        return f"{np.count_nonzero(array)} of {array.size}"
    if array.ndim > 1 or array.size > _MOST_NUMBERS:
        shape = "×".join(map(str, array.shape))
        return f"<{shape}: {array.min():.4g}…{array.max():.4g}>"
    return "[" + ", ".join(f"{x:.4g}" for x in array) + "]"


def _public_fields(value: Any) -> list[str]:
    if dataclasses.is_dataclass(value):
        return [f.name for f in dataclasses.fields(value) if f.repr and not f.name.startswith("_")]
    return list(value._fields)


def _same(value: Any, other: Any) -> bool:
    return value is other or bool(np.array_equal(np.asarray(value), np.asarray(other)))


def _within_two_lines(name: str, parts: list[str]) -> str:
    """Join parts, on two lines where one is too short, the last ones left out where two are."""
    lines, indent = [f"{name}("], " " * 4
    for i, part in enumerate(parts):
        text = part + (", " if i + 1 < len(parts) else ")")
        if len(lines[-1]) + len(text) > WIDTH and lines[-1].strip() != f"{name}(":
            if len(lines) == 2:
                return "\n".join([lines[0].rstrip(), lines[1].rstrip()]) + " …)"
            lines.append(indent)
        lines[-1] += text if len(text) <= 2 * WIDTH else text[:WIDTH] + "…, "
    return "\n".join(line.rstrip() for line in lines) + ("" if parts else ")")
