"""Sliding surfaces s(e1, e2): what the errors do once the reaching law has brought s to zero.

Every surface gives the variable s, the feed-forward that makes s obey the reaching law, and the time that its
sliding motion takes. The formula of each, for one joint, is a function of this module; the classes add gains and times.
Notation: sig(x)^p = sign(x)·abs(x)^p, elementwise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, gain, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_attribute
from .._common.frozen import Converted, Gain, set_fields
from .formulas import FormulaPart, any_of, elementwise, select, signed_power


def sig(x: ArrayLike, p: ArrayLike) -> Array:
    """Return sign(x)·abs(x)^p, elementwise."""
    power: Array = elementwise(signed_power, 1, x, p)
    return power


Number = TypeVar("Number", float, Array)


def demanded_acceleration(a_r: Number, feedforward: Number, u: Number, zoh_gain: Number) -> Number:
    """Acceleration a with which s obeys the reaching law; the torque is RNEA(q, v, a) - tau_ext (paper, eq. 8)."""
    return a_r + (feedforward + u) / zoh_gain


def power_formula(
    e1: float,
    e2: float,
    dt: float,  # noqa: ARG001 (every formula takes it)
    gamma: float,
    exponent: float,
) -> tuple[float, float, float]:
    """Give s = γ·sig(e1)^p + e2, and the rate γ·p·abs(e1)^(p-1)·e2 of its e1 part (paper, eqs. 6 and 7).

    The gain is 1: the paper's law is kept as printed, and this surface is flat where e1 is small.
    """
    power = abs(e1) ** (exponent - 1.0)
    return gamma * (power * e1) + e2, gamma * exponent * power * e2, 1.0


def fast_terminal_formula(
    e1: float,
    e2: float,
    dt: float,
    rate: float,
    gamma: float,
    exponent: float,
    smoothing: float,
    inner_slope: float,
    inner_curve: float,
) -> tuple[float, float, float]:
    """Give s = e2 + λ·e1 + γ·φ(e1), the rate c·e2 of its e1 part, c = λ + γ·φ'(e1), and the gain 1 + c·dt/2.

    φ(e1) = sig(e1)^α outside abs(e1) ≤ ε; inside it is inner_slope·e1 + inner_curve·sign(e1)·e1².

    An acceleration A held for dt changes e2 by -A·dt and e1 by e2·dt - A·dt²/2, hence s by c·e2·dt - A·(1 + c·dt/2)·dt.
    With A = (feedforward + u)/(1 + c·dt/2) that is -u·dt, as the schemes assume. Undivided, the gain is too high by
    34 % at dt = 10 ms, λ = 2, γ = 3, α = 0.6 and ε = 1e-3, which the implicit scheme does not tolerate.
    """
    size = abs(e1)
    phi = inner_slope * e1 + inner_curve * e1 * size
    phi_slope = inner_slope + 2.0 * inner_curve * size
    is_outside = size > smoothing
    if any_of(is_outside):
        power = max(size, smoothing) ** (exponent - 1.0)
        phi = select(is_outside, power * e1, phi)
        phi_slope = select(is_outside, exponent * power, phi_slope)
    slope = rate + gamma * phi_slope
    return e2 + rate * e1 + gamma * phi, slope * e2, 1.0 + slope * dt / 2.0


def nonsingular_terminal_formula(
    e1: float,
    e2: float,
    dt: float,  # noqa: ARG001 (every formula takes it)
    beta: float,
    exponent: float,
) -> tuple[float, float, float]:
    """Give s = e1 + sig(e2)^p/β, and (β/p)·sig(e2)^(2-p), with which ṡ = -(p/β)·abs(e2)^(p-1)·u.

    The gain is 1: that of s depends on e2 and vanishes with it, and nothing may be divided by it.
    """
    power = select(e2 == 0.0, 1.0, abs(e2)) ** (exponent - 1.0)
    return e1 + power * e2 / beta, beta / exponent * (e2 / power), 1.0


class Surface(Protocol):
    """What the controller and the certificate need of a sliding surface; arguments of the times are described here."""

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
        """Time that e1 needs on s = 0 until it has settled [s]; infinite if it never does.

        Args:
            e1: Position error when sliding begins [rad or m].
        """

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time that abs(e1) needs on s = 0 to fall to a tolerance [s].

        Args:
            tolerance: Error to fall to, positive [rad or m].
            e1: Position error when sliding begins [rad or m].
        """

    def speed(self, e1: ArrayLike) -> Array:
        """Speed abs(e2) on s = 0 [rad/s or m/s]."""


class SurfaceByTerms(ABC):
    """A surface that computes its variable, feed-forward and gain at once."""

    @abstractmethod
    def terms(self, e1: Array, e2: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return `value`, `feedforward` and `zoh_gain` at once.

        Args:
            e1: Position error, shape (nv,).
            e2: Velocity error, shape (nv,).
            dt: Control period [s].
        """

    def value(self, e1: Array, e2: Array) -> Array:
        """Sliding variable s, shape (nv,).

        Args:
            e1: Position error q_r (-) q, shape (nv,) [rad or m].
            e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        """
        return self.terms(e1, e2, 0.0)[0]

    def feedforward(self, e1: Array, e2: Array) -> Array:
        """Acceleration that cancels the surface's own drift, shape (nv,) [rad/s² or m/s²].

        Args:
            e1: Position error, shape (nv,).
            e2: Velocity error, shape (nv,).
        """
        return self.terms(e1, e2, 0.0)[1]

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        """Gain of s to an acceleration held for dt, relative to the continuous one, shape (nv,).

        Args:
            e1: Position error, shape (nv,).
            dt: Control period [s].
        """
        return self.terms(e1, np.zeros_like(e1), dt)[2]


class FormulaSurface(SurfaceByTerms, FormulaPart):
    """A surface by its formula for one joint: (e1, e2, dt, gains...) to s, feed-forward and gain.

    Every backend computes it: NumPy joint by joint, the others in compiled code. A surface of one's own derives from it
    (docs/how-to/own-law.md); it adds `sliding_time` and `time_to` where certificates or tuning are wanted.
    """

    def speed(self, e1: ArrayLike) -> Array:
        """abs(e2) on s = 0 [rad/s or m/s]; here for surfaces with s = e2 + (a function of e1).

        Args:
            e1: Position error [rad or m].
        """
        return np.abs(self.terms(e1, 0.0, 0.0)[0])

    def terms(self, e1: ArrayLike, e2: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
        """Return `value`, `feedforward` and `zoh_gain` at once; see `SurfaceByTerms`."""
        results: tuple[Array, Array, Array] = elementwise(
            self.formula, 3, e1, e2, dt, *self.gains.values()
        )
        return results


def has_formula(surface: object) -> bool:
    """Whether a surface is what its formula says: its class has no other `value`, `feedforward` or `zoh_gain`."""
    return isinstance(surface, FormulaSurface) and all(
        getattr(type(surface), name) is getattr(FormulaSurface, name)
        for name in ("value", "feedforward", "zoh_gain", "terms")
    )


def terms(surface: Surface, e1: Array, e2: Array, dt: float) -> tuple[Array, Array, Array]:
    """Return s, feed-forward and gain of any surface, of one with a formula at the cost of one of them.

    Args:
        surface: The surface.
        e1: Position error, shape (nv,).
        e2: Velocity error, shape (nv,).
        dt: Control period [s].
    """
    if isinstance(surface, FormulaSurface) and has_formula(surface):
        return surface.terms(e1, e2, dt)
    return surface.value(e1, e2), surface.feedforward(e1, e2), surface.zoh_gain(e1, dt)


def _between(low: float, high: float) -> Callable[[str, ArrayLike], Array]:
    words = f"strictly between {low:g} and {high:g}"
    return lambda name, value: gain(name, value, words, lambda x: (x > low) & (x < high))


@brief_repr()
@dataclass(frozen=True, eq=False)
class PowerSurface(FormulaSurface):
    """The paper's surface, s = γ·sig(e1)^p + e2.

    On s = 0 the error decays like t^(-1/(p-1)): it never settles in finite time.

    Attributes:
        gamma: γ > 0, scalar or (nv,) [rad^(1-p)/s].
        exponent: p = α1/α2, 1 < p < 2, scalar or (nv,).

    Raises:
        ParameterError: γ ≤ 0, or p outside (1, 2).
    """

    gamma: Gain = Converted(positive)
    exponent: Gain = Converted(_between(1.0, 2.0))
    formula = staticmethod(power_formula)

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Infinite, except from e1 = 0: this surface has no finite-time convergence."""
        return np.where(np.asarray(e1) == 0.0, 0.0, np.inf)

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance [s].

        From the closed form e1(t) = [e1(0)^(1-p) + γ(p-1)t]^(-1/(p-1)).
        """
        p = self.exponent
        start = np.maximum(np.abs(np.asarray(e1, dtype=np.float64)), tolerance)
        time: Array = (tolerance ** (1.0 - p) - start ** (1.0 - p)) / (self.gamma * (p - 1.0))
        return time


@brief_repr("rate", "gamma", "exponent")
@dataclass(frozen=True, eq=False)
class FastTerminalSurface(FormulaSurface):
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

    rate: Gain = Converted(positive, 2.0)
    gamma: Gain = Converted(positive, 3.0)
    exponent: Gain = Converted(_between(0.5, 1.0), 0.6)
    smoothing: Gain = Converted(positive, 1e-3)
    _inner_slope: Array = field(init=False)
    _inner_curve: Array = field(init=False)
    formula = staticmethod(fast_terminal_formula)

    def __post_init__(self) -> None:
        alpha, eps = self.exponent, self.smoothing
        slope, curve = (2.0 - alpha) * eps ** (alpha - 1.0), (alpha - 1.0) * eps ** (alpha - 2.0)
        set_fields(self, _inner_slope=slope, _inner_curve=curve)

    @property
    def inner_slope(self) -> Array:
        """(2-α)·ε^(α-1), the slope of φ at 0."""
        return self._inner_slope

    @property
    def inner_curve(self) -> Array:
        """(α-1)·ε^(α-2), what bends φ within ε."""
        return self._inner_curve

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the smoothing radius ε, exact [s]."""
        return self._power_time(self.smoothing, np.abs(np.asarray(e1, dtype=np.float64)))

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance, exact [s]."""
        start = np.abs(np.asarray(e1, dtype=np.float64))
        outer = self._power_time(np.maximum(tolerance, self.smoothing), start)
        return outer + self._inner_time(tolerance, np.minimum(start, self.smoothing))

    def _power_time(self, end: Array, start: Array) -> Array:
        """Time of ė1 = -λ·e1 - γ·sig(e1)^α from start to end; 0 if already there."""
        lam, gamma, alpha = self.rate, self.gamma, self.exponent
        start = np.maximum(start, end)
        ratio = (lam * start ** (1.0 - alpha) + gamma) / (lam * end ** (1.0 - alpha) + gamma)
        time: Array = np.log(ratio) / (lam * (1.0 - alpha))
        return time

    def _inner_time(self, end: float, start: Array) -> Array:
        """Time of ė1 = -a·e1 + b·e1² (within ε) from start to end, through its linear form in 1/e1."""
        a = self.rate + self.gamma * self.inner_slope
        b = -self.gamma * self.inner_curve
        start = np.maximum(start, end)
        time: Array = np.log((1.0 / end - b / a) / (1.0 / start - b / a)) / a
        return np.where(end < self.smoothing, time, 0.0)


@brief_repr()
@dataclass(frozen=True, eq=False)
class NonsingularTerminalSurface(FormulaSurface):
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

    beta: Gain = Converted(positive)
    exponent: Gain = Converted(_between(1.0, 2.0))
    formula = staticmethod(nonsingular_terminal_formula)

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time on s = 0 until e1 = 0, exact [s]."""
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
