"""The super-twisting reaching law and its discretisations.

In continuous time, with ṡ = -u + w (paper, eq. 9):

    u = k1·abs(s)^½·sgn(s) + k2·z,    ż = sgn(s)

A sampled controller has to choose how to discretise the set-valued sign. Forward Euler ("explicit") chatters at every
period; "matched" and "implicit" do not. docs/theory.md derives them, docs/schemes.md says when to choose which.
Each is a function of this module, the formula of one joint: (s, z, x, a, dt, gains) to u and the next z, x, a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, choice, gain, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_attribute
from .._common.frozen import Converted, Gain, set_fields
from ..exceptions import ParameterError
from .formulas import FormulaPart, clip, elementwise, sign

Scheme: TypeAlias = Literal["explicit", "matched", "implicit"]
"""How the reaching law is discretised."""


_GAINS_OF_AN_ARM = (
    "a positive number: gains belong to an arm. ImpedanceController(arm) computes them, and "
    "propose_gains(arm, uncertainty, trajectory, dt) finds them for what is not known of it"
)


class ReachingState(NamedTuple):
    """Memory of the reaching law.

    Attributes:
        z: Integral of sgn(s), shape (nv,) [s].
        x: Modified sliding variable of the implicit scheme, shape (nv,); the others carry it along.
        a: Its correction, shape (nv,).
    """

    z: Array
    x: Array
    a: Array


Step: TypeAlias = tuple[float, float, float, float]
"""u, and the next z, x and a."""


def explicit(s: float, z: float, x: float, a: float, dt: float, k1: float, k2: float) -> Step:
    """Forward Euler: z⁺ = z + h·sgn(s)."""
    u = k1 * math.copysign(math.sqrt(abs(s)), s) + k2 * z
    return u, z + dt * sign(s), x, a


def matched(
    s: float, z: float, x: float, a: float, dt: float, k1: float, k2: float, margin: float
) -> Step:
    """Pole matching, after Koch and Reichhartinger; designed for the period margin·h."""
    h, root = margin * dt, math.sqrt(abs(s))
    d = abs(s) + h * k1 * root + h * h * k2
    u = (k1 * root + 2.0 * h * k2) * s / d + k2 * z
    return u, z + dt * s / d, x, a


def implicit(s: float, z: float, x: float, a: float, dt: float, k1: float, k2: float) -> Step:
    """Proper implicit discretisation, after Seeber and Andritsch (Automatica 173, 2025).

    X⁺ + h·k1·sig(X⁺)^½ + h²·k2·Sgn(X⁺) ∋ b is a quadratic in abs(X⁺)^½.
    """
    h, b = dt, s + a
    excess = max(abs(b) - h * h * k2, 0.0)
    half = h * k1 / 2.0
    root = math.sqrt(half * half + excess) - half
    x_next = sign(b) * (root * root)
    k1_term = h * k1 * sign(b) * root
    z_next = z + h * clip(b / (h * h * k2), -1.0, 1.0)
    u = k1_term / h + k2 * z_next - (x - s) / h
    return u, z_next, x_next, x_next - x + k1_term


_FORMULAS = {"explicit": explicit, "matched": matched, "implicit": implicit}


def rested(z: float, z_next: float, unrealised_u: float) -> float:
    """The next z where a torque limit withholds part of u: z rests where its step would add to that part."""
    return z if (z_next - z) * unrealised_u > 0.0 else z_next


def corrected_x(
    x_next: float, z_next: float, z_rested: float, unrealised_u: float, dt: float, k2: float
) -> float:
    """X⁺ of the implicit scheme there: what s will be off it because of the limit is known, and belongs into it."""
    return x_next + dt * (unrealised_u - k2 * (z_next - z_rested))


class FormulaReaching(FormulaPart):
    """A reaching law by its formula for one joint: (s, z, x, a, dt, gains...) to u and the next z, x and a.

    Every backend computes it: NumPy joint by joint, the others in compiled code. A reaching law of one's own derives
    from it (docs/how-to/own-law.md).
    """

    def start(self, s: Array) -> ReachingState:
        """Return the state before the first tick.

        Args:
            s: Sliding variable at the first tick, shape (nv,).
        """
        return ReachingState(z=np.zeros_like(s), x=s.copy(), a=np.zeros_like(s))

    def step(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Return the reaching term u and the next state.

        Args:
            s: Sliding variable, shape (nv,).
            state: Memory from the tick before.
            dt: Control period [s].

        Returns:
            u, shape (nv,) [rad/s²], and the state for the next tick.
        """
        u, *following = elementwise(self.formula, 4, s, *state, dt, *self.gains.values())
        return u, ReachingState(*following)

    def anti_windup(
        self, state: ReachingState, following: ReachingState, unrealised_u: Array, dt: float
    ) -> ReachingState:
        """Return the next state where a torque limit withholds part of u.

        z rests where its step would add to `unrealised_u`. With the matched scheme k2·z therefore never passes the
        reaching term that the torque realises; docs/schemes.md has the proof and the alternatives that were measured.

        Args:
            state: Memory before the tick.
            following: The next state that `step` returned.
            unrealised_u: u less the reaching term that the torque realises, shape (nv,); zero where nothing saturates.
            dt: Control period [s].
        """
        del dt
        return following._replace(z=elementwise(rested, 1, state.z, following.z, unrealised_u))


def _gain(name: str, value: ArrayLike | None) -> Array:
    if value is None:
        raise ParameterError(name, None, _GAINS_OF_AN_ARM)
    return positive(name, value)


def _margin(name: str, value: ArrayLike) -> Array:
    return gain(name, value, "at least 1", lambda x: x >= 1.0)


@brief_repr("k1", "k2", "scheme")
@dataclass(frozen=True, eq=False)
class SuperTwisting(FormulaReaching):
    """Super-twisting with gains per joint, the paper's reaching law, in a chosen discretisation.

    Attributes:
        k1: Gain of the root, scalar or (nv,) [rad^½/s^(3/2)].
        k2: Gain of the integral, scalar or (nv,) [rad/s³]; it has to exceed the disturbance's rate.
        scheme: "explicit", "matched" or "implicit".
        margin: At least 1. The matched scheme is designed for margin·dt, so it tolerates an input gain too high by
            about that factor, at a cost in precision.

    Raises:
        ParameterError: k1 or k2 missing,
            k1 ≤ 0, k2 ≤ 0, margin < 1, margin ≠ 1 with another scheme than "matched", or an unknown scheme.
    """

    k1: Converted[ArrayLike | None, Array] = Converted(_gain, None)
    k2: Converted[ArrayLike | None, Array] = Converted(_gain, None)
    scheme: Scheme = "matched"
    margin: Gain = Converted(_margin, 1.0)

    def __post_init__(self) -> None:
        choice("scheme", self.scheme, get_args(Scheme))
        if self.scheme != "matched" and np.any(self.margin != 1.0):
            words = f"1 with the {self.scheme!r} scheme; only 'matched' has a margin"
            raise ParameterError("margin", self.margin, words)
        set_fields(self, formula=_FORMULAS[self.scheme])

    def anti_windup(
        self, state: ReachingState, following: ReachingState, unrealised_u: Array, dt: float
    ) -> ReachingState:
        """See `FormulaReaching.anti_windup`; the implicit scheme corrects x, too."""
        rest = super().anti_windup(state, following, unrealised_u, dt)
        if self.scheme != "implicit":
            return rest
        given = following.x, following.z, rest.z, unrealised_u, dt, self.k2
        return rest._replace(x=elementwise(corrected_x, 1, *given))

    without_windup = renamed_attribute("without_windup", "anti_windup")
