"""What a controller knows of its arm: all of the dynamics, or the inertia alone."""

from __future__ import annotations

from typing import Literal, get_args

from .._common.arrays import Array
from ..exceptions import GainError
from .arm_model import ArmModel

Knowledge = Literal["full", "mass"]
"""What a controller knows of the arm: everything, or M(q) alone as in section 4 of the paper."""


def model_torque(arm: ArmModel, knowledge: Knowledge, q: Array, v: Array, a: Array) -> Array:
    """Return M a + bias by one RNEA, or M a where only the mass matrix is known, shape (nv,)."""
    if knowledge == "full":
        return arm.unchecked.inverse_dynamics(q, v, a)
    torque: Array = arm.unchecked.mass_matrix(q) @ a
    return torque


def check_knowledge(knowledge: str) -> None:
    """Refuse an unknown `knowledge`.

    Raises:
        GainError: Neither "full" nor "mass".
    """
    if knowledge not in get_args(Knowledge):
        raise GainError("knowledge", knowledge, '"full" or "mass"')
