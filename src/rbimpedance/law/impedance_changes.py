"""An impedance that changes while it runs: blends of two, and when the change cannot make the target unstable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._common.arrays import Array, positive_number
from ..exceptions import DimensionError, ParameterError
from .impedance import Impedance


def blend(first: Impedance, second: Impedance, share: float, nv: int) -> Impedance:
    """Return the impedance that is the given share of the way from one to another; positive definite like both.

    M_d, D_d and K_d go in a straight line each; a damping given as a ratio is turned into D_d first.

    Args:
        first: Where share = 0.
        second: Where share = 1.
        share: From 0 to 1.
        nv: Number of joints.

    Raises:
        ParameterError: A share outside [0, 1].
        DimensionError: An impedance for another number of joints.
    """
    if not 0.0 <= share <= 1.0:
        raise ParameterError("share", share, "from 0 to 1")
    pairs = zip(first.matrices(nv), second.matrices(nv), strict=True)
    return Impedance(*((1.0 - share) * a + share * b for a, b in pairs))


class VariationReport(NamedTuple):
    """What `check_variation` found.

    Attributes:
        stable: Whether the conditions hold at every sample.
        alpha: The α with the largest margin [1/s].
        margin: Share by which the worst condition is kept at each sample, shape (N,); negative where it is broken.
        passive: Whether the target takes in energy only, seen from the velocity: the conditions hold with α = 0.
    """

    stable: bool
    alpha: float
    margin: NDArray[np.float64]
    passive: bool


def check_variation(impedances: Sequence[Impedance], dt: float, nv: int) -> VariationReport:
    """Say whether M_d(t) a_e + D_d(t) v_e + K_d(t) q_e = tau_ext stays stable while its matrices change.

    With r = v_e + α·q_e and β = K_d + α·(D_d - α·M_d - Ṁ_d), the storage V = ½ rᵀM_d r + ½ q_eᵀβ q_e obeys
    V̇ = rᵀtau_ext - v_eᵀ(D_d - αM_d - ½Ṁ_d)v_e - q_eᵀ[αK_d - ½(K̇_d + αḊ_d - αM̈_d)]q_e. So where for one α ≥ 0

        αM_d + ½Ṁ_d ⪯ D_d,    K̇_d + αḊ_d - αM̈_d ⪯ 2αK_d,    β ⪰ 0

    hold all along, V cannot grow in free motion, and the target is passive from tau_ext to r. Only with α = 0, where no
    stiffness may grow, is it passive from tau_ext to v_e: a spring that is stiffened while it is stretched puts energy
    into what it touches. The conditions are sufficient, not necessary.

    Args:
        impedances: The impedance at equally spaced times, at least three.
        dt: Time from one to the next [s].
        nv: Number of joints.

    Raises:
        ParameterError: dt is not a positive number.
        DimensionError: Fewer than three samples, or an impedance for another number of joints.

    References:
        K. Kronander, A. Billard, Stability considerations for variable impedance control, IEEE Transactions on
        Robotics 32, 2016 (constant M_d; extended here to a changing one).
        F. Ferraguti, C. Secchi, C. Fantuzzi, A tank-based approach to impedance control with variable stiffness,
        ICRA 2013, for what to do where the conditions fail.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 (SciPy is loaded when needed)

    dt = positive_number("dt", dt, "time between samples in seconds")
    if len(impedances) < 3:
        raise DimensionError("impedances", "at least three samples", f"{len(impedances)}")
    along = _Variation(impedances, dt, nv)
    largest = float(along.damping_rate.min())
    alpha = 0.0
    if largest > 0.0:
        search = minimize_scalar(
            lambda x: -along.margin(x).min(), bounds=(0.0, largest), method="bounded"
        )
        alpha = max((0.0, largest, float(search.x)), key=lambda x: along.margin(x).min())
    margin = along.margin(alpha)
    return VariationReport(
        bool((margin >= -_ROUNDING).all()),
        alpha,
        margin,
        bool((along.margin(0.0) >= -_ROUNDING).all()),
    )


_ROUNDING = 1e-9  # relative: what central differences leave of a matrix that does not change


class _Variation:
    """The matrices along the change, and their rates by central differences."""

    def __init__(self, impedances: Sequence[Impedance], dt: float, nv: int) -> None:
        matrices = [impedance.matrices(nv) for impedance in impedances]
        self.M, self.D, self.K = (np.array(stack) for stack in zip(*matrices, strict=True))
        rates = [np.gradient(X, dt, axis=0, edge_order=2) for X in (self.M, self.D, self.K)]
        self.M_rate, self.D_rate, self.K_rate = rates
        self.M_curve = np.gradient(self.M_rate, dt, axis=0, edge_order=2)

    @property
    def damping_rate(self) -> Array:
        """The largest α of the first condition at each sample, shape (N,) [1/s]."""
        return _smallest(self.D - self.M_rate / 2.0, self.M)

    def margin(self, alpha: float) -> Array:
        """The worst of the conditions at each sample as a share of D_d or K_d, shape (N,)."""
        M, D, K = self.M, self.D, self.K
        first = D - alpha * M - self.M_rate / 2.0
        change = (self.K_rate + alpha * (self.D_rate - self.M_curve)) / 2.0
        storage = K + alpha * (D - alpha * M - self.M_rate)
        rate = float(self.damping_rate.max())
        second = (alpha * K - change) / (rate or 1.0)
        parts = (_smallest(first, D), _smallest(second, K), _smallest(storage, K))
        return np.asarray(np.min(parts, axis=0), dtype=np.float64)


def _smallest(A: Array, B: Array) -> Array:
    """Smallest eigenvalue of each B⁻¹A, for symmetric A and positive definite B, shape (N,)."""
    root = np.linalg.inv(np.linalg.cholesky(B))
    smallest = np.linalg.eigvalsh(root @ A @ np.swapaxes(root, 1, 2))[:, 0]
    return np.asarray(smallest, dtype=np.float64)
