"""Conditions in a form that serves one number and, in compiled code, eight at once."""

from __future__ import annotations

from typing import TypeVar

Value = TypeVar("Value")


def select(condition: bool, a: Value, b: Value) -> Value:
    """Return a where the condition holds, else b; both have been computed."""
    return a if condition else b


def any_of(condition: bool) -> bool:
    """Return whether the condition holds, for eight numbers at once: for one of them at least."""
    return condition
