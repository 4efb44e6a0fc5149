"""What the actuators can give: torque and its rate, and the torque that is closest to the law within both."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, BoolArray, check_gains, positive_or_infinite
from .._common.brief import brief_repr
from .._common.frozen import Converted, Gain
from .formulas import clip, elementwise


def torque_bounds(before: float, effort: float, step: float) -> tuple[float, float]:
    """Least and largest torque of a joint: abs(tau) ≤ effort, no further than a step from the torque before."""
    return clip(before - step, -effort, effort), clip(before + step, -effort, effort)


def limits_reached(tau: float, lower: float, upper: float, effort: float) -> tuple[bool, bool]:
    """Whether a joint is at its torque limit, and whether it is at its rate limit only."""
    is_held = (tau <= lower) | (tau >= upper)
    return abs(tau) >= effort, is_held & (abs(tau) < effort)


def allocate_joints(
    tau: Array,
    lower: Array,
    upper: Array,
    M: Array,
    applied: Array,
    deficit: Array,
    held: Array,
    L: Array,
) -> None:
    """Write the torque within the limits that keeps the free joints' accelerations; see `Limits.allocate`.

    Args:
        tau: Torque that the law demands, shape (nv,).
        lower: Least torque, shape (nv,).
        upper: Largest torque, shape (nv,).
        M: M(q), shape (nv, nv).
        applied: Where the torque goes, shape (nv,).
        deficit: Where the missing acceleration goes, shape (nv,).
        held: Work space: 1 where a joint is held at its limit, else 0, shape (nv,).
        L: Work space: Cholesky factor of M over the held joints, shape (nv, nv).
    """
    for j in range(len(tau)):
        applied[j], deficit[j], held[j] = tau[j], 0.0, 0.0
    while hold_beyond(lower, upper, applied, held):
        solve_held(tau, applied, M, deficit, held, L)
        for i in range(len(tau)):
            if held[i] == 0.0:
                applied[i] = tau[i]
                for j in range(len(tau)):
                    applied[i] -= M[i, j] * deficit[j]


def hold_beyond(lower: Array, upper: Array, applied: Array, held: Array) -> bool:
    """Hold the joints that are beyond a limit there; whether there is one."""
    found = False
    for j in range(len(applied)):
        if applied[j] < lower[j] or applied[j] > upper[j]:
            applied[j], held[j], found = clip(applied[j], lower[j], upper[j]), 1.0, True
    return found


def solve_held(tau: Array, applied: Array, M: Array, deficit: Array, held: Array, L: Array) -> None:
    """Solve M_SS·deficit_S = (tau - applied)_S over the held joints S by Cholesky; elsewhere the deficit stays zero."""
    n = len(tau)
    for i in range(n):
        if held[i] != 0.0:
            deficit[i] = eliminated(i, tau[i] - applied[i], M, deficit, held, L)
    for i in range(n - 1, -1, -1):
        if held[i] != 0.0:
            for k in range(i + 1, n):
                deficit[i] -= held[k] * L[k, i] * deficit[k]
            deficit[i] /= L[i, i]


def eliminated(i: int, total: float, M: Array, y: Array, held: Array, L: Array) -> float:
    """Write row i of the factor; return entry i of the solution of L·y = right-hand side, whose entry is total."""
    for j in range(i + 1):
        if held[j] == 0.0:
            continue
        entry = M[i, j]
        for k in range(j):
            if held[k] != 0.0:
                entry -= L[i, k] * L[j, k]
        if j == i:
            L[i, i] = math.sqrt(entry)
        else:
            L[i, j] = entry / L[j, j]
            total -= L[i, j] * y[j]
    y_i: float = total / L[i, i]
    return y_i


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
@dataclass(frozen=True, eq=False)
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

    effort: Gain = Converted(positive_or_infinite, np.inf)
    rate: Gain = Converted(positive_or_infinite, np.inf)

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
        lower, upper = np.broadcast_arrays(*self._bounds(before, dt), tau)[:2]
        applied, deficit = tau, np.zeros_like(tau)
        if ((tau < lower) | (tau > upper)).any():
            M, applied, held = mass_matrix(), np.empty_like(tau), np.empty_like(tau)
            allocate_joints(tau, lower, upper, M, applied, deficit, held, np.zeros_like(M))
        reached = elementwise(limits_reached, 2, applied, lower, upper, self.effort)
        saturated, rate_limited = (flags != 0.0 for flags in reached)
        return Allocation(applied, saturated, rate_limited, deficit)

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
        step = np.inf if before is None else self.rate * dt
        lower, upper = elementwise(
            torque_bounds, 2, 0.0 if before is None else before, self.effort, step
        )
        return lower, upper


def as_limits(limits: Limits | ArrayLike | None, nv: int) -> Limits | None:
    """Return the limits of nv joints; an array-like means torque limits.

    Raises:
        ParameterError: A limit that is not a positive number.
        DimensionError: Limits for another number of joints.
    """
    if limits is None:
        return None
    known = limits if isinstance(limits, Limits) else Limits(effort=limits)
    known.check(nv)
    return known
