"""Sliding surfaces s(e1, e2): what the errors do once the reaching law has brought s to zero.

Every surface gives the variable s, the feed-forward that makes s obey the reaching law, and the time that its
sliding motion takes. Notation: sig(x)^p = sign(x)·abs(x)^p, elementwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, check_gains, gain, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_attribute
from .._common.frozen import set_fields


def sig(x: Array, p: Array | float) -> Array:
    """Return sign(x)·abs(x)^p, elementwise."""
    power: Array = np.sign(x) * np.abs(x) ** p
    return power


class Surface(Protocol):
    """What the controller and the certificate need of a sliding surface."""

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints; a `DimensionError` says which is not."""

    def value(self, e1: Array, e2: Array) -> Array:
        """Sliding variable s, shape (nv,)."""

    def feedforward(self, e1: Array, e2: Array) -> Array:
        """Acceleration that cancels the surface's own drift, shape (nv,).

        With ė2 = -(feedforward + u) the variable s obeys the reaching law.
        """

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        """Gain of s to an acceleration held for dt, relative to the continuous one; the law divides by it."""

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time that e1 needs on s = 0 until it has settled [s]; infinite if it never does."""

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time that abs(e1) needs on s = 0 to fall to a tolerance [s]."""

    def speed(self, e1: ArrayLike) -> Array:
        """Speed abs(e2) on s = 0 [rad/s or m/s]."""


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class PowerSurface:
    """The paper's surface, s = γ·sig(e1)^p + e2 (paper, eq. 6).

    On s = 0 the error decays like t^(-1/(p-1)): it never settles in finite time.

    Attributes:
        gamma: γ > 0, scalar or (nv,) [rad^(1-p)/s].
        exponent: p = α1/α2, 1 < p < 2, scalar or (nv,).

    Raises:
        ParameterError: γ ≤ 0, or p outside (1, 2).
    """

    gamma: Array
    exponent: Array

    def __init__(self, gamma: ArrayLike, exponent: ArrayLike) -> None:
        set_fields(
            self,
            gamma=positive("gamma", gamma),
            exponent=_strictly_between("exponent", exponent, 1.0, 2.0),
        )

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, gamma=self.gamma, exponent=self.exponent)

    def value(self, e1: Array, e2: Array) -> Array:
        """Sliding variable (paper, eq. 6), shape (nv,) [rad/s or m/s].

        Args:
            e1: Position error q_r (-) q, shape (nv,) [rad or m].
            e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        """
        return self.gamma * sig(e1, self.exponent) + e2

    def feedforward(self, e1: Array, e2: Array) -> Array:
        """γ·p·abs(e1)^(p-1)·e2, the rate of the e1 part (paper, eqs. 7 and 8), shape (nv,) [rad/s²].

        Args:
            e1: Position error, shape (nv,).
            e2: Velocity error, shape (nv,).
        """
        p = self.exponent
        rate: Array = self.gamma * p * np.abs(e1) ** (p - 1.0) * e2
        return rate

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        """1: the paper's law is kept as printed, and this surface is flat where e1 is small.

        Args:
            e1: Position error, shape (nv,).
            dt: Control period [s].
        """
        del dt
        return np.ones_like(e1)

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Infinite, except from e1 = 0: this surface has no finite-time convergence.

        Args:
            e1: Position error when sliding begins [rad or m].
        """
        return np.where(np.asarray(e1) == 0.0, 0.0, np.inf)

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance [s].

        From the closed form e1(t) = [e1(0)^(1-p) + γ(p-1)t]^(-1/(p-1)).

        Args:
            tolerance: Error to fall to, positive [rad or m].
            e1: Position error when sliding begins [rad or m].
        """
        p = self.exponent
        start = np.maximum(np.abs(np.asarray(e1, dtype=np.float64)), tolerance)
        time: Array = (tolerance ** (1.0 - p) - start ** (1.0 - p)) / (self.gamma * (p - 1.0))
        return time

    def speed(self, e1: ArrayLike) -> Array:
        """abs(e2) on s = 0 [rad/s or m/s].

        Args:
            e1: Position error [rad or m].
        """
        e1 = np.asarray(e1, dtype=np.float64)
        return np.abs(self.value(e1, np.zeros_like(e1)))

    hold_gain = renamed_attribute("hold_gain", "zoh_gain")


@brief_repr("rate", "gamma", "exponent")
@dataclass(frozen=True, eq=False, init=False)
class FastTerminalSurface:
    """Finite-time and nonsingular: s = e2 + λ·e1 + γ·φ(e1).

    φ(e1) = sig(e1)^α outside abs(e1) ≤ ε; inside, the quadratic (2-α)ε^(α-1)·e1 + (α-1)ε^(α-2)·sign(e1)·e1², which
    meets it with equal slope. The rate of s therefore stays bounded: nothing is singular at e1 = 0.

    On s = 0 the error falls to ε within (1/(λ(1-α)))·ln(1 + (λ/γ)·abs(e1(0))^(1-α)), and exponentially from there.

    Attributes:
        rate: λ > 0, scalar or (nv,) [1/s].
        gamma: γ > 0, scalar or (nv,) [rad^(1-α)/s].
        exponent: α, ½ < α < 1, scalar or (nv,).
        smoothing: ε > 0, scalar or (nv,) [rad or m].

    The defaults bring 0.2 rad to 1 mrad in 0.32 s, at 1.5 rad/s or less. They suit periods up to about 1 ms; beyond,
    take a larger ε, as `ImpedanceController(arm, dt=...)` does.

    Raises:
        ParameterError: A gain that is not positive, or α outside (½, 1).
    """

    rate: Array
    gamma: Array
    exponent: Array
    smoothing: Array

    def __init__(
        self,
        rate: ArrayLike = 2.0,
        gamma: ArrayLike = 3.0,
        exponent: ArrayLike = 0.6,
        smoothing: ArrayLike = 1e-3,
    ) -> None:
        set_fields(
            self,
            rate=positive("rate", rate),
            gamma=positive("gamma", gamma),
            exponent=_strictly_between("exponent", exponent, 0.5, 1.0),
            smoothing=positive("smoothing", smoothing),
        )

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(
            self,
            nv,
            rate=self.rate,
            gamma=self.gamma,
            exponent=self.exponent,
            smoothing=self.smoothing,
        )

    def value(self, e1: Array, e2: Array) -> Array:
        """Sliding variable, shape (nv,) [rad/s or m/s].

        Args:
            e1: Position error q_r (-) q, shape (nv,) [rad or m].
            e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        """
        alpha, eps = self.exponent, self.smoothing
        inner = (2.0 - alpha) * eps ** (alpha - 1.0) * e1 + (alpha - 1.0) * eps ** (
            alpha - 2.0
        ) * e1 * np.abs(e1)
        phi = np.where(np.abs(e1) <= eps, inner, sig(e1, alpha))
        s: Array = e2 + self.rate * e1 + self.gamma * phi
        return s

    def feedforward(self, e1: Array, e2: Array) -> Array:
        """(λ + γ·φ'(e1))·e2, the rate of the e1 part, shape (nv,) [rad/s²].

        Args:
            e1: Position error, shape (nv,).
            e2: Velocity error, shape (nv,).
        """
        rate: Array = self._slope(e1) * e2
        return rate

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        """1 + c·dt/2 with the slope c = λ + γ·φ'(e1), shape (nv,).

        An acceleration A held for dt changes e2 by -A·dt and e1 by e2·dt - A·dt²/2, hence s by
        c·e2·dt - A·(1 + c·dt/2)·dt. With A = (feedforward + u)/(1 + c·dt/2) that is -u·dt, as the schemes assume.
        Undivided, the gain is too high by 34 % at dt = 10 ms, λ = 2, γ = 3, α = 0.6 and ε = 1e-3, which the implicit
        scheme does not tolerate.

        Args:
            e1: Position error, shape (nv,).
            dt: Control period [s].
        """
        gain: Array = 1.0 + self._slope(e1) * dt / 2.0
        return gain

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the smoothing radius ε, exact [s].

        Args:
            e1: Position error when sliding begins [rad or m].
        """
        return self._power_time(self.smoothing, np.abs(np.asarray(e1, dtype=np.float64)))

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance, exact [s].

        Args:
            tolerance: Error to fall to, positive [rad or m].
            e1: Position error when sliding begins [rad or m].
        """
        start = np.abs(np.asarray(e1, dtype=np.float64))
        outer = self._power_time(np.maximum(tolerance, self.smoothing), start)
        return outer + self._inner_time(tolerance, np.minimum(start, self.smoothing))

    def speed(self, e1: ArrayLike) -> Array:
        """abs(e2) on s = 0 [rad/s or m/s].

        Args:
            e1: Position error [rad or m].
        """
        e1 = np.asarray(e1, dtype=np.float64)
        return np.abs(self.value(e1, np.zeros_like(e1)))

    def _slope(self, e1: Array) -> Array:
        """λ + γ·φ'(e1)."""
        alpha, eps = self.exponent, self.smoothing
        size = np.abs(e1)
        inner = (2.0 - alpha) * eps ** (alpha - 1.0) + 2.0 * (alpha - 1.0) * eps ** (
            alpha - 2.0
        ) * np.minimum(size, eps)
        outer = alpha * np.maximum(size, eps) ** (alpha - 1.0)
        slope: Array = self.rate + self.gamma * np.where(size <= eps, inner, outer)
        return slope

    def _power_time(self, end: Array, start: Array) -> Array:
        """Time of ė1 = -λ·e1 - γ·sig(e1)^α from start to end; 0 if already there."""
        lam, gamma, alpha = self.rate, self.gamma, self.exponent
        start = np.maximum(start, end)
        ratio = (lam * start ** (1.0 - alpha) + gamma) / (lam * end ** (1.0 - alpha) + gamma)
        time: Array = np.log(ratio) / (lam * (1.0 - alpha))
        return time

    def _inner_time(self, end: float, start: Array) -> Array:
        """Time of ė1 = -a·e1 + b·e1² (within ε) from start to end, through its linear form in 1/e1."""
        alpha, eps = self.exponent, self.smoothing
        a = self.rate + self.gamma * (2.0 - alpha) * eps ** (alpha - 1.0)
        b = self.gamma * (1.0 - alpha) * eps ** (alpha - 2.0)
        start = np.maximum(start, end)
        time: Array = np.log((1.0 / end - b / a) / (1.0 / start - b / a)) / a
        return np.where(end < eps, time, 0.0)

    hold_gain = renamed_attribute("hold_gain", "zoh_gain")


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class NonsingularTerminalSurface:
    """The nonsingular terminal surface of Feng, Yu and Man (2002), s = e1 + sig(e2)^p/β.

    On s = 0 the error reaches zero in finite time. Off it s obeys ṡ = -(p/β)·abs(e2)^(p-1)·u: the gain of the
    reaching law depends on e2, so Theorem 1 of the paper does not bound the reaching time here.

    Attributes:
        beta: β > 0, scalar or (nv,) [(rad/s)^p/rad].
        exponent: p, 1 < p < 2, scalar or (nv,).

    Raises:
        ParameterError: β ≤ 0, or p outside (1, 2).

    References:
        Y. Feng, X. Yu, Z. Man, Non-singular terminal sliding mode control of rigid manipulators, Automatica 38, 2002.
    """

    beta: Array
    exponent: Array

    def __init__(self, beta: ArrayLike, exponent: ArrayLike) -> None:
        set_fields(
            self,
            beta=positive("beta", beta),
            exponent=_strictly_between("exponent", exponent, 1.0, 2.0),
        )

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, beta=self.beta, exponent=self.exponent)

    def value(self, e1: Array, e2: Array) -> Array:
        """Sliding variable, shape (nv,) [rad or m].

        Args:
            e1: Position error q_r (-) q, shape (nv,) [rad or m].
            e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        """
        s: Array = e1 + sig(e2, self.exponent) / self.beta
        return s

    def feedforward(self, e1: Array, e2: Array) -> Array:
        """(β/p)·sig(e2)^(2-p): with it ṡ = -(p/β)·abs(e2)^(p-1)·u, shape (nv,) [rad/s²].

        Args:
            e1: Position error, shape (nv,).
            e2: Velocity error, shape (nv,).
        """
        del e1
        return self.beta / self.exponent * sig(e2, 2.0 - self.exponent)

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        """1: here the gain of s depends on e2 and vanishes with it, and nothing may be divided by it.

        Args:
            e1: Position error, shape (nv,).
            dt: Control period [s].
        """
        del dt
        return np.ones_like(e1)

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time on s = 0 until e1 = 0, exact [s].

        Args:
            e1: Position error when sliding begins [rad or m].
        """
        return self._time(np.zeros(()), e1)

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance, exact [s].

        Args:
            tolerance: Error to fall to, not negative [rad or m].
            e1: Position error when sliding begins [rad or m].
        """
        return self._time(np.asarray(tolerance, dtype=np.float64), e1)

    def speed(self, e1: ArrayLike) -> Array:
        """abs(e2) on s = 0, (β·abs(e1))^(1/p) [rad/s or m/s].

        Args:
            e1: Position error [rad or m].
        """
        speed: Array = (self.beta * np.abs(e1)) ** (1.0 / self.exponent)
        return speed

    def _time(self, end: Array, e1: ArrayLike) -> Array:
        """Time of ė1 = -sig(β·e1)^(1/p) down to abs(e1) = end."""
        start = np.maximum(np.abs(np.asarray(e1, dtype=np.float64)), end)
        r = 1.0 - 1.0 / self.exponent
        time: Array = (start**r - end**r) / (r * self.beta ** (1.0 / self.exponent))
        return time

    hold_gain = renamed_attribute("hold_gain", "zoh_gain")


def _strictly_between(name: str, value: ArrayLike, low: float, high: float) -> Array:
    return gain(
        name, value, f"strictly between {low:g} and {high:g}", lambda x: (x > low) & (x < high)
    )
