"""What the actuators can give: torque limits, and the torque that is closest to the law within them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import Array
from ._frozen import set_fields
from .exceptions import GainError

BoolArray: TypeAlias = NDArray[np.bool_]
"""One truth value per joint."""


class Allocation(NamedTuple):
    """A torque within the limits.

    Attributes:
        tau: The torque, shape (nv,) [N·m or N].
        saturated: Whether the joint is at its limit, shape (nv,), bool.
        lacking: Acceleration that was asked for less the one that tau gives, by the model's mass matrix, shape (nv,)
            [rad/s² or m/s²]. Exactly zero on every joint that is not at its limit.
    """

    tau: Array
    saturated: BoolArray
    lacking: Array


@dataclass(frozen=True, eq=False, init=False)
class Limits:
    """Limits that the controller keeps.

    A joint at its limit also accelerates the others, through the mass matrix. `allocate` therefore corrects their
    torques so that they keep the acceleration that the law asks for; only where that drives a further joint to its
    limit does this one miss its acceleration too.

    Attributes:
        effort: Largest absolute torque, scalar or (nv,), positive; +inf where there is none [N·m or N].

    Raises:
        GainError: A limit that is not a positive number.
    """

    effort: Array

    def __init__(self, effort: ArrayLike) -> None:
        set_fields(self, effort=_positive_or_infinite("effort", effort))

    def allocate(self, tau: Array, mass_matrix: Callable[[], Array]) -> Allocation:
        """Return the torque within the limits that keeps the free joints' accelerations.

        With S the joints at their limits and δ_S the torque that they lack, the accelerations lack M_SS⁻¹·δ_S on S and
        nothing elsewhere if tau lacks M[:, S]·M_SS⁻¹·δ_S (docs/schemes.md). S grows until every joint is within its
        limit, so that takes at most nv rounds, and none while nothing saturates.

        Args:
            tau: Torque that the law asks for, shape (nv,) [N·m or N].
            mass_matrix: Gives M(q), shape (nv, nv); called only where a limit is exceeded.
        """
        limit = self.effort
        lacking = np.zeros_like(tau)
        applied, at_limit = tau, np.abs(tau) > limit
        if at_limit.any():
            M, held = mass_matrix(), np.zeros_like(at_limit)
            while at_limit.any():
                pinned = np.clip(applied, -limit, limit)
                held = held | at_limit
                lacking[held] = np.linalg.solve(M[np.ix_(held, held)], (tau - pinned)[held])
                applied = np.where(held, pinned, tau - M @ lacking)
                at_limit = np.abs(applied) > limit
        return Allocation(applied, np.abs(applied) >= limit, lacking)


def as_limits(limits: Limits | ArrayLike | None) -> Limits | None:
    """Return the limits; an array-like means torque limits.

    Raises:
        GainError: A limit that is not a positive number.
    """
    return limits if limits is None or isinstance(limits, Limits) else Limits(effort=limits)


def _positive_or_infinite(name: str, value: ArrayLike) -> Array:
    words = "positive (+inf: no limit), a scalar or one number per joint"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise GainError(name, value, words) from error
    if array.ndim > 1 or not np.all(array > 0.0):
        raise GainError(name, value, words)
    array.setflags(write=False)
    return array
