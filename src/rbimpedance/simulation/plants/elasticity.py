"""Springs in the joints: their usual damping, their largest stable steps, and the checks of their parameters."""

from __future__ import annotations

import contextlib
from bisect import bisect_left
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, BoolArray, per_joint, positive_or_infinite, whole_numbers
from ...exceptions import ParameterError
from ...robot.arm_model import ArmModel

DAMPING_RATIO = 0.05
"""Share of critical damping that a joint's spring has by default."""

STEP_LIMIT = 2.0
"""Largest h²·ω² + 2·h·c of a spring's mode that a run may begin with; semi-implicit Euler is stable up to 4."""


def stiffness_of_joints(value: ArrayLike, nv: int) -> Array:
    """Return positive stiffness, shape (nv,) [N·m/rad or N/m]; +inf where the joint is rigid.

    Raises:
        ParameterError: Anything else.
        DimensionError: It is given for another number of joints.
    """
    array = positive_or_infinite("stiffness", value, " where the joint is rigid")
    return per_joint("stiffness", array, nv)


def whole(name: str, value: ArrayLike, nv: int) -> Array:
    """Return whole numbers from 1 on, shape (nv,).

    Raises:
        ParameterError: Anything else.
        DimensionError: They are given for another number of joints.
    """
    return per_joint(name, whole_numbers(name, value), nv)


def refuse_at(arm: ArmModel, wrong: BoolArray, name: str, value: Array, words: str) -> None:
    """Refuse a parameter at the first joint where it is wrong.

    Raises:
        ParameterError: There is such a joint; names it.
    """
    if wrong.any():
        joint = int(np.argmax(wrong))
        where = f"{words} at joint '{arm.joint_names[joint]}', which is elastic"
        raise ParameterError(name, float(value[joint]), where)


def usual_damping(arm: ArmModel, K: Array, B: Array) -> Array:
    """Return `DAMPING_RATIO` of the critical damping of every spring alone at `arm.neutral`, shape (nv,).

    Args:
        arm: The links, without the rotors of elastic joints.
        K: Stiffness, shape (nv,); +inf where a joint is rigid.
        B: Inertia of the rotors, shape (nv,).
    """
    elastic, damping = np.isfinite(K), np.zeros(arm.nv)
    mobility = np.diag(_mobility(arm, elastic, B, arm.neutral))
    damping[elastic] = 2.0 * DAMPING_RATIO * np.sqrt(K[elastic] / mobility)
    damping.setflags(write=False)
    return damping


def check_step(arm: ArmModel, K: Array, D: Array, B: Array, q: Array, h: float) -> None:
    """Refuse steps that are too long for the springs at a configuration.

    With G = M⁻¹ + B⁻¹ on the elastic joints the springs obey δ̈ = -G·(D·δ̇ + K·δ) + ..., and semi-implicit Euler with
    the forces of a step's beginning is stable while the largest eigenvalue of G·(h²·K + 2·h·D) is below 4.

    Args:
        arm: The links, without the rotors of elastic joints.
        K: Stiffness, shape (nv,); +inf where a joint is rigid.
        D: Damping, shape (nv,).
        B: Inertia of the rotors, shape (nv,).
        q: Configuration, shape (nq,).
        h: Length of a step [s].

    Raises:
        ParameterError: That eigenvalue is above `STEP_LIMIT`; names the joint that moves most in its mode.
    """
    elastic = np.isfinite(K)
    if not elastic.any():
        return
    G, K, D = _mobility(arm, elastic, B, q), K[elastic], D[elastic]

    def modes(h: float) -> tuple[Array, Array]:
        root = np.sqrt(h * h * K + 2.0 * h * D)
        values, vectors = np.linalg.eigh(root[:, None] * G * root)
        return values, vectors

    values, vectors = modes(h)
    if values[-1] <= STEP_LIMIT:
        return
    most = int(np.ceil(values[-1] / STEP_LIMIT))  # the eigenvalue falls at least as fast as h
    needed = 1 + bisect_left(
        range(1, most), True, key=lambda n: bool(modes(h / n)[0][-1] <= STEP_LIMIT)
    )
    joint = np.flatnonzero(elastic)[int(np.argmax(np.abs(vectors[:, -1])))]
    raise ParameterError(
        "h",
        h,
        f"at most {h / needed:.3g} s, which is {needed} times the substeps, for the spring of joint "
        f"'{arm.joint_names[joint]}'",
    )


def enough_substeps(plant: Any, q: Array, dt: float) -> int:
    """Return physics steps in a control period that the springs of a plant allow: 4, 8, 16, 32 or 64.

    Args:
        plant: A `DrivenPlant`.
        q: Configuration at which a run begins, shape (nq,).
        dt: Control period [s].

    Raises:
        ParameterError: 64 are not enough.
    """
    zero = np.zeros(plant.arm.nv)
    for substeps in (4, 8, 16, 32):
        with contextlib.suppress(ParameterError):
            plant.begin(q, zero, dt / substeps)
            return substeps
    plant.begin(q, zero, dt / 64)
    return 64


def _mobility(arm: ArmModel, elastic: BoolArray, B: Array, q: Array) -> Array:
    """M⁻¹ + B⁻¹ of the elastic joints, shape (n, n).

    Raises:
        ParameterError: A link without inertia.
    """
    M = arm.raw_dynamics.mass_matrix(q)
    try:
        inverse = np.linalg.inv(M)
    except np.linalg.LinAlgError:
        inverse = np.full_like(M, np.nan)
    if not (np.diag(inverse) > 0.0).all():
        joint = arm.joint_names[int(np.argmin(np.diag(M)))]
        raise ParameterError(
            "stiffness", "finite", f"infinite at joint '{joint}': its link has no inertia"
        )
    return np.asarray(inverse[np.ix_(elastic, elastic)] + np.diag(1.0 / B[elastic]))
