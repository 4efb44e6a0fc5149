"""Joint accelerations that keep velocity and position limits, and the other joints' share of what a limit takes.

A task at the tool chooses the joints' motion, near a singularity a fast one. The speed that a joint may have falls in
proportion to its distance from a position limit, and its acceleration is bounded by its distance from that speed:

    v_max(x) = min(share·limit, κ_x·(upper - x)),    a ≤ κ_v·(v_max - v),    and so for the lower side.

Where joints are held at their bounds, the others take over what the tool then lacks, as far as they can (F. Flacco,
A. De Luca, O. Khatib, Control of redundant robots under hard joint constraints, IEEE T-RO 31(3), 2015).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from .damped_inverse import DampedInverse, Damping
from .formulas import elementwise

SPEED_SHARE = 0.9
"""Share of a velocity limit that is commanded; the rest is for what the model does not know."""

APPROACH_RATE = 5.0
"""Largest speed towards a position limit over the distance from it [1/s]."""

STEP_SHARE = 0.25
"""Part of a joint's distance from its largest speed that it may take in a period."""


def acceleration_bounds(
    x: float, v: float, lower: float, upper: float, speed: float, dt: float
) -> tuple[float, float]:
    """Least and largest acceleration of a joint at the position x and the velocity v."""
    up = min(SPEED_SHARE * speed, APPROACH_RATE * (upper - x))
    down = max(-SPEED_SHARE * speed, APPROACH_RATE * (lower - x))
    return STEP_SHARE / dt * (down - v), STEP_SHARE / dt * (up - v)


class BoundedAcceleration(NamedTuple):
    """Joint accelerations within their bounds.

    Attributes:
        a: The accelerations, shape (nv,) [rad/s² or m/s²].
        held: Whether a joint is at its bound, shape (nv,), bool.
    """

    a: Array
    held: BoolArray


@dataclass(frozen=True, eq=False)
class JointBounds:
    """Velocity and position limits of the joints.

    Attributes:
        lower: Lower position limits, shape (nv,) [rad or m].
        upper: Upper position limits, shape (nv,).
        speed: Velocity limits, shape (nv,) [rad/s or m/s].
        dt: Control period [s].
    """

    lower: Array
    upper: Array
    speed: Array
    dt: float

    def accelerations(self, x: Array, v: Array) -> tuple[Array, Array]:
        """Return the least and the largest admissible acceleration, each of shape (nv,) [rad/s² or m/s²].

        Args:
            x: Joint positions, shape (nv,) [rad or m].
            v: Velocities, shape (nv,) [rad/s or m/s].
        """
        given = x, v, self.lower, self.upper, self.speed, self.dt
        low, high = elementwise(acceleration_bounds, 2, *given)
        return low, high

    def keep(self, a: Array, x: Array, v: Array, J: Array, damping: Damping) -> BoundedAcceleration:
        """Return the accelerations within the bounds whose tool acceleration is nearest to that of a.

        Args:
            a: Demanded accelerations, shape (nv,).
            x: Joint positions, shape (nv,).
            v: Velocities, shape (nv,).
            J: Jacobian of the tool, shape (6, nv).
            damping: Of the inverse for the joints that are not held.
        """
        low, high = self.accelerations(x, v)
        held, kept = np.zeros(len(a), dtype=np.bool_), a
        beyond = (a < low) | (a > high)
        while beyond.any():
            held |= beyond
            kept = np.where(held, np.clip(a, low, high), a)
            free = ~held
            if not free.any():
                break
            taken = J @ (a - kept)
            kept[free] += DampedInverse(J[:, free], damping).matrix @ taken
            beyond = free & ((kept < low) | (kept > high))
        return BoundedAcceleration(kept, held)
