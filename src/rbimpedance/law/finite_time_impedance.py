"""A target impedance with homogeneous damping and stiffness: finite-time return after release."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive, positive_number
from .._common.brief import brief_repr
from .._common.frozen import Converted, OptionalGain, set_fields, unless_none
from ..exceptions import ParameterError
from .impedance import ImpedanceFilter, ImpedanceMatrices, TargetFilter, chosen_damping_ratio

SMALLEST_EXPONENT = 0.01
"""Below it sig(x)^α1 is a relay, and its powers leave the range of float64."""


def _positive_diagonal(name: str, value: ArrayLike | None) -> Array:
    """Return a read-only positive scalar or vector; a matrix is refused with the reason."""
    if value is None or np.ndim(value) == 2:
        words = "a positive scalar or one number per joint (no matrix: sig acts joint by joint)"
        raise ParameterError(name, value, words)
    return positive(name, value)


def _exponent(name: str, value: float | None) -> float:
    alpha1 = positive_number(name, value, "exponent of at most 1")
    if not SMALLEST_EXPONENT <= alpha1 <= 1.0:
        words = f"in [{SMALLEST_EXPONENT:g}, 1]; 1 is the linear impedance"
        raise ParameterError(name, value, words)
    return alpha1


@brief_repr()
@dataclass(frozen=True, eq=False)
class FiniteTimeImpedance:
    """A target that returns in finite time after release: the paper's future work.

    On each joint, with sig(x)^p = sign(x)·abs(x)^p,

        M_d·a_e + D_d·sig(v_e)^α2 + K_d·sig(q_e)^α1 = tau_ext,    α2 = 2·α1/(1 + α1).

    These exponents make the law homogeneous of negative degree (Bhat and Bernstein), so that without
    tau_ext the deviation q_e is exactly zero after a finite time; from rest that time grows like
    abs(q_e)^((1-α1)/2). The spring stores, the damper dissipates: the target is passive.

    The price: under a constant tau_ext ≠ 0 the damper, infinitely steep at v_e = 0, lets q_e creep to
    its equilibrium sig(tau_ext/K_d)^(1/α1) like t^(-2·α1/(1-α1)), slower than the linear target does.

    Gains are per joint. Full matrices are refused: sig acts joint by joint, and K·sig(q_e)^α1 has no
    potential unless K is diagonal, so such a target could give out energy.

    Attributes:
        mass: M_d, scalar or (nv,) [kg·m² or kg].
        damping: D_d, scalar or (nv,) [N·m·(s/rad)^α2 or N·(s/m)^α2], or None where a ratio is given.
        stiffness: K_d, scalar or (nv,) [N·m/rad^α1 or N/m^α1].
        exponent: α1 of the spring, `SMALLEST_EXPONENT` ≤ α1 ≤ 1. At 1 this is `Impedance`.
        damping_ratio: Damping over the least that returns from rest without overshoot, which is
            (1 + α1)·K_d·(α2·K_d/M_d)^(-α2/2); 1 if no damping is given, None where it is.

    Raises:
        ParameterError: Not positive and finite, a matrix, an exponent out of range, or both
            `damping` and `damping_ratio` given.

    References:
        S. P. Bhat, D. S. Bernstein, Continuous finite-time stabilization of the translational and
        rotational double integrators, IEEE Transactions on Automatic Control 43, 1998.
    """

    mass: Converted[ArrayLike | None, Array] = Converted(_positive_diagonal, None)
    damping: OptionalGain = Converted(unless_none(_positive_diagonal), None)
    stiffness: Converted[ArrayLike | None, Array] = Converted(_positive_diagonal, None)
    exponent: Converted[float | None, float] = Converted(_exponent, None)
    damping_ratio: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        set_fields(self, damping_ratio=chosen_damping_ratio(self.damping, self.damping_ratio))

    def filter(self, nv: int, dt: float) -> TargetFilter:
        """Return its discrete filter: exact for exponent 1, else implicit and of second order.

        Args:
            nv: Number of joints.
            dt: Period [s].

        Raises:
            DimensionError: A vector was given for another number of joints.
        """
        m, k = per_joint("mass", self.mass, nv), per_joint("stiffness", self.stiffness, nv)
        d = per_joint("damping", self._damping(m, k), nv)
        if self.exponent == 1.0:
            return ImpedanceFilter(ImpedanceMatrices(np.diag(m), np.diag(d), np.diag(k)), dt)
        from .finite_time_filter import HomogeneousFilter  # noqa: PLC0415 (SciPy's solvers, loaded when needed)

        return HomogeneousFilter(m, d, k, self.exponent, dt)

    def _damping(self, m: Array, k: Array) -> Array:
        if self.damping is not None:
            return self.damping
        alpha1 = self.exponent
        alpha2 = 2.0 * alpha1 / (1.0 + alpha1)
        critical = (1.0 + alpha1) * k * (alpha2 * k / m) ** (-alpha2 / 2.0)
        d: Array = cast("float", self.damping_ratio) * critical
        return d
