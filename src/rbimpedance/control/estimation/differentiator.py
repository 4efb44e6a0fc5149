"""Speed from positions alone: Levant's robust exact differentiator, in an implicit discretisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, positive, positive_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields

GAINS = 1.5, 1.1
"""Levant's gains of the root and of the sign."""


def implicit_correction(ahead: Array, k1: Array, k2: Array, h: float) -> tuple[Array, Array]:
    """Return the error after a step, and the value of the set-valued sign of it.

    Both solve e + h·k1·abs(e)^½·sgn(e) + h²·k2·sgn(e) = ahead, where sgn(0) is anything from -1 to 1.

    Args:
        ahead: Measured less extrapolated position.
        k1: Gain of the root.
        k2: Gain of the sign.
        h: Period [s].
    """
    sign = np.minimum(np.maximum(ahead / (h * h * k2), -1.0), 1.0)
    beyond = np.maximum(np.abs(ahead) - h * h * k2, 0.0)
    root = np.sqrt((0.5 * h * k1) ** 2 + beyond) - 0.5 * h * k1
    return sign * root * root, sign


class DifferentiatorState(NamedTuple):
    """What the differentiator remembers, each of shape (nv,), or None before the first measurement.

    Attributes:
        x: Position, behind it [rad or m].
        v: Speed [rad/s or m/s].
    """

    x: Array | None
    v: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class RobustDifferentiator:
    """Levant's first-order differentiator: exact without noise for any signal whose acceleration stays below a bound.

        ẋ = v + k₁·√L·abs(e)^½·sgn(e),    v̇ = k₂·L·sgn(e),    e = q - x,    k₁ = 1.5, k₂ = 1.1

    by implicit Euler: e and the value of the sign at the end of a step are the unknowns, and the step has a closed
    form. It does not chatter, whatever the gains times the period are. It knows neither model nor torque: it needs a
    bound on the acceleration, and a count c in the position leaves an error of about 2·√(L·c) in the speed.

    Attributes:
        acceleration: L, the bound, scalar or (nv,) [rad/s² or m/s²].
        dt: Period [s].

    Raises:
        ParameterError: A bound or a period that is not positive.

    References:
        A. Levant, Robust exact differentiation via sliding mode technique, Automatica 34, 1998.
        M. R. Mojallizadeh, B. Brogliato, V. Acary, Time-discretizations of differentiators: design of implicit
        algorithms and comparative analysis, International Journal of Robust and Nonlinear Control 31, 2021.
    """

    acceleration: Array
    dt: float

    def __init__(self, acceleration: ArrayLike, dt: float) -> None:
        set_fields(
            self,
            acceleration=positive("acceleration", acceleration),
            dt=positive_number("dt", dt, "period in seconds"),
        )

    def init(self, nv: int) -> DifferentiatorState:
        """Return the state before the first measurement of nv joints."""
        return DifferentiatorState(None, np.zeros(nv))

    def step(self, state: DifferentiatorState, q: Array) -> DifferentiatorState:
        """Return the state after a measurement, with the estimated speed as `v`.

        Args:
            state: From `init` or the tick before.
            q: Measured positions, shape (nv,) [rad or m].
        """
        if state.x is None:
            return state._replace(x=np.array(q))
        h, (k1, k2) = self.dt, GAINS
        L = np.broadcast_to(self.acceleration, q.shape)
        e, sign = implicit_correction(
            q - state.x - h * state.v, k1 * np.sqrt(L), k2 * np.asarray(L), h
        )
        return DifferentiatorState(q - e, state.v + h * k2 * L * sign)
