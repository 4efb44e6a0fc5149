"""From the tool to the joints: mass, damping or stiffness wanted at a frame, as joint matrices for a configuration.

The target impedance of the library lives in the joints. These helpers choose its matrices so that a frame feels as
wanted at one configuration; away from it the joint matrices stay as they are, and the frame feels something else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number, real, vector
from ..exceptions import DimensionError, ParameterError, UnsupportedJointError
from .arm_model import ArmModel

_SINGULAR = 1e-6  # smallest admissible ratio of J's singular values


def joint_matrix(
    arm: ArmModel,
    q: ArrayLike,
    wanted: ArrayLike,
    *,
    posture: float,
    frame: str | None = None,
) -> Array:
    """Return Jᵀ X J + posture·N: joint mass, damping or stiffness by which a frame feels X, shape (nv, nv).

    N = I - J⁺J projects on the motions that leave the frame where it is; they get `posture`, so that the result is
    positive definite where J has full row rank. Pushed at the frame, it feels X exactly: (J A⁻¹ Jᵀ)⁻¹ = X for the
    result A. Where a mass, a damping and a stiffness are made with the same `posture` each, the three act on the frame
    as they would without an arm, at this configuration.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,).
        wanted: X, symmetric positive definite: (6, 6) for force and moment, or (3, 3) for the force alone, with the
            frame's rotations left to `posture`; [kg, N·s/m or N/m and so on], in world axes at the frame's origin.
        posture: What the motions feel that the frame does not take part in, positive [kg·m², N·m·s/rad or N·m/rad].
        frame: Name of the frame; the arm's tool frame by default.

    Raises:
        ParameterError: X is not symmetric positive definite, `posture` is not a positive number, or J has not full row
            rank there: no joint matrix gives X in the directions in which the frame cannot move.
        DimensionError: X is neither (3, 3) nor (6, 6).
        ModelError: No such frame.
    """
    X = _positive_definite(wanted)
    posture = positive_number("posture", posture, "gain of the motions that leave the frame")
    J = arm.jacobian(q, frame)[: len(X)]
    sizes = np.linalg.svd(J, compute_uv=False)
    if len(X) > arm.nv or sizes[-1] < _SINGULAR * sizes[0]:
        raise ParameterError(
            "q", np.asarray(q), f"a configuration whose Jacobian has rank {len(X)}"
        )
    N = np.eye(arm.nv) - np.linalg.pinv(J) @ J
    A: Array = J.T @ X @ J + posture * N
    return (A + A.T) / 2.0


def geometric_stiffness(
    arm: ArmModel, q: ArrayLike, wrench: ArrayLike, frame: str | None = None
) -> Array:
    """Return -∂(Jᵀ w)/∂q with w held in world axes: the stiffness that a spring's own force adds, shape (nv, nv).

    A spring K_x at the frame that holds the wrench w = K_x·x gives the joints tau = Jᵀ w and the stiffness

        -∂tau/∂q = Jᵀ K_x J - Σ_j (∂Jᵀ/∂q_j)·w ⊗ e_j,

    whose second term is this one. It is not positive definite, in general, and not symmetric where w holds a moment:
    add it to look at stability, not to build an `Impedance`. For the rotations it is exact while the spring's own
    rotation is small.

    With J's columns (v_i, ω_i) of joint i, ∂v_i/∂q_j = ω_j × v_i and ∂ω_i/∂q_j = ω_j × ω_i where joint j comes before i
    on the way to the frame, and ω_i × v_j and 0 where it comes after.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,).
        wrench: w, force and moment that the spring exerts on the robot at the frame's origin, world axes, shape (6,).
        frame: Name of the frame; the arm's tool frame by default.

    Raises:
        UnsupportedJointError: The arm has joints that mimic others.
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ModelError: No such frame.
    """
    mimicking = [arm.model.names[j] for j in arm.model.mimicking_joints]
    if mimicking:
        raise UnsupportedJointError(
            mimicking, "a column of the Jacobian then belongs to two joints"
        )
    w = vector("wrench", wrench, 6, "force, moment")
    J = arm.jacobian(q, frame)
    linear, angular = J[:3].T, J[3:].T
    K: Array = np.empty((arm.nv, arm.nv))
    for j in range(arm.nv):
        turned = (
            np.cross(angular[j], linear[j:]) @ w[:3] + np.cross(angular[j], angular[j:]) @ w[3:]
        )
        K[j:, j] = -turned
        K[:j, j] = -np.cross(angular[:j], linear[j]) @ w[:3]
    return K


def _positive_definite(value: ArrayLike) -> Array:
    X = real("wanted", value, "a matrix (3, 3) or (6, 6)")
    if X.shape not in ((3, 3), (6, 6)):
        raise DimensionError("wanted", "a matrix (3, 3) or (6, 6)", f"shape {X.shape}")
    symmetric = np.isfinite(X).all() and np.abs(X - X.T).max() <= 1e-10 * np.abs(X).max()
    if not symmetric or np.linalg.eigvalsh(X)[0] <= 0.0:
        raise ParameterError("wanted", value, "symmetric positive definite")
    return X
