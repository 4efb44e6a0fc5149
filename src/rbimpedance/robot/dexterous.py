"""A posture in which a frame can move in all directions."""

from __future__ import annotations

import numpy as np

from .._common.arrays import Array
from .arm_model import ArmModel

LENGTH = 0.3
"""By which linear rows of the Jacobian are divided [m]."""

ENOUGH = 0.15
"""Smallest singular value of a posture that is as good as any."""

_DRAWS = 200
_INNER, _FARTHEST = (
    0.5,
    1.5,
)  # share of a joint's range, and how far from its middle at most [rad or m]
_GOOD = 0.6  # of the best singular value that is found


def dexterity(arm: ArmModel, q: Array, frame: str) -> float:
    """Return the smallest singular value of a frame's Jacobian, linear rows divided by `LENGTH`.

    On an arm with fewer than six joints it is that of its own motions.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,).
        frame: Name of the frame.
    """
    J = arm.jacobian(q, frame) / np.repeat([LENGTH, 1.0], 3)[:, None]
    return float(np.linalg.svd(J, compute_uv=False).min())


def dexterous_configuration(arm: ArmModel, frame: str) -> Array:
    """Return `arm.ready`, or where that is near a singularity of a frame, the nearest of some postures that are not.

    Args:
        arm: The arm.
        frame: Name of the frame.

    Returns:
        The configuration, shape (nq,), the same at every call.

    Raises:
        ModelError: No such frame.
    """
    ready = np.array(arm.ready)
    if dexterity(arm, ready, frame) >= ENOUGH:
        return ready
    lower, upper = arm.joint_limits()
    is_bounded = np.isfinite(lower) & np.isfinite(upper)
    lower, upper = np.where(is_bounded, lower, -np.pi), np.where(is_bounded, upper, np.pi)
    half, middle = _INNER / 2.0 * (upper - lower), (lower + upper) / 2.0
    shares = np.random.default_rng(0).uniform(-1.0, 1.0, (_DRAWS, arm.nv))
    drawn = [arm.integrate(arm.zero, middle + np.minimum(half, _FARTHEST) * x) for x in shares]
    sizes = np.array([dexterity(arm, q, frame) for q in drawn])
    away = [float(np.linalg.norm(arm.difference(ready, q))) for q in drawn]
    return drawn[int(np.argmin(np.where(sizes >= _GOOD * sizes.max(), away, np.inf)))]
