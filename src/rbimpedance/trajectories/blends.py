"""The polynomial of degree 5 that closes a gap: position, velocity and acceleration are continuous at both ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from ..robot.arm_model import ArmModel
from .reference import Reference


def closing(gap: Array, length: float, clock: float) -> tuple[Array, Array, Array]:
    """Return the polynomial of degree 5 from `gap` to zero, and its two derivatives.

    With y = 1 - t/T it is y³·(c0 + c1·(1-y) + c2·(1-y)²): zero with two derivatives at y = 0.

    Args:
        gap: (g, ġ, g̈) at the start, shape (3, nv).
        length: T [s].
        clock: Time since the start, at most T [s].
    """
    x, y, T = clock / length, 1.0 - clock / length, length
    g, rate, acceleration = gap[0], T * gap[1], T**2 * gap[2]
    c0, c1 = g, rate + 3.0 * g
    c2 = acceleration / 2.0 + 3.0 * c1 - 3.0 * g
    p, dp, ddp = c0 + c1 * x + c2 * x**2, c1 + 2.0 * c2 * x, 2.0 * c2
    return (
        y**3 * p,
        (y**3 * dp - 3.0 * y**2 * p) / T,
        (y**3 * ddp - 6.0 * y**2 * dp + 6.0 * y * p) / T**2,
    )


@dataclass(frozen=True, eq=False)
class Gap:
    """A motion from (g, ġ, g̈) at a time to rest at zero a while later, see `closing`.

    Attributes:
        start: When it begins [s].
        length: How long it takes, T [s].
        begin: Gap, its rate and its acceleration at the start, shape (3, nv).
    """

    start: float
    length: float
    begin: Array

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return gap, rate and acceleration at a time [s]; zero from the end on."""
        if t - self.start >= self.length:
            zero = np.zeros_like(self.begin[0])
            return zero, zero, zero
        return closing(self.begin, self.length, t - self.start)


@dataclass(frozen=True, eq=False)
class ToRest:
    """A trajectory that comes to rest from any motion: position, velocity and acceleration continue without a jump.

    Attributes:
        arm: The arm.
        begin: The motion at the start.
        gap: The rest of the way.
        end: Where it comes to rest, shape (nq,).
    """

    arm: ArmModel
    begin: Reference
    gap: Gap
    end: Array

    def __call__(self, t: float) -> Reference:
        """Return the desired motion at a time [s]."""
        way, rate, acceleration = self.gap(t)
        q = self.arm.raw_dynamics.integrate(self.end, way)
        return Reference(q, np.array(rate), np.array(acceleration))


def to_rest(arm: ArmModel, begin: Reference, start: float, length: float) -> ToRest:
    """Return the motion from `begin` at a time to rest, half of the way ahead that its velocity would go.

    Args:
        arm: The arm.
        begin: The motion at the start.
        start: When it begins [s].
        length: How long it takes, positive [s].
    """
    half = begin.v * length / 2.0
    end = arm.raw_dynamics.integrate(begin.q, half)
    return ToRest(arm, begin, Gap(start, length, np.stack([-half, begin.v, begin.a])), end)
