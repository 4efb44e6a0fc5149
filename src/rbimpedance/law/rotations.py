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
from typing import TypeAlias

import numpy as np

from .._common.arrays import Array
from . import vectors
from .vectors import Matrix, Vector, dot, vector_of

SMALL = 1.0
"""Angle below which a, b and c are summed as series: there the closed forms lose digits [rad]."""

Coefficients: TypeAlias = tuple[float, float, float, float, float, float]
"""a, b, c and a'/θ, b'/θ, c'/θ."""

_TERMS = 12  # of the series, enough for double precision at `SMALL`
_BERNOULLI = (
    *(1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6),
    *(-3617 / 510, 43867 / 798, -174611 / 330, 854513 / 138, -236364091 / 2730),
)  # B_2, B_4, ...


def _series() -> tuple[Coefficients, ...]:
    """Coefficients of a, b, c and of a'/θ, b'/θ, c'/θ for every power of θ², from the highest one down."""
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
    powers = np.vstack([rows, slopes]).T[::-1].tolist()
    return tuple((a, b, c, d, e, f) for a, b, c, d, e, f in powers)


_SERIES = _series()


def coefficients(theta: float) -> Coefficients:
    """Return a, b, c and a'/θ, b'/θ, c'/θ of this module's text.

    Args:
        theta: Angle, at least 0 and below 2π for c [rad].
    """
    x = theta * theta
    if theta < SMALL:
        a, b, c, slope_a, slope_b, slope_c = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for each in _SERIES:
            a, b, c = each[0] + x * a, each[1] + x * b, each[2] + x * c
            slope_a, slope_b = each[3] + x * slope_a, each[4] + x * slope_b
            slope_c = each[5] + x * slope_c
        return a, b, c, slope_a, slope_b, slope_c
    sin, cos, half = math.sin(theta), math.cos(theta), theta / 2.0
    cot = 1.0 / math.tan(half)
    a, b, c = (1.0 - cos) / x, (theta - sin) / (x * theta), (1.0 - half * cot) / x
    slope_a = (sin / theta - 2.0 * a) / x
    slope_b = (a - 3.0 * b) / x
    slope_c = ((1.0 / math.sin(half) ** 2) / 4.0 - cot / (2.0 * theta) - 2.0 * c) / x
    return a, b, c, slope_a, slope_b, slope_c


def at(phi: Vector) -> Coefficients:
    """Return the coefficients at the angle of a rotation vector."""
    return coefficients(math.sqrt(dot(phi, phi)))


def expansion(x: float, y: float, phi: Vector) -> Matrix:
    """Return I + x·[φ] + y·[φ]²."""
    p, q, r = phi
    xy, xz, yz = y * (p * q), y * (p * r), y * (q * r)
    return (
        1.0 - y * (q * q + r * r), xy - x * r, xz + x * q,
        xy + x * r, 1.0 - y * (p * p + r * r), yz - x * p,
        xz - x * q, yz + x * p, 1.0 - y * (p * p + q * q),
    )  # fmt: skip


def expansion_rate(
    x: float, y: float, slope_x: float, slope_y: float, phi: Vector, rate: Vector
) -> Matrix:
    """Return the rate of `expansion` where φ̇ = rate, with x' = slope_x·θ and y' = slope_y·θ."""
    (p, q, r), (dp, dq, dr), along = phi, rate, dot(phi, rate)  # θ·θ̇
    dx, dy = slope_x * along, slope_y * along
    tx, ty, tz = x * dp + dx * p, x * dq + dx * q, x * dr + dx * r
    xx, yy, zz = (
        (dy * p + 2.0 * y * dp) * p,
        (dy * q + 2.0 * y * dq) * q,
        (dy * r + 2.0 * y * dr) * r,
    )
    xy = dy * p * q + y * (p * dq + dp * q)
    xz = dy * p * r + y * (p * dr + dp * r)
    yz = dy * q * r + y * (q * dr + dq * r)
    return (
        -yy - zz, xy - tz, xz + ty,
        xy + tz, -xx - zz, yz - tx,
        xz - ty, yz + tx, -xx - yy,
    )  # fmt: skip


def exponential(phi: Vector, k: Coefficients) -> Matrix:
    """Return exp(φ)."""
    return expansion(1.0 - k[1] * dot(phi, phi), k[0], phi)


def left(phi: Vector, k: Coefficients) -> Matrix:
    """Return J_l(φ); J_r(φ) is its transpose."""
    return expansion(k[0], k[1], phi)


def left_inverse(phi: Vector, k: Coefficients) -> Matrix:
    """Return J_l⁻¹(φ); J_r⁻¹(φ) is its transpose. Infinite at |φ| = 2π."""
    return expansion(-0.5, k[2], phi)


def left_rate(phi: Vector, k: Coefficients, rate: Vector) -> Matrix:
    """Return d/dt J_l(φ) where φ̇ = rate [1/s]."""
    return expansion_rate(k[0], k[1], k[3], k[4], phi, rate)


def left_inverse_rate(phi: Vector, k: Coefficients, rate: Vector) -> Matrix:
    """Return d/dt J_l⁻¹(φ) where φ̇ = rate [1/s]; that of J_r⁻¹ is its transpose."""
    return expansion_rate(-0.5, k[2], 0.0, k[5], phi, rate)


def logarithm(R: Matrix) -> Vector:
    """Return the rotation vector of a rotation, of the shortest length: by its quaternion, exact at any angle."""
    w, x, y, z = _quaternion(R)
    half_sine = math.sqrt(x * x + y * y + z * z)
    if half_sine == 0.0:
        return 0.0, 0.0, 0.0
    k = 2.0 * math.atan2(half_sine, abs(w)) / math.copysign(half_sine, w)
    return k * x, k * y, k * z


def _quaternion(R: Matrix) -> tuple[float, float, float, float]:
    """A multiple of (w, x, y, z), with its largest part from the diagonal."""
    xx, yy, zz = R[0], R[4], R[8]
    trace = xx + yy + zz
    if trace >= max(xx, yy, zz):
        return 1.0 + trace, R[7] - R[5], R[2] - R[6], R[3] - R[1]
    if xx >= max(yy, zz):
        return R[7] - R[5], 1.0 + 2.0 * xx - trace, R[3] + R[1], R[2] + R[6]
    if yy >= zz:
        return R[2] - R[6], R[3] + R[1], 1.0 + 2.0 * yy - trace, R[7] + R[5]
    return R[3] - R[1], R[2] + R[6], R[7] + R[5], 1.0 + 2.0 * zz - trace


def hat(x: Array) -> Array:
    """Return [x], the matrix of x × ·, shape (3, 3)."""
    x0, x1, x2 = x.tolist()
    return np.array([[0.0, -x2, x1], [x2, 0.0, -x0], [-x1, x0, 0.0]])


def cross(x: Array, y: Array) -> Array:
    """Return x × y, shape (3,)."""
    return np.array(vectors.cross(vector_of(x), vector_of(y)))


class RotationVector:
    """A rotation vector φ: its rotation, the Jacobians of the exponential map and their rates along φ̇, as arrays.

    Args:
        phi: φ, shape (3,) [rad].
    """

    def __init__(self, phi: Array) -> None:
        self.phi, self._phi = phi, vector_of(phi)
        self._k = at(self._phi)

    @property
    def matrix(self) -> Array:
        """exp(φ), shape (3, 3)."""
        return _array(exponential(self._phi, self._k))

    @cached_property
    def left(self) -> Array:
        """J_l(φ), shape (3, 3)."""
        return _array(left(self._phi, self._k))

    @property
    def right(self) -> Array:
        """J_r(φ) = J_l(φ)ᵀ, shape (3, 3)."""
        return self.left.T

    @cached_property
    def left_inverse(self) -> Array:
        """J_l⁻¹(φ), shape (3, 3); infinite at |φ| = 2π."""
        return _array(left_inverse(self._phi, self._k))

    @property
    def right_inverse(self) -> Array:
        """J_r⁻¹(φ) = J_l⁻¹(φ)ᵀ, shape (3, 3)."""
        return self.left_inverse.T

    def left_rate(self, rate: Array) -> Array:
        """Return d/dt J_l(φ) where φ̇ = rate, shape (3, 3) [1/s]."""
        return _array(left_rate(self._phi, self._k, vector_of(rate)))

    def left_inverse_rate(self, rate: Array) -> Array:
        """Return d/dt J_l⁻¹(φ) where φ̇ = rate, shape (3, 3) [1/s]."""
        return _array(left_inverse_rate(self._phi, self._k, vector_of(rate)))


def _array(matrix: Matrix) -> Array:
    return np.array(matrix).reshape(3, 3)
