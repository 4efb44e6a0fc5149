"""Whether an arm's dynamics can be used: inertia about every joint, and accelerations that are finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..dynamics import ArmModel
from ..exceptions import ModelError, UnsupportedJointError

SMALLEST_INERTIA = 1e-9
"""Smallest inertia about a joint that counts as one [kg·m² or kg]."""

SMALLEST_EIGENVALUE = 1e-8
"""Smallest eigenvalue of M, scaled to a unit diagonal, with which M⁻¹ still has eight digits."""

_SAMPLES = 8


def check_inertia(arm: ArmModel) -> None:
    """Refuse an arm with joints that have no usable inertia.

    A link without mass is no fault where heavier ones beyond it give M the inertia, so M itself is the judge: it must
    be safely positive definite, and the forward dynamics finite, at the neutral and at sampled configurations.

    Args:
        arm: The arm.

    Raises:
        UnsupportedJointError: The joints along which M is singular, and the ways out.
        ModelError: The forward dynamics is not finite.
    """
    rng = np.random.default_rng(0)
    weightless = arm.with_gravity((0.0, 0.0, 0.0))
    for q in (arm.neutral, *(arm.random_configuration(rng) for _ in range(_SAMPLES))):
        weak = weak_directions(_mass_matrix(weightless, q))
        if weak.any():
            raise _unusable([name for name, w in zip(arm.joint_names, weak, strict=True) if w], arm)
        a = arm.forward_dynamics(q, np.zeros(arm.nv), np.ones(arm.nv))
        if not np.isfinite(a).all():
            raise ModelError(
                f"the forward dynamics of '{arm.name}' is not finite at q = {q.tolist()}"
            )


def weak_directions(M: Array) -> NDArray[np.bool_]:
    """Tell along which joints a mass matrix is not safely positive.

    Args:
        M: Mass matrix, shape (nv, nv).

    Returns:
        True at joints without inertia of their own, else at those that take part in a motion of all joints that has
        next to none; shape (nv,).
    """
    if not np.isfinite(M).all():
        return np.ones(len(M), dtype=np.bool_)
    diagonal = np.diag(M)
    weak: NDArray[np.bool_] = diagonal < SMALLEST_INERTIA
    if weak.any():
        return weak
    scale = 1.0 / np.sqrt(diagonal)
    eigenvalues, vectors = np.linalg.eigh(M * np.outer(scale, scale))
    if eigenvalues[0] >= SMALLEST_EIGENVALUE:
        return weak
    motion = np.abs(vectors[:, 0])
    return np.asarray(motion > 0.3 * motion.max())


def _mass_matrix(weightless: ArmModel, q: Array) -> Array:
    """M(q), column by column through RNEA: a judge other than the CRBA that is judged."""
    rest = np.zeros(weightless.nv)
    columns = [weightless.inverse_dynamics(q, rest, a) for a in np.eye(weightless.nv)]
    M = np.column_stack(columns)
    return (M + M.T) / 2.0


def _unusable(names: list[str], arm: ArmModel) -> UnsupportedJointError:
    ways = "give the links an <inertial> with mass, or state the rotors' reflected inertia with armature="
    if len(names) < arm.nv:
        quoted = ", ".join(f'"{name}"' for name in names)
        ways += f", or freeze with lock=({quoted},)"
    return UnsupportedJointError(names, f"what it moves has no usable inertia; {ways}")
