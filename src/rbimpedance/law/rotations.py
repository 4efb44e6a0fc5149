"""Rotation vectors: their matrix, the Jacobians of the exponential map of SO(3), and their rates.

With φ a rotation vector, θ = |φ| and [φ] the matrix of φ × ·,

    J_l(φ) = I + a·[φ] + b·[φ]²,      J_l⁻¹(φ) = I - [φ]/2 + c·[φ]²,      exp(φ) = I + [φ]·J_l(φ)

    a = (1 - cos θ)/θ²,   b = (θ - sin θ)/θ³,   c = (1 - (θ/2)·cot(θ/2))/θ²

ω = J_l(φ)·φ̇ is the angular velocity in the axes that exp(φ) maps to, J_r(φ) = J_l(-φ) belongs to those it maps from.
Reference: J. Solà, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics, arXiv 1812.01537.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from .._common.arrays import Array

SMALL = 1.0
"""Angle below which a, b and c are summed as series: there the closed forms lose digits [rad]."""

_TERMS = 12  # of the series, enough for double precision at `SMALL`
_BERNOULLI = (
    *(1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6),
    *(-3617 / 510, 43867 / 798, -174611 / 330, 854513 / 138, -236364091 / 2730),
)  # B_2, B_4, ...


def _series() -> Array:
    """Coefficients of a, b, c and of a'/θ, b'/θ, c'/θ over powers of θ², shape (6, terms)."""
    k = range(_TERMS)
    rows = np.array(
        [
            [(-1) ** i / math.factorial(2 * i + 2) for i in k],
            [(-1) ** i / math.factorial(2 * i + 3) for i in k],
            [abs(_BERNOULLI[i]) / math.factorial(2 * i + 2) for i in k],
        ]
    )
    slopes = np.zeros_like(rows)
    slopes[:, :-1] = 2.0 * rows[:, 1:] * np.arange(1, _TERMS)  # d/dθ = 2θ·d/d(θ²)
    return np.vstack([rows, slopes])


_IDENTITY = np.eye(3)
_SERIES, _POWERS = _series(), np.arange(_TERMS)


def coefficients(theta: float) -> Any:
    """Return a, b, c and a'/θ, b'/θ, c'/θ of this module's text.

    Args:
        theta: Angle, at least 0 and below 2π for c [rad].
    """
    x = theta * theta
    if theta < SMALL:
        return (_SERIES @ x**_POWERS).tolist()
    sin, cos, half = math.sin(theta), math.cos(theta), theta / 2.0
    cot = 1.0 / math.tan(half)
    a, b, c = (1.0 - cos) / x, (theta - sin) / (x * theta), (1.0 - half * cot) / x
    slope_a = (sin / theta - 2.0 * a) / x
    slope_b = (a - 3.0 * b) / x
    slope_c = ((1.0 / math.sin(half) ** 2) / 4.0 - cot / (2.0 * theta) - 2.0 * c) / x
    return a, b, c, slope_a, slope_b, slope_c


def hat(x: Array) -> Array:
    """Return [x], the matrix of x × ·, shape (3, 3)."""
    x0, x1, x2 = x.tolist()
    return np.array([[0.0, -x2, x1], [x2, 0.0, -x0], [-x1, x0, 0.0]])


def cross(x: Array, y: Array) -> Array:
    """Return x × y, shape (3,)."""
    product: Array = hat(x) @ y
    return product


class RotationVector:
    """A rotation vector φ: its rotation, the Jacobians of the exponential map and their rates along φ̇.

    Args:
        phi: φ, shape (3,) [rad].
    """

    def __init__(self, phi: Array) -> None:
        self.phi, self.hat = phi, hat(phi)
        self._hat2 = self.hat @ self.hat
        self._a, self._b, self._c, *slopes = coefficients(math.sqrt(phi @ phi))
        self._slope_a, self._slope_b, self._slope_c = slopes

    @property
    def matrix(self) -> Array:
        """exp(φ), shape (3, 3)."""
        rotation: Array = _IDENTITY + self.hat @ self.left
        return rotation

    @cached_property
    def left(self) -> Array:
        """J_l(φ), shape (3, 3)."""
        jacobian: Array = _IDENTITY + self._a * self.hat + self._b * self._hat2
        return jacobian

    @property
    def right(self) -> Array:
        """J_r(φ) = J_l(φ)ᵀ, shape (3, 3)."""
        return self.left.T

    @cached_property
    def left_inverse(self) -> Array:
        """J_l⁻¹(φ), shape (3, 3); infinite at |φ| = 2π."""
        inverse: Array = _IDENTITY - 0.5 * self.hat + self._c * self._hat2
        return inverse

    @property
    def right_inverse(self) -> Array:
        """J_r⁻¹(φ) = J_l⁻¹(φ)ᵀ, shape (3, 3)."""
        return self.left_inverse.T

    def left_rate(self, rate: Array) -> Array:
        """Return d/dt J_l(φ) where φ̇ = rate, shape (3, 3) [1/s]."""
        return self._rate_of(self._a, self._b, self._slope_a, self._slope_b, rate)

    def left_inverse_rate(self, rate: Array) -> Array:
        """Return d/dt J_l⁻¹(φ) where φ̇ = rate, shape (3, 3) [1/s]."""
        return self._rate_of(-0.5, self._c, 0.0, self._slope_c, rate)

    def _rate_of(self, x: float, y: float, slope_x: float, slope_y: float, rate: Array) -> Array:
        """Rate of I + x·[φ] + y·[φ]², with x' = slope_x·θ and y' = slope_y·θ."""
        turned, along = hat(rate), float(self.phi @ rate)  # θ·θ̇
        of_square = turned @ self.hat + self.hat @ turned
        change: Array = x * turned + y * of_square
        return change + along * (slope_x * self.hat + slope_y * self._hat2)
