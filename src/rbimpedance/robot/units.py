"""Units of a joint's quantities: joints turn or slide."""

from __future__ import annotations

from collections.abc import Iterable

from .arm_model import ArmModel

FORCE = {"rad": "N·m", "m": "N"}
"""Unit of a joint's force by that of its position."""


def joined(units: Iterable[str]) -> str:
    """Return the units of some joints' positions as one: "rad", "m", or "rad or m"."""
    found = set(units)
    return " or ".join(unit for unit in FORCE if unit in found)


def error_unit(arm: ArmModel) -> str:
    """Return the unit of an arm's errors: "rad", "m", or "rad or m"."""
    return joined(arm.position_units)
