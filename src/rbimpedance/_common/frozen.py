"""Frozen dataclasses whose constructors normalise what they are given."""

from __future__ import annotations


def set_fields(instance: object, **values: object) -> None:
    """Set the fields of a frozen dataclass from within its `__init__`."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)
