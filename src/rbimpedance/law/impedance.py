"""The target impedance: how the arm should give way to the environment.

`Impedance` is the paper's, M_d q̈_e + D_d q̇_e + K_d q_e = tau_ext with an exact
discrete filter. `TargetImpedance` is what a controller needs of it, or of any other target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number
from .._common.brief import brief_repr
from .._common.frozen import Converted, OptionalGain, set_fields, unless_none
from ..exceptions import DimensionError, ParameterError

_MISSING = {
    "mass": "a positive number, as in Impedance(1.0, stiffness=100.0); an arm that keeps its own inertia needs none, "
    "see `CompliantController`",
    "stiffness": "a positive number, as in Impedance(1.0, stiffness=100.0); a small one lets the arm be led by hand",
}

_ORDERS = np.arange(22.0)  # of an exponential's series: 1/22! is 1e-21


class TargetFilter(Protocol):
    """A target impedance M_d a_e + r(q_e, v_e) = tau_ext at a fixed period; r is odd."""

    def acceleration(self, q_e: Array, v_e: Array, tau_ext: Array) -> Array:
        """Return a_e = M_d⁻¹(tau_ext - r(q_e, v_e)), shape (nv,) [rad/s² or m/s²]."""

    def advance(
        self, q_e: Array, v_e: Array, tau_ext: Array, period: float | None = None
    ) -> tuple[Array, Array]:
        """Return q_e and v_e one period later, with tau_ext held, each of shape (nv,); the filter's own by default."""

    def restoring_torque(self, q_e: Array, v_e: Array) -> Array:
        """Return r(q_e, v_e), the torque of spring and damper, shape (nv,) [N·m or N]."""

    def error(self, e1: Array, e2: Array, e3: Array, q_e: Array, v_e: Array) -> Array:
        """Return the residual of the target, shape (nv,) [N·m or N].

        It is M_d(a_d - a) + r(q_d - q, v_d - v) + tau_ext of the paper's eq. (2), written with the errors to
        the impedance reference: M_d·e3 + r(q_e, v_e) - r(q_e - e1, v_e - e2). For a linear r that is
        eq. (5).

        Args:
            e1: Position error q_r (-) q, shape (nv,) [rad or m].
            e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
            e3: Acceleration error a_r - a, shape (nv,) [rad/s² or m/s²].
            q_e: Filter position at that instant, shape (nv,) [rad or m].
            v_e: Filter velocity, shape (nv,) [rad/s or m/s].
        """


class TargetImpedance(Protocol):
    """What a controller needs of a target impedance."""

    def filter(self, nv: int, dt: float) -> TargetFilter:
        """Return its discrete filter for nv joints at the period dt [s].

        Raises:
            DimensionError: A parameter was given for another number of joints.
        """


def _positive_definite(name: str, value: ArrayLike | None) -> Array:
    """Return a read-only copy of a positive scalar, vector, or symmetric positive definite matrix."""
    words = "a positive number, a vector of positive numbers (nv,), or a symmetric positive definite matrix (nv, nv)"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError(name, value, words) from error
    if array.ndim > 2 or (array.ndim == 2 and array.shape[0] != array.shape[1]):
        raise DimensionError(name, words, f"shape {array.shape}")
    if not np.isfinite(array).all():
        raise ParameterError(name, value, words + ", all finite")
    if array.ndim < 2:
        if not (array > 0.0).all():
            raise ParameterError(name, value, words)
    else:
        if np.abs(array - array.T).max() > 1e-10 * np.abs(array).max():
            raise ParameterError(name, value, words + " (it is not symmetric)")
        array = (array + array.T) / 2.0
        if np.linalg.eigvalsh(array)[0] <= 0.0:
            raise ParameterError(name, value, words + " (it is not positive definite)")
    array.setflags(write=False)
    return array


def _given(name: str, value: ArrayLike | None) -> Array:
    if value is None:
        raise ParameterError(name, None, _MISSING[name])
    return _positive_definite(name, value)


@brief_repr("mass", "damping", "stiffness")
@dataclass(frozen=True, eq=False)
class Impedance:
    """The mass, damper and spring that the arm should feel like: M_d, D_d, K_d (paper, eq. 2).

    Each is a scalar (the same on every joint), a vector (nv,) (its own on each joint) or a symmetric positive
    definite matrix (nv, nv). `Impedance(1.0, stiffness=100.0)` is critically damped.

    Attributes:
        mass: M_d [kg·m² or kg].
        damping: D_d [N·m·s/rad or N·s/m], or None where a damping ratio is used.
        stiffness: K_d [N·m/rad or N/m].
        damping_ratio: ζ of every vibration mode of (M_d, K_d); 1 if neither it nor the damping is given, None where
            the damping is given.

    Raises:
        ParameterError: Mass or stiffness missing, a value that is not finite, not symmetric or not positive definite,
            or both `damping` and `damping_ratio` given.
        DimensionError: A shape other than (), (nv,) or (nv, nv).
    """

    mass: Converted[ArrayLike | None, Array] = Converted(_given, None)
    damping: OptionalGain = Converted(unless_none(_positive_definite), None)
    stiffness: Converted[ArrayLike | None, Array] = Converted(_given, None)
    damping_ratio: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        set_fields(self, damping_ratio=chosen_damping_ratio(self.damping, self.damping_ratio))

    def matrices(self, nv: int) -> ImpedanceMatrices:
        """Return M_d, D_d and K_d as matrices.

        With a damping ratio, D_d = M_d Φ diag(2ζω_i) Φᵀ M_d from the generalised eigenproblem
        K_d Φ = M_d Φ diag(ω_i²), Φᵀ M_d Φ = I: every mode of (M_d, K_d) has that ratio exactly.

        Args:
            nv: Number of joints.

        Raises:
            DimensionError: A vector or matrix was given for another number of joints.
        """
        M_d = _matrix("mass", self.mass, nv)
        K_d = _matrix("stiffness", self.stiffness, nv)
        if self.damping is not None:
            return ImpedanceMatrices(M_d, _matrix("damping", self.damping, nv), K_d)
        from scipy.linalg import eigh  # noqa: PLC0415 (SciPy is loaded when needed)

        zeta = cast("float", self.damping_ratio)
        omega_squared, modes = eigh(K_d, M_d)
        M_modes = M_d @ modes
        D_d = (M_modes * (2.0 * zeta * np.sqrt(omega_squared))) @ M_modes.T
        return ImpedanceMatrices(M_d, D_d, K_d)

    def filter(self, nv: int, dt: float) -> ImpedanceFilter:
        """Return the discrete filter of eq. (3) for nv joints at the period dt [s].

        Raises:
            DimensionError: A vector or matrix was given for another number of joints.
        """
        return ImpedanceFilter(self.matrices(nv), dt)


class ImpedanceMatrices(NamedTuple):
    """M_d, D_d and K_d, each symmetric positive definite, shape (nv, nv)."""

    M_d: Array
    D_d: Array
    K_d: Array


Number = TypeVar("Number", float, Array)


def impedance_error(m: Number, d: Number, k: Number, e1: Number, e2: Number, e3: Number) -> Number:
    """One joint's share of e_im = M_d·e3 + D_d·e2 + K_d·e1 (paper, eq. 5), from an entry of each matrix."""
    return m * e3 + d * e2 + k * e1


class ImpedanceFilter:
    """Exact zero-order-hold step of M_d a_e + D_d v_e + K_d q_e = tau_ext (paper, eq. 3).

    One matrix exponential at construction; a step is two products, one of another length the exponential's series.

    Attributes:
        matrices: M_d, D_d and K_d.
    """

    def __init__(self, matrices: ImpedanceMatrices, dt: float) -> None:
        from scipy.linalg import expm  # noqa: PLC0415 (SciPy is loaded when needed)

        M_d, D_d, K_d = matrices
        nv = len(M_d)
        M_inverse = np.linalg.inv(M_d)
        system = np.zeros((3 * nv, 3 * nv))
        system[:nv, nv : 2 * nv] = np.eye(nv)
        system[nv : 2 * nv] = M_inverse @ np.hstack([-K_d, -D_d, np.eye(nv)])
        transition = expm(system * dt)[: 2 * nv]
        self._nv = nv
        self.matrices = matrices
        self._acceleration_map = np.ascontiguousarray(system[nv : 2 * nv])
        self._transition = np.ascontiguousarray(transition)
        self._speed = _speed(M_inverse @ D_d, M_inverse @ K_d)
        self._series = _series(system / self._speed)

    def maps(self) -> Array:
        """Return the maps from (q_e, v_e, tau_ext) to a_e and to the next q_e and v_e, stacked, (3·nv, 3·nv)."""
        return np.vstack([self._acceleration_map, self._transition])

    def acceleration(self, q_e: Array, v_e: Array, tau_ext: Array) -> Array:
        """Return a_e of eq. (3), shape (nv,) [rad/s²].

        Args:
            q_e: Filter position, shape (nv,) [rad].
            v_e: Filter velocity, shape (nv,) [rad/s].
            tau_ext: External torque, shape (nv,) [N·m].
        """
        a_e: Array = self._acceleration_map @ np.concatenate([q_e, v_e, tau_ext])
        return a_e

    def advance(
        self, q_e: Array, v_e: Array, tau_ext: Array, period: float | None = None
    ) -> tuple[Array, Array]:
        """Return q_e and v_e one period later, with tau_ext held, each of shape (nv,).

        Args:
            q_e: Filter position, shape (nv,) [rad].
            v_e: Filter velocity, shape (nv,) [rad/s].
            tau_ext: External torque over the period, shape (nv,) [N·m].
            period: Another than the filter's own, as measured [s].
        """
        nv, state = self._nv, np.concatenate([q_e, v_e, tau_ext])
        state = self._transition @ state if period is None else self._over(state, period)
        return state[:nv].copy(), state[nv : 2 * nv].copy()

    def _over(self, state: Array, period: float) -> Array:
        """Return exp(A·period) applied to (q_e, v_e, tau_ext), to rounding.

        By the series, in parts that are short against the target's own motion. A matrix exponential at every tick would
        take longer, and its linear algebra waits for cores that other processes hold.
        """
        reach = self._speed * period
        parts = math.ceil(reach)
        powers = (reach / parts) ** _ORDERS
        for _ in range(parts):
            state = powers @ (self._series @ state)
        return state

    def restoring_torque(self, q_e: Array, v_e: Array) -> Array:
        """Return D_d·v_e + K_d·q_e, shape (nv,) [N·m]; see `TargetFilter.restoring_torque`."""
        _, D_d, K_d = self.matrices
        torque: Array = D_d @ v_e + K_d @ q_e
        return torque

    def error(self, e1: Array, e2: Array, e3: Array, q_e: Array, v_e: Array) -> Array:
        """Return e_im = M_d·e3 + D_d·e2 + K_d·e1, shape (nv,) [N·m]; see `impedance_error`.

        The residual of a linear target depends on the errors alone; see `TargetFilter.error`.
        """
        del q_e, v_e
        M_d, D_d, K_d = self.matrices
        e_im: Array = impedance_error(M_d, D_d, K_d, e1, e2, e3).sum(axis=1)
        return e_im


def _series(A: Array) -> Array:
    """Return Aᵏ/k! for the powers k of an exponential's series, shape (len(`_ORDERS`), n, n)."""
    terms = [np.eye(len(A))]
    for k in _ORDERS[1:]:
        terms.append(A @ terms[-1] / k)
    return np.stack(terms)


def _speed(damping: Array, stiffness: Array) -> float:
    """Bound on the eigenvalues of a target [1/s], from M_d⁻¹·D_d and M_d⁻¹·K_d: norm of A with q_e scaled by ω."""
    omega = math.sqrt(np.linalg.norm(stiffness, 1))
    return float(omega + np.linalg.norm(damping, 1))


def chosen_damping_ratio(damping: ArrayLike | None, damping_ratio: float | None) -> float | None:
    """Return the damping ratio that a target uses: the one given, 1 without any damping, None with a damping.

    Raises:
        ParameterError: Both are given, or the ratio is not a positive number.
    """
    if damping is not None:
        if damping_ratio is not None:
            words = "left out where damping is given: a target has one damping"
            raise ParameterError("damping_ratio", damping_ratio, words)
        return None
    if damping_ratio is None:
        return 1.0
    return positive_number("damping_ratio", damping_ratio, "damping ratio")


def _matrix(name: str, value: Array, nv: int) -> Array:
    """Put a scalar or a vector on the diagonal."""
    if value.ndim == 0:
        return float(value) * np.eye(nv)
    if value.shape[0] != nv:
        raise DimensionError(
            name, f"a scalar, (nv,) = ({nv},) or (nv, nv) = ({nv}, {nv})", f"shape {value.shape}"
        )
    return np.diag(value) if value.ndim == 1 else np.array(value)
