"""The part of the dynamics in a controller's model: all, or the inertia alone."""

from __future__ import annotations

from typing import Literal, cast, get_args

from .._common.arrays import Array, choice
from .._common.deprecation import warn_renamed
from .arm_model import ArmModel

Knowledge = Literal["full", "inertia"]
"""The part of the dynamics that a controller uses: all, or M(q) alone as in section 4 of the paper."""


def model_torque(arm: ArmModel, model: Knowledge, q: Array, v: Array, a: Array) -> Array:
    """Return M a + bias by one RNEA, or M a where only the mass matrix is known, shape (nv,)."""
    if model == "full":
        return arm.raw_dynamics.inverse_dynamics(q, v, a)
    torque: Array = arm.raw_dynamics.mass_matrix(q) @ a
    return torque


def as_knowledge(model: str) -> Knowledge:
    """Return a `model` argument, checked; "mass" is the old name of "inertia".

    Raises:
        ParameterError: Neither "full" nor "inertia".
    """
    if model == "mass":
        warn_renamed('model="mass"', 'model="inertia"')
        return "inertia"
    return cast("Knowledge", choice("model", model, get_args(Knowledge)))
