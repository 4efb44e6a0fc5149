"""The super-twisting reaching law and its discretisations.

In continuous time, with ṡ = -u + w (paper, eqs. 8 and 9):

    u = k1·abs(s)^½·sgn(s) + k2·z,    ż = sgn(s)

A sampled controller has to choose how to discretise the set-valued sign. Forward Euler ("explicit") chatters at every
period; "matched" and "implicit" do not. docs/theory.md derives them, docs/schemes.md says when to choose which.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, check_gains, gain, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_attribute
from .._common.frozen import set_fields
from ..exceptions import ParameterError
from .surfaces import sig

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


@brief_repr("k1", "k2", "scheme")
@dataclass(frozen=True, eq=False, init=False)
class SuperTwisting:
    """Super-twisting with gains per joint (paper, eq. 8) in a chosen discretisation.

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

    k1: Array
    k2: Array
    scheme: Scheme
    margin: Array

    def __init__(
        self,
        k1: ArrayLike | None = None,
        k2: ArrayLike | None = None,
        scheme: Scheme = "matched",
        margin: ArrayLike = 1.0,
    ) -> None:
        if k1 is None or k2 is None:
            raise ParameterError("k1" if k1 is None else "k2", None, _GAINS_OF_AN_ARM)
        if scheme not in get_args(Scheme):
            raise ParameterError(
                "scheme", scheme, "one of " + ", ".join(map(repr, get_args(Scheme)))
            )
        margin = gain("margin", margin, "at least 1", lambda x: x >= 1.0)
        if scheme != "matched" and np.any(margin != 1.0):
            raise ParameterError(
                "margin", margin, f"1 with the {scheme!r} scheme; only 'matched' has a margin"
            )
        set_fields(self, k1=positive("k1", k1), k2=positive("k2", k2), scheme=scheme, margin=margin)

    def check(self, nv: int) -> None:
        """Check that the gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, k1=self.k1, k2=self.k2, margin=self.margin)

    def start(self, s: Array) -> ReachingState:
        """Return the state before the first tick.

        Args:
            s: Sliding variable at the first tick, shape (nv,).
        """
        return ReachingState(z=np.zeros_like(s), x=s.copy(), a=np.zeros_like(s))

    def step(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Return the reaching term u of eq. (8) and the next state.

        Args:
            s: Sliding variable, shape (nv,).
            state: Memory from the tick before.
            dt: Control period [s].

        Returns:
            u, shape (nv,) [rad/s²], and the state for the next tick.
        """
        if self.scheme == "explicit":
            return self._explicit(s, state, dt)
        if self.scheme == "matched":
            return self._matched(s, state, dt)
        return self._implicit(s, state, dt)

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
        z = np.where((following.z - state.z) * unrealised_u > 0.0, state.z, following.z)
        if self.scheme != "implicit":
            return following._replace(z=z)
        # What s will be off its prediction X⁺ because of the limit is known: it belongs into X⁺.
        x = following.x + dt * (unrealised_u - self.k2 * (following.z - z))
        return following._replace(z=z, x=x)

    def _explicit(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Forward Euler: z⁺ = z + h·sgn(s)."""
        u = self.k1 * sig(s, 0.5) + self.k2 * state.z
        return u, state._replace(z=state.z + dt * np.sign(s))

    def _matched(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Pole matching, after Koch and Reichhartinger; designed for the period margin·h."""
        k1, k2, h = self.k1, self.k2, self.margin * dt
        root = np.sqrt(np.abs(s))
        d = np.abs(s) + h * k1 * root + h**2 * k2
        u = (k1 * root + 2.0 * h * k2) * s / d + k2 * state.z
        return u, state._replace(z=state.z + dt * s / d)

    def _implicit(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Proper implicit discretisation, after Seeber and Andritsch (Automatica 173, 2025)."""
        k1, k2, h = self.k1, self.k2, dt
        b = s + state.a
        excess = np.maximum(np.abs(b) - h**2 * k2, 0.0)
        # X⁺ + h·k1·sig(X⁺)^½ + h²·k2·Sgn(X⁺) ∋ b, a quadratic in abs(X⁺)^½
        root = np.sqrt((h * k1 / 2.0) ** 2 + excess) - h * k1 / 2.0
        x_next = np.sign(b) * root**2
        k1_term = h * k1 * np.sign(b) * root
        xi = np.clip(b / (h**2 * k2), -1.0, 1.0)
        z_next = state.z + h * xi
        u = k1_term / h + k2 * z_next - (state.x - s) / h
        return u, ReachingState(z=z_next, x=x_next, a=x_next - state.x + k1_term)

    without_windup = renamed_attribute("without_windup", "anti_windup")
