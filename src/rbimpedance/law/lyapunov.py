"""Quadratic Lyapunov functions of the super-twisting law of one joint (paper, eqs. 11 to 18).

In the time σ with dt = abs(x1)·dσ, and with x1 and y = x2/√(2·k2), the law is the linear system

    x1' = ω(-2ζ·x1 + y),    y' = ω(-1 + δ)·x1,    abs(δ) ≤ ρ,
    ω = √(k2/2),  ζ = k1/(4ω),  ρ = d_max/k2.

Up to scale, every quadratic form is V = x1² + (y + (n - ζ)·x1)²/u² for one n and one u > 0.
docs/theory.md shows that V' ≤ -ω·ε·V with

    ε = 2ζ - √(4n² + (abs(u - κ/u) + ρ/u)²),    κ = 1 - ζ² + n²,

and with no larger ε: the matrix inequality (13) is solved in closed form. As abs(x1) ≤ V^½, the
time 2·V(0)^½/(ω·ε) bounds the reaching time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array

_STRICTNESS = 1e-4  # share of ε given away, so that (13) holds strictly in floating point
_TOLERANCE = 1e-7  # of a scalar search, relative to its interval


class Law:
    """The super-twisting law of one joint, with its scaled parameters.

    Attributes:
        k1: Gain of the root.
        k2: Gain of the integral.
        d_max: Bound on the disturbance's rate.
        omega: ω = √(k2/2), rate of the scaled system.
        zeta: ζ = k1/(4ω), damping ratio.
        rho: ρ = d_max/k2, share of k2 that the disturbance takes.
        y_scale: √(2·k2), x2 = y_scale·y.
    """

    def __init__(self, k1: float, k2: float, d_max: float) -> None:
        self.k1, self.k2, self.d_max = k1, k2, d_max
        self.omega = math.sqrt(k2 / 2.0)
        self.zeta = k1 / (4.0 * self.omega)
        self.rho = d_max / k2
        self.y_scale = 2.0 * self.omega

    @property
    def A(self) -> Array:  # noqa: N802
        """A of eq. 12, shape (2, 2)."""
        return np.array([[-self.k1 / 2.0, 0.5], [-self.k2, 0.0]])


class Shape(NamedTuple):
    """A quadratic form V = x1² + (y + m·x1)²/u² up to scale; C·P⁻¹·Cᵀ = 1.

    Attributes:
        m: n - ζ, between -2ζ and 0 if V decreases.
        u: Positive.
    """

    m: float
    u: float

    def matrix(self, law: Law) -> Array:
        """The form's matrix in x = (x1, x2), shape (2, 2)."""
        row = np.array([self.m, 1.0 / law.y_scale]) / self.u
        matrix: Array = np.diag([1.0, 0.0]) + np.outer(row, row)
        return matrix

    def size(self, law: Law, x0: Array) -> float:
        """V(x0)^½."""
        return math.hypot(x0[0], (x0[1] / law.y_scale + self.m * x0[0]) / self.u)

    def smallest_eigenvalue(self, law: Law) -> float:
        """λ_min of the matrix, as determinant over λ_max: exact for any condition number."""
        c = 1.0 / (self.u * law.y_scale) ** 2
        a, b = 1.0 + (self.m / self.u) ** 2, self.m * law.y_scale * c
        return c / ((a + c) / 2.0 + math.hypot((a - c) / 2.0, b))


class Solution(NamedTuple):
    """A Lyapunov function of one joint, strictly inside the matrix inequality (13).

    Attributes:
        P: Its matrix in x = (abs(s)^½·sgn(s), z2), scaled as (13) wants it, shape (2, 2).
        epsilon: Its decay: V̇ ≤ -ε·V/abs(x1).
        reaching_time: 2·(V(0)·C·P⁻¹·Cᵀ)^½/ε, bound on the time at which x = 0 [s].
        reaching_time_paper: T0 of the paper (eq. 18), at its best Riccati solution or this P [s].
        s_bound: V(0)·C·P⁻¹·Cᵀ, bound on abs(s) from the start on.
    """

    P: Array
    epsilon: float
    reaching_time: float
    reaching_time_paper: float
    s_bound: float


def admissible_rate(k1: Array, k2: Array) -> Array:
    """Largest d_max for which (13) has a solution: the H∞ condition in closed form.

    k2 where k1² ≥ 4·k2, else k2·2ζ·√(1 - ζ²). This is the inverse of the largest
    abs(C(jωI - A)⁻¹B) = ½/abs((jω)² + k1·jω/2 + k2/2), found at ω = 0 or at the resonance.
    """
    zeta_squared = np.minimum(k1**2 / (8.0 * k2), 0.5)
    rate: Array = k2 * 2.0 * np.sqrt(zeta_squared * (1.0 - zeta_squared))
    return rate


def solve(law: Law, x0: Array) -> Solution:
    """Find the Lyapunov function that bounds the reaching time from x0 best.

    Args:
        law: Gains and disturbance bound with d_max below `admissible_rate`.
        x0: (abs(s)^½·sgn(s), z2) at the start, shape (2,).
    """
    start = x0 if x0.any() else np.array([1.0, 0.0])
    found = _best_shape(law, start), _best_riccati(law, start)
    shapes = [shape for shape in found if shape is not None]
    shape = min(shapes, key=lambda shape: _reaching_time(law, start, shape))
    epsilon = _epsilon(law, shape)
    P = shape.matrix(law)
    return Solution(
        P=_multiplier(law, P, epsilon) * P,
        epsilon=epsilon,
        reaching_time=_reaching_time(law, x0, shape),
        reaching_time_paper=min(_printed_time(law, x0, shape) for shape in shapes),
        s_bound=shape.size(law, x0) ** 2,
    )


def _epsilon(law: Law, shape: Shape) -> float:
    """Decay of a form, less what keeps (13) strict; not positive if V does not decrease."""
    return (1.0 - _STRICTNESS) * law.omega * _decay(law, shape)


def _reaching_time(law: Law, x0: Array, shape: Shape) -> float:
    """2·(V(0)·C·P⁻¹·Cᵀ)^½/ε; infinite if V does not decrease."""
    epsilon = _epsilon(law, shape)
    return 2.0 * shape.size(law, x0) / epsilon if epsilon > 0.0 else math.inf


def _printed_time(law: Law, x0: Array, shape: Shape) -> float:
    """T0 of the paper (eq. 18): 2·V(0)^½/(ε·λ_min(P)^½)."""
    return _reaching_time(law, x0, shape) / math.sqrt(shape.smallest_eigenvalue(law))


def _best_riccati(law: Law, x0: Array) -> Shape | None:
    """Riccati solution of (13) at the ε that makes the paper's T0 smallest.

    The decay of each is taken from the closed form and not from the requested ε: near the
    largest one a solver may return a matrix that solves nothing.
    """

    def negative_rate(epsilon: float) -> float:
        shape = _riccati(law, epsilon)
        return 0.0 if shape is None else -1.0 / _printed_time(law, x0, shape)

    epsilon, _ = _minimum(negative_rate, 0.0, _largest_decay(law), 1e-3)
    return _riccati(law, epsilon)


def _riccati(law: Law, epsilon: float) -> Shape | None:
    """Shape of the stabilising solution of the Riccati equation of (13), if there is one.

    In scaled units, with X = P/ρ² so that ρ = 0 is a case like any other, it reads
    AᵀX + XA + εX + CᵀC + ρ²·X·B·BᵀX = 0. An ordered Schur form of the Hamiltonian matrix solves it
    (Laub 1979).
    """
    from scipy.linalg import schur  # noqa: PLC0415 (SciPy is loaded when needed)

    shifted = np.array([[epsilon / 2.0 - 2.0 * law.zeta, 1.0], [-1.0, epsilon / 2.0]])
    BBt, CtC = np.diag([0.0, law.rho**2]), np.diag([1.0, 0.0])
    try:
        _, U, stable = schur(np.block([[shifted, BBt], [-CtC, -shifted.T]]), sort="lhp")
        X = np.linalg.solve(U[:2, :2].T, U[2:, :2].T)
    except np.linalg.LinAlgError:
        return None
    determinant = X[0, 0] * X[1, 1] - X[0, 1] * X[1, 0]
    if stable != 2 or X[1, 1] <= 0.0 or determinant <= 0.0:
        return None
    return Shape(float(X[0, 1] / X[1, 1]), math.sqrt(determinant) / float(X[1, 1]))


def _decay(law: Law, shape: Shape) -> float:
    """Decay ε of a form in units of ω; not positive if V does not decrease.

    With g² = ζ² - n² and a = 2g - abs(u - κ/u) - ρ/u it is a·(4g - a)/(2ζ + √(4n² + (2g - a)²)),
    which cancels nothing.
    """
    zeta, rho, m, u = law.zeta, law.rho, *shape
    if not -2.0 * zeta < m < 0.0:
        return 0.0
    g = math.sqrt(-m * (2.0 * zeta + m))
    a = min(1.0 - rho - (u - g) ** 2, (u + g) ** 2 - 1.0 - rho) / u
    return a * (4.0 * g - a) / (2.0 * zeta + math.hypot(2.0 * (zeta + m), 2.0 * g - a))


def _largest_decay(law: Law) -> float:
    """Largest ε, in units of ω, for which (13) has a solution: the H∞ condition shifted by ε/2."""
    zeta, rho = law.zeta, law.rho
    if rho >= 2.0 * (1.0 - zeta**2):
        return 2.0 * (1.0 - rho) / (zeta + math.sqrt(zeta**2 - 1.0 + rho))
    return 2.0 * zeta - rho / math.sqrt(1.0 - zeta**2)


def _best_shape(law: Law, x0: Array) -> Shape:
    """Search m and u for the largest ε/V(0)^½: n = ζ·cos(θ) outside, u inside.

    The decay is positive exactly for abs(u - g) < √(1 - ρ) and u + g > √(1 + ρ), g = ζ·sin(θ).
    """
    zeta, rho = law.zeta, law.rho
    low, high = math.sqrt(1.0 - rho), math.sqrt(1.0 + rho)

    def m(theta: float) -> float:
        return -2.0 * zeta * math.sin(theta / 2.0) ** 2

    def best_u(theta: float) -> tuple[float, float]:
        g = zeta * math.sin(theta)

        def negative_rate(u: float) -> float:
            shape = Shape(m(theta), u)
            return -_decay(law, shape) / shape.size(law, x0)

        return _minimum(negative_rate, max(high - g, g - low), g + low)

    margin = math.asin(rho / (high + low) / zeta)  # nearer to 0 and π no u is left
    theta, _ = _minimum(lambda theta: best_u(theta)[1], margin, math.pi - margin)
    return Shape(m(theta), best_u(theta)[0])


def _minimum(
    function: Callable[[float], float], low: float, high: float, tolerance: float = _TOLERANCE
) -> tuple[float, float]:
    """Argument and value of the minimum between two bounds."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 (SciPy is loaded when needed)

    best = minimize_scalar(
        function,
        bounds=(low, high),
        method="bounded",
        options={"xatol": tolerance * (high - low)},
    )
    return float(best.x), float(best.fun)


def _multiplier(law: Law, P: Array, epsilon: float) -> float:
    """Factor that takes P to the middle of the scales at which (13), as printed, holds."""
    inverse = np.linalg.inv(-(law.A.T @ P + P @ law.A + epsilon * P))
    PB = P[:, 1]
    alpha, beta = float(inverse[0, 0]), float(PB @ inverse @ PB)
    mu = float(inverse[0] @ PB)
    return (1.0 + law.d_max**2 * (alpha * beta - mu**2)) / (2.0 * beta)
