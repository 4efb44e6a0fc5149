"""Desired motions and the limits of the arm that is to follow them."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number
from ..exceptions import JointLimitError, VelocityLimitWarning
from ..robot.arm_model import ArmModel

ROUNDING = 1e-6
"""Positions this far beyond a limit count as inside: descriptions round their limits [rad or m]."""


def amplitude_within_limits(
    arm: ArmModel,
    center: ArrayLike | None = None,
    *,
    at_most: float = 0.2,
    period: float = 6.0,
) -> Array:
    """Return the amplitude of a `cosine` that stays well inside the limits, shape (nv,) [rad or m].

    It takes at most half of the way from the centre to the nearer position limit, and at most half of the velocity
    limit.

    Args:
        arm: The arm.
        center: Centre of the motion, shape (nq,); `arm.ready` by default.
        at_most: Largest amplitude of any joint [rad or m].
        period: Of the motion [s].

    Raises:
        DimensionError: A centre of wrong shape or kind.
        ParameterError: A number that is not positive.
    """
    largest = positive_number("at_most", at_most, "amplitude in rad or m")
    omega = 2.0 * np.pi / positive_number("period", period, "time in seconds")
    q = arm.ready if center is None else arm.check_configuration("center", center)
    x, (lower, upper) = joint_positions(arm, q), arm.joint_limits()
    room = np.maximum(np.minimum(x - lower, upper - x), 0.0)
    return np.minimum(largest, np.minimum(room, arm.velocity_limit / omega) / 2.0)


def joint_positions(arm: ArmModel, q: Array) -> Array:
    """Return one number per joint: its angle or displacement from zero, shape (nv,) [rad or m]."""
    return q if arm.nq == arm.nv else arm.raw_dynamics.difference(arm.zero, q)


def check_positions(name: str, arm: ArmModel, positions: Array) -> None:
    """Refuse positions outside the limits.

    Args:
        name: What they are, for the error.
        arm: The arm.
        positions: One number per joint, shape (nv,) or (n, nv) [rad or m].

    Raises:
        JointLimitError: A joint is outside; names the one that is farthest.
    """
    lower, upper = arm.joint_limits()
    rows = np.atleast_2d(positions)
    beyond = np.maximum(lower - rows, rows - upper)
    row, joint = np.unravel_index(np.argmax(beyond), beyond.shape)
    if beyond[row, joint] > ROUNDING:
        value, limits = float(rows[row, joint]), (float(lower[joint]), float(upper[joint]))
        raise JointLimitError(name, arm.joint_names[joint], value, limits)


def warn_of_speeds(name: str, arm: ArmModel, speeds: Array) -> None:
    """Warn of speeds beyond the velocity limits.

    Args:
        name: What moves, for the warning.
        arm: The arm.
        speeds: Largest speed of each joint, shape (nv,) [rad/s or m/s].
    """
    share = np.abs(speeds) / arm.velocity_limit
    joint = int(np.argmax(share))
    if share[joint] > 1.0 + ROUNDING:
        words = (
            f"{name} asks joint '{arm.joint_names[joint]}' for {abs(speeds[joint]):.4g} rad/s or m/s; "
            f"its velocity limit is {arm.velocity_limit[joint]:.4g}"
        )
        warnings.warn(words, VelocityLimitWarning, stacklevel=3)
