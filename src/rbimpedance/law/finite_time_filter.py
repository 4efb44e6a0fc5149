"""The discrete filter of m·a + d·sig(v)^α2 + k·sig(x)^α1 = τ, α2 = 2·α1/(1 + α1), joint by joint.

There is no exact step. This one is implicit, of second order where the field is smooth, and never
gains energy that the environment did not supply; docs/theory.md derives it. With h the period, w the
unknown velocity over it, and S the potential k·abs(x)^(α1+1)/(α1+1) of the spring,

    x⁺ = x + h·w,    v⁺ = v + (w - v)/θ,
    m·(w - v)/(θ·h) + (1 - χ)·[S(x⁺) - S(x)]/(x⁺ - x) + χ·S'(x⁺) + d·sig(w)^α2 = τ.

θ goes from ½ (midpoint) where the damper is slow to 1 (implicit Euler) where it is fast against h, as
it always is near v = 0; χ = (2θ - 1)² takes the spring along, from the mean force, which stores exactly
what it is given, to the force at the end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from .._common.arrays import Array
from .formulas import signed_power
from .surfaces import sig

_RELATIVE_TOLERANCE = 4.0 * np.finfo(np.float64).eps  # the least that brentq takes
_ABSOLUTE_TOLERANCE = 1e-300
_MAX_BISECTIONS = 1100  # from the largest to the smallest float64


class HomogeneousFilter:
    """Implicit step of a homogeneous mass, damper and spring on each joint.

    Args:
        mass: m, shape (nv,) [kg·m² or kg].
        damping: d, shape (nv,) [N·m·(s/rad)^α2 or alike].
        stiffness: k, shape (nv,) [N·m/rad^α1 or alike].
        exponent: α1 of the spring, 0 < α1 ≤ 1.
        dt: Period [s].
    """

    def __init__(
        self, mass: Array, damping: Array, stiffness: Array, exponent: float, dt: float
    ) -> None:
        self._mass = mass
        self._damping = damping
        self._stiffness = stiffness
        self._alpha1 = exponent
        self._alpha2 = 2.0 * exponent / (1.0 + exponent)
        self._dt = dt

    def acceleration(self, q_e: Array, v_e: Array, tau_ext: Array) -> Array:
        """Return a_e, shape (nv,) [rad/s² or m/s²]; see `TargetFilter.acceleration`."""
        a_e: Array = (tau_ext - self.restoring_torque(q_e, v_e)) / self._mass
        return a_e

    def restoring_torque(self, q_e: Array, v_e: Array) -> Array:
        """Return d·sig(v_e)^α2 + k·sig(q_e)^α1, shape (nv,) [N·m or N]."""
        torque: Array = self._damping * sig(v_e, self._alpha2)
        return torque + self._stiffness * sig(q_e, self._alpha1)

    def error(self, e1: Array, e2: Array, e3: Array, q_e: Array, v_e: Array) -> Array:
        """Return the residual of the target, shape (nv,) [N·m or N]; see `TargetFilter.error`."""
        required = self.restoring_torque(q_e, v_e)
        actual = self.restoring_torque(q_e - e1, v_e - e2)
        return self._mass * e3 + required - actual

    def advance(
        self, q_e: Array, v_e: Array, tau_ext: Array, period: float | None = None
    ) -> tuple[Array, Array]:
        """Return q_e and v_e one period later, with tau_ext held, each of shape (nv,); see `TargetFilter.advance`."""
        h = self._dt if period is None else period
        joints = zip(self._mass, self._damping, self._stiffness, q_e, v_e, tau_ext, strict=True)
        steps = [self._advance_joint(h, *map(float, joint)) for joint in joints]
        q_next, v_next = np.array(steps).T
        return q_next.copy(), v_next.copy()

    def _advance_joint(
        self, h: float, m: float, d: float, k: float, x: float, v: float, tau: float
    ) -> tuple[float, float]:
        alpha1, alpha2 = self._alpha1, self._alpha2
        theta = 0.5 + 1.0 / (2.0 + 12.0 * m * math.pow(abs(v), 1.0 - alpha2) / (h * d))
        inertia = m / (theta * h)
        force = inertia * v + tau - k * signed_power(x, alpha1)
        sign = math.copysign(1.0, force)  # of w; for a negative one solve the mirror image
        x, v, tau, force = sign * x, sign * v, sign * tau, sign * force

        def residual(y: float) -> float:
            """Balance of forces at w = y^(1/α2): the damper is linear in y."""
            w = math.pow(y, 1.0 / alpha2)
            spring = k * _spring(x, h * w, alpha1, (2.0 * theta - 1.0) ** 2)
            return inertia * (w - v) + spring + d * y - tau

        largest = min(force / d, math.pow(force / inertia, alpha2))  # the spring resists w > 0
        w = math.pow(_root(residual, largest), 1.0 / alpha2)
        return sign * (x + h * w), sign * (v + (w - v) / theta)


def _root(residual: Callable[[float], float], largest: float) -> float:
    """Root of an increasing function on [0, largest], where one is but for rounding."""
    if residual(0.0) >= 0.0:
        return 0.0
    if residual(largest) <= 0.0:
        return largest
    return float(
        brentq(
            residual,
            0.0,
            largest,
            xtol=_ABSOLUTE_TOLERANCE,
            rtol=_RELATIVE_TOLERANCE,
            maxiter=_MAX_BISECTIONS,
        )
    )


def _spring(x: float, step: float, p: float, implicit: float) -> float:
    """Mean of sig(ξ)^p from x to x + step, blended with its value at the end."""
    return (1.0 - implicit) * _mean_power(x, step, p) + implicit * signed_power(x + step, p)


def _mean_power(x: float, step: float, p: float) -> float:
    """Mean of sig(ξ)^p for ξ from x to x + step, accurate for steps of any size.

    It is the difference of the potential abs(ξ)^(p+1)/(p+1) over the step.
    """
    end = x + step
    if abs(end) > abs(x):
        x, step = end, -step
    ratio = step / x if x else 0.0  # in [-2, 0]
    if ratio == 0.0:
        return signed_power(x, p)
    return signed_power(x, p) * _growth(ratio, p + 1.0) / ((p + 1.0) * ratio)


def _growth(ratio: float, p: float) -> float:
    """abs(1 + ratio)^p - 1 without cancellation."""
    if ratio < -0.5:
        return math.pow(abs(1.0 + ratio), p) - 1.0
    return math.expm1(p * math.log1p(ratio))
