"""What the actuators can give: torque and its rate, and the torque that is closest to the law within both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, BoolArray, check_gains
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..exceptions import ParameterError


class Allocation(NamedTuple):
    """A torque within the limits.

    Attributes:
        tau: The torque, shape (nv,) [N·m or N].
        saturated: Whether the joint is at its torque limit, shape (nv,), bool.
        rate_limited: Whether the joint's torque may not change faster, shape (nv,), bool.
        acceleration_deficit: Demanded acceleration minus the one that tau gives, by the model's mass matrix,
            shape (nv,) [rad/s² or m/s²]. Exactly zero on every joint that is at no limit.
    """

    tau: Array
    saturated: BoolArray
    rate_limited: BoolArray
    acceleration_deficit: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class Limits:
    """Limits that the controller keeps.

    A joint at its limit also accelerates the others, through the mass matrix. `allocate` therefore corrects their
    torques so that they keep the acceleration that the law demands; only if that drives another joint to its
    limit does this one miss its acceleration too.

    Attributes:
        effort: Largest absolute torque, scalar or (nv,), positive; +inf where there is none [N·m or N].
        rate: Largest absolute change of the torque in a second, scalar or (nv,), positive; +inf where there is none
            [N·m/s or N/s]. The first tick is free of it: what the motors gave before is not known.

    Raises:
        ParameterError: A limit that is not a positive number.
    """

    effort: Array
    rate: Array

    def __init__(self, effort: ArrayLike = np.inf, rate: ArrayLike = np.inf) -> None:
        set_fields(
            self,
            effort=_positive_or_infinite("effort", effort),
            rate=_positive_or_infinite("rate", rate),
        )

    def check(self, nv: int) -> None:
        """Check that the limits are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, effort=self.effort, rate=self.rate)

    def allocate(
        self,
        tau: Array,
        mass_matrix: Callable[[], Array],
        *,
        before: Array | None = None,
        dt: float = np.inf,
    ) -> Allocation:
        """Return the torque within the limits that keeps the free joints' accelerations.

        With S the joints at their limits and δ_S the torque that they lack, the accelerations lack M_SS⁻¹·δ_S on S and
        nothing elsewhere if tau lacks M[:, S]·M_SS⁻¹·δ_S (docs/schemes.md). S grows until every joint is within its
        limit, so that takes at most nv rounds, and none while nothing saturates.

        Args:
            tau: Torque that the law demands, shape (nv,) [N·m or N].
            mass_matrix: Gives M(q), shape (nv, nv); called only where a limit is exceeded.
            before: Torque of the tick before, shape (nv,) [N·m or N]; None at the first tick.
            dt: Time since then [s].
        """
        lower, upper = self._bounds(before, dt)
        acceleration_deficit = np.zeros_like(tau)
        applied, at_limit = tau, (tau < lower) | (tau > upper)
        if at_limit.any():
            M, held = mass_matrix(), np.zeros_like(at_limit)
            while at_limit.any():
                pinned = np.clip(applied, lower, upper)
                held = held | at_limit
                acceleration_deficit[held] = np.linalg.solve(
                    M[np.ix_(held, held)], (tau - pinned)[held]
                )
                applied = np.where(held, pinned, tau - M @ acceleration_deficit)
                at_limit = (applied < lower) | (applied > upper)
        saturated = np.abs(applied) >= self.effort
        is_bound = (applied <= lower) | (applied >= upper)
        return Allocation(applied, saturated, is_bound & ~saturated, acceleration_deficit)

    def nearest(self, tau: Array, before: Array | None, dt: float) -> Array:
        """Return the torque within the limits that is nearest on every joint, shape (nv,).

        Args:
            tau: Wanted torque, shape (nv,) [N·m or N].
            before: Torque of the tick before, shape (nv,); None at the first tick.
            dt: Time since then [s].
        """
        within: Array = np.clip(tau, *self._bounds(before, dt))
        return within

    def _bounds(self, before: Array | None, dt: float) -> tuple[Array, Array]:
        """Least and largest torque of this tick."""
        if before is None:
            return -self.effort, self.effort
        change = self.rate * dt
        lower = np.clip(before - change, -self.effort, self.effort)
        upper = np.clip(before + change, -self.effort, self.effort)
        return lower, upper


def as_limits(limits: Limits | ArrayLike | None) -> Limits | None:
    """Return the limits; an array-like means torque limits.

    Raises:
        ParameterError: A limit that is not a positive number.
    """
    return limits if limits is None or isinstance(limits, Limits) else Limits(effort=limits)


def _positive_or_infinite(name: str, value: ArrayLike) -> Array:
    words = "positive (+inf: no limit), a scalar or one number per joint"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError(name, value, words) from error
    if array.ndim > 1 or not np.all(array > 0.0):
        raise ParameterError(name, value, words)
    array.setflags(write=False)
    return array
