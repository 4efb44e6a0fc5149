"""Whether an arm's dynamics can be used: inertia about every joint, and accelerations that are finite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..._common.arrays import Array
from ...exceptions import ModelError, UnsupportedJointError
from ..arm_model import ArmModel
from ..rigid_bodies import movable_joints
from .wording import listed

SMALLEST_INERTIA = 1e-9
"""Smallest inertia about a joint that counts as one [kg·m² or kg]."""

SMALLEST_MASS = 1e-6
"""Smallest mass that a joint may move [kg]: less is no mass, or a placeholder."""

SMALLEST_EIGENVALUE = 1e-8
"""Smallest eigenvalue of M, scaled to a unit diagonal, with which M⁻¹ still has eight digits."""

LARGEST_INERTIA = 1e12
"""Largest inertia about a joint [kg·m² or kg]: beyond it, units are wrong, or a number."""

LARGEST_CONDITION = 1e12
"""Largest ratio of eigenvalues of M with which the smallest still has four digits; 5e6 among known robots."""

_UNITS = "give masses in kg, inertias in kg·m² and lengths in m"
_AGREEMENT = 1e-6  # of CRBA and RNEA, relative
_SAMPLES = 8


def massless_joints(model: pin.Model) -> tuple[str, ...]:
    """Return the names of the joints that move links without mass only.

    The model says nothing about gravity and inertia there. Armature hides that: it makes M invertible, and the torque
    that holds the arm stays 0.

    Args:
        model: The model.
    """
    moved = {j: set(model.subtrees[j]) for j in movable_joints(model)}
    for follower, leader in zip(model.mimicking_joints, model.mimicked_joints, strict=True):
        moved[leader] |= set(model.subtrees[follower])
    return tuple(
        model.names[j]
        for j, bodies in moved.items()
        if sum(model.inertias[body].mass for body in bodies) < SMALLEST_MASS
    )


def no_mass(names: Sequence[str], count: int) -> UnsupportedJointError:
    """Return the error of joints that move no mass, with the remedies.

    Args:
        names: The joints.
        count: Number of all joints.
    """
    return UnsupportedJointError(
        names,
        "the links that it moves have no mass: their gravity and inertia are unknown; give them an <inertial> with "
        f"mass{_or_lock(names, count)}, or accept a model without gravity there: massless=True with the rotors' "
        "inertia as armature= (--massless --armature)",
    )


def check_inertia(arm: ArmModel) -> None:
    """Refuse an arm whose dynamics cannot be used.

    A massless link is allowed if links further out give M enough inertia, so M itself is checked: it must be safely
    positive definite, agree with RNEA, and the forward dynamics and the tool's pose be finite, at the neutral and at
    sampled configurations.

    Args:
        arm: The arm.

    Raises:
        UnsupportedJointError: The joints along which M is singular, and the remedies.
        ModelError: M is too ill-conditioned for floating point, or something is not finite.
    """
    rng = np.random.default_rng(0)
    with np.errstate(all="ignore"):  # the results are checked afterwards
        for q in (arm.neutral, *(arm.random_configuration(rng) for _ in range(_SAMPLES))):
            M = arm.mass_matrix(q)
            _check_size(arm, M)
            weak = weak_directions(M)
            if weak.any():
                names = [name for name, w in zip(arm.joint_names, weak, strict=True) if w]
                raise _unusable(names, arm)
            _check_condition(arm, M)
            _check_motion(arm, q, M, rng.normal(size=arm.nv))


def weak_directions(M: Array) -> NDArray[np.bool_]:
    """Return along which joints a mass matrix is not safely positive.

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


def _check_size(arm: ArmModel, M: Array) -> None:
    """Refuse inertias that no machine has, which leave no digits for those that it has."""
    if not (size := np.diag(M)).max() <= LARGEST_INERTIA:
        i = int(np.argmax(size))  # of a NaN, if there is one
        raise ModelError(
            f"what '{arm.joint_names[i]}' moves has the inertia {size[i]:.3g}: {_UNITS}"
        )


def _check_condition(arm: ArmModel, M: Array) -> None:
    """Refuse inertias so far apart that the small ones drown in the rounding of the large ones."""
    eigenvalues, vectors = np.linalg.eigh(M / np.abs(M).max())
    if not eigenvalues[0] * LARGEST_CONDITION >= eigenvalues[-1]:
        motion = np.abs(vectors[:, [0, -1]])
        light, heavy = (np.array(arm.joint_names)[m > 0.5 * m.max()].tolist() for m in motion.T)
        raise ModelError(
            f"what {listed(light)} moves has less than 1/{LARGEST_CONDITION:g} of the inertia of what {listed(heavy)} "
            f"moves, too little for floating point: {_UNITS}"
        )


def _check_motion(arm: ArmModel, q: Array, M: Array, a: Array) -> None:
    """Refuse what is not finite, and an M that is not that of the equations of motion."""
    bias = arm.bias(q, np.zeros(arm.nv))
    tau = arm.inverse_dynamics(q, np.zeros(arm.nv), a)
    scale = np.abs(M) @ np.abs(a) + np.abs(bias)
    if not (np.abs(M @ a + bias - tau) <= _AGREEMENT * scale).all():
        raise ModelError(
            f"two ways to the mass matrix of '{arm.name}' disagree at q = {q.tolist()}"
        )
    for v in (np.zeros(arm.nv), a):
        if not np.isfinite(arm.forward_dynamics(q, v, np.ones(arm.nv))).all():
            raise ModelError(
                f"the forward dynamics of '{arm.name}' is not finite at q = {q.tolist()}"
            )
    rotation, origin = arm.frame_placement(q)
    if not (np.isfinite(origin).all() and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)):
        raise ModelError(
            f"the frame '{arm.tool_frame}' of '{arm.name}' has no pose at q = {q.tolist()}"
        )


def _unusable(names: list[str], arm: ArmModel) -> UnsupportedJointError:
    ways = "give the links an <inertial> with mass, or state the rotors' reflected inertia with armature="
    return UnsupportedJointError(
        names, f"what it moves has no usable inertia; {ways}{_or_lock(names, arm.nv)}"
    )


def _or_lock(names: Sequence[str], count: int) -> str:
    """The remedy that freezes the joints; empty if no joint would be left to move."""
    quoted = ", ".join(f'"{name}"' for name in names)
    return f", or freeze with lock=({quoted},)" if len(names) < count else ""
