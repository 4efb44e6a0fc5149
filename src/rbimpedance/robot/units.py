"""Units of a joint's quantities: joints turn or slide."""

from __future__ import annotations

from .arm_model import ArmModel

FORCE = {"rad": "N·m", "m": "N"}
"""Unit of a joint's force by that of its position."""


def error_unit(arm: ArmModel) -> str:
    """Return the unit of an arm's errors: "rad", "m", or "rad or m"."""
    return " or ".join(sorted(set(arm.position_units), reverse=True))
