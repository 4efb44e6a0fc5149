"""Poses of a frame and desired motions of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array, real, vector
from .._common.brief import brief_repr
from ..exceptions import DimensionError, NonFiniteError

_ORTHONORMAL = 1e-6  # by which Rᵀ·R may be off the identity


@brief_repr()
class Pose(NamedTuple):
    """Where a frame is; `Pose(*arm.frame_placement(q))` is that of the arm's tool.

    Attributes:
        rotation: Its axes as columns, in world axes, shape (3, 3).
        translation: Its origin, shape (3,) [m].
    """

    rotation: Array
    translation: Array


@brief_repr()
class CartesianReference(NamedTuple):
    """Desired motion of a frame at one instant, in world axes.

    Attributes:
        pose: Pose x_d.
        v: Velocity of the origin and angular velocity, shape (6,) [m/s, rad/s].
        a: Acceleration of the origin and angular acceleration, shape (6,) [m/s², rad/s²].
    """

    pose: Pose
    v: Array
    a: Array


def check_pose(name: str, pose: Any) -> Pose:
    """Return a pose as checked float64 arrays.

    Args:
        name: What it is called, for the error.
        pose: The pose.

    Raises:
        DimensionError: No pair (rotation, translation), one of wrong shape, or a rotation that is none.
        NonFiniteError: It holds NaN or infinity.
    """
    try:
        rotation, translation = pose
    except (TypeError, ValueError):
        expected = "a Pose(rotation, translation)"
        raise DimensionError(name, expected, type(pose).__name__) from None
    R = rotation_matrix(f"{name}.rotation", rotation)
    return Pose(R, vector(f"{name}.translation", translation, 3, "x, y, z"))


def rotation_matrix(name: str, value: Any) -> Array:
    """Return a rotation matrix as a checked float64 array, shape (3, 3).

    Raises:
        DimensionError: Wrong shape or kind, or not orthonormal and right-handed.
        NonFiniteError: It holds NaN or infinity.
    """
    expected = "a rotation matrix, shape (3, 3)"
    R = real(name, value, expected)
    if R.shape != (3, 3):
        raise DimensionError(name, expected, f"shape {R.shape}")
    if not np.isfinite(R).all():
        raise NonFiniteError(name, np.flatnonzero(~np.isfinite(R)).tolist())
    if np.abs(R.T @ R - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(R) < 0.0:
        raise DimensionError(name, expected + ", orthonormal and right-handed", f"{R.tolist()}")
    return R


def check_cartesian_reference(reference: Any) -> CartesianReference:
    """Return a desired motion as checked float64 arrays.

    Raises:
        DimensionError: No triple (pose, v, a), or one of wrong shape or kind.
        NonFiniteError: It holds NaN or infinity.
    """
    try:
        pose, v, a = reference
    except (TypeError, ValueError):
        expected, actual = "a CartesianReference(pose, v, a)", type(reference).__name__
        raise DimensionError("reference", expected, actual) from None
    return CartesianReference(
        check_pose("reference.pose", pose),
        vector("reference.v", v, 6, "linear, angular"),
        vector("reference.a", a, 6, "linear, angular"),
    )
