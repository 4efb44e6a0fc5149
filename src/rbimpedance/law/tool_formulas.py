"""Equations of the law at the tool on tuples of numbers: NumPy's form of a tick and the compiled one compute the same.

(T1) to (T4) are those of docs/theory.md, section 14. A six-vector is a pair (linear, angular); k are the coefficients
of a rotation vector, see `rotations`.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from .rotations import (
    Coefficients,
    at,
    exponential,
    left,
    left_inverse,
    left_inverse_rate,
    left_rate,
    logarithm,
)
from .vectors import (
    Matrix,
    Vector,
    add,
    cross,
    product,
    rotate,
    scale,
    subtract,
    transposed,
    unrotate,
)

Six: TypeAlias = tuple[Vector, Vector]


class FrameMotion(NamedTuple):
    """Motion of a frame in world axes.

    Attributes:
        rotation: Its axes as columns.
        translation: Its origin.
        v: Velocity of the origin, and angular velocity.
        a: Acceleration of the origin, and angular acceleration.
    """

    rotation: Matrix
    translation: Vector
    v: Six
    a: Six


def pulled_back(R_c: Matrix, phi: Vector, k: Coefficients, wrench: Six) -> Six:
    """Give ŵ = (R_cᵀ f, J_l(ξ_φ)ᵀ R_cᵀ m) (T1)."""
    f, m = wrench
    return unrotate(R_c, f), unrotate(left(phi, k), unrotate(R_c, m))


def reference_in_constant_axes(
    R_c: Matrix, k: Coefficients, xi: Six, rate: Six, acceleration: Six, desired: FrameMotion
) -> FrameMotion:
    """Give R_r = R_c exp(ξ_φ) R_cᵀ R_d, p_r = p_d + R_c ξ_p and their rates, for constant R_c (T2)."""
    R_d, p_d, (v_d, w_d), (a_d, alpha_d) = desired
    G = product(product(R_c, exponential(xi[1], k)), transposed(R_c))
    omega, alpha = _turning(R_c, xi[1], k, rate[1], acceleration[1])
    carried = rotate(G, w_d)
    alpha = add(add(alpha, cross(omega, carried)), rotate(G, alpha_d))
    return FrameMotion(
        product(G, R_d),
        add(p_d, rotate(R_c, xi[0])),
        (add(v_d, rotate(R_c, rate[0])), add(omega, carried)),
        (add(a_d, rotate(R_c, acceleration[0])), alpha),
    )


def reference_in_turning_axes(
    R_c: Matrix, k: Coefficients, xi: Six, rate: Six, acceleration: Six, desired: FrameMotion
) -> FrameMotion:
    """Give R_r = R_d exp(ξ_φ), p_r = p_d + R_d ξ_p and their rates: R_c = R_d(t) turns with the reference (T2)."""
    _, p_d, (v_d, w_d), (a_d, alpha_d) = desired
    omega, alpha = _turning(R_c, xi[1], k, rate[1], acceleration[1])
    x, dx, ddx = rotate(R_c, xi[0]), rotate(R_c, rate[0]), rotate(R_c, acceleration[0])
    inertial = add(cross(alpha_d, x), cross(w_d, cross(w_d, x)))
    inertial = add(inertial, scale(2.0, cross(w_d, dx)))
    return FrameMotion(
        product(R_c, exponential(xi[1], k)),
        add(p_d, x),
        (add(add(v_d, cross(w_d, x)), dx), add(w_d, omega)),
        (add(add(a_d, inertial), ddx), add(add(alpha_d, alpha), cross(w_d, omega))),
    )


def displacement(
    R_c: Matrix, turns: bool, desired: FrameMotion, now: FrameMotion
) -> tuple[Six, Six]:
    """Give ξ and ξ̇ for which the reference of (T2) is a given motion.

    Args:
        R_c: Compliance axes.
        turns: Whether they are those of the desired motion.
        desired: Desired motion x_d.
        now: Motion that x_r is to have; its acceleration does not count.
    """
    R_d, p_d, (v_d, w_d), _ = desired
    R, p, (v, w), _ = now
    x, G = subtract(p, p_d), product(R, transposed(R_d))
    phi = logarithm(product(product(transposed(R_c), G), R_c))
    carried = (add(v_d, cross(w_d, x)), w_d) if turns else (v_d, rotate(G, w_d))
    rate = unrotate(R_c, subtract(v, carried[0]))
    turning = rotate(left_inverse(phi, at(phi)), unrotate(R_c, subtract(w, carried[1])))
    return (unrotate(R_c, x), phi), (rate, turning)


def _turning(
    R_c: Matrix, phi: Vector, k: Coefficients, rate: Vector, acceleration: Vector
) -> tuple[Vector, Vector]:
    """R_c J_l φ̇ and R_c (J_l φ̈ + J̇_l φ̇): velocity and acceleration of exp(φ) in world axes."""
    J_l, J_l_rate = left(phi, k), left_rate(phi, k, rate)
    alpha = add(rotate(J_l, acceleration), rotate(J_l_rate, rate))
    return rotate(R_c, rotate(J_l, rate)), rotate(R_c, alpha)


def rotation_error(R_r: Matrix, R: Matrix) -> Vector:
    """Give log(R_r Rᵀ), the rotation vector from one to the other in world axes (T3)."""
    return logarithm(product(R_r, transposed(R)))


def error_rate(phi: Vector, k: Coefficients, v_r: Six, v: Six) -> Six:
    """Give the rate of (p_r - p, φ) with φ the rotation error: φ̇ = J_l⁻¹(φ) ω_r - J_r⁻¹(φ) ω (T3)."""
    inverse = left_inverse(phi, k)
    turning = subtract(rotate(inverse, v_r[1]), unrotate(inverse, v[1]))
    return subtract(v_r[0], v[0]), turning


def error_acceleration(
    phi: Vector, k: Coefficients, rate: Vector, reference: FrameMotion, now: FrameMotion
) -> Six:
    """Give the rate of `error_rate` between two motions (T3).

    Args:
        phi: Rotation error.
        k: Its coefficients.
        rate: Its rate.
        reference: Motion of x_r.
        now: Motion of the tool.
    """
    inverse, changing = left_inverse(phi, k), left_inverse_rate(phi, k, rate)
    ahead = add(rotate(inverse, reference.a[1]), rotate(changing, reference.v[1]))
    behind = add(unrotate(inverse, now.a[1]), unrotate(changing, now.v[1]))
    return subtract(reference.a[0], now.a[0]), subtract(ahead, behind)


def tool_acceleration(
    phi: Vector, k: Coefficients, rate: Vector, reference: FrameMotion, omega: Vector, y: Six
) -> Six:
    """Give the acceleration of the tool for which ë1 = -y (T4).

    Args:
        phi: Rotation error.
        k: Its coefficients.
        rate: Its rate.
        reference: Motion of x_r.
        omega: Angular velocity of the tool.
        y: What is asked of the error.
    """
    (_, w_r), (a_r, alpha_r) = reference.v, reference.a
    changing = left_inverse_rate(phi, k, rate)
    turning = add(rotate(left_inverse(phi, k), alpha_r), rotate(changing, w_r))
    turning = add(subtract(turning, unrotate(changing, omega)), y[1])
    return add(a_r, y[0]), unrotate(left(phi, k), turning)


def of_error(phi: Vector, k: Coefficients, acceleration: Six) -> Six:
    """Give what an acceleration of the tool is in the coordinates of the error: its angular part by J_r⁻¹(φ)."""
    return acceleration[0], unrotate(left_inverse(phi, k), acceleration[1])
