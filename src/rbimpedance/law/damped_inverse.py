"""From the tool to the joints: the inverse of a Jacobian, damped where it is nearly singular, and its null space.

Linear rows are divided by a length before singular values are compared with a threshold: metres and radians then count
alike. Damping grows from 0 at σ₀, direction by direction: μ_i = μ·(1 - (σ_i/σ₀)²) (S. Chiaverini, B. Siciliano,
O. Egeland, Review of the damped least-squares inverse kinematics, IEEE T-CST 2(2), 1994).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from .._common.frozen import set_fields
from .formulas import elementwise

RATE_DAMPING = 1e-4
"""Damping of the inverse in the rate of the null space, relative to σ² = 1."""


def damped(square: float, threshold: float, strength: float) -> tuple[float, float]:
    """Give 1/(σ² + μ²), and the share of a direction's motion that its damping takes, from σ²."""
    mu = strength * max(1.0 - square / (threshold * threshold), 0.0)
    total = square + mu * mu
    if total == 0.0:
        return 0.0, 1.0
    return 1.0 / total, 1.0 - square / total


@dataclass(frozen=True)
class Damping:
    """When and how much a Jacobian's inverse is damped.

    Attributes:
        length: Length by which linear rows are divided [m].
        threshold: σ₀, singular value of the scaled Jacobian below which its direction is damped.
        strength: μ, damping at a singular value of 0.
    """

    length: float = 0.3
    threshold: float = 0.08
    strength: float = 0.08

    def scales(self) -> Array:
        """Return the factors of the six rows, shape (6,)."""
        return np.repeat([1.0 / self.length, 1.0], 3)


@dataclass(frozen=True, eq=False, init=False)
class DampedInverse:
    """Singular values of a scaled Jacobian and what follows from them.

    Attributes:
        matrix: J^#, shape (nv, 6).
        basis: Orthonormal basis of the null space, shape (nv, max(nv - 6, 0)).
        sigma: Smallest singular value of the scaled Jacobian.
        lost: Share of each row's unit motion that the damping takes, from 0 to 1, shape (6,); 1 where the joints cannot
            move the tool.
        is_whole: Whether nothing is lost.
    """

    matrix: Array
    basis: Array
    sigma: float
    lost: Array
    is_whole: bool
    _tool_directions: Array
    _joint_directions: Array
    _shares: Array
    _sizes: Array
    _scales: Array

    def __init__(self, J: Array, damping: Damping) -> None:
        scales = damping.scales()
        U, S, Vt = np.linalg.svd(scales[:, None] * J)
        rank = len(S)
        given = S**2, damping.threshold, damping.strength
        inverse, taken = elementwise(damped, 2, *given)
        shares, sizes = np.ones(6), np.zeros(6)  # directions in which nothing moves stay at 1
        shares[:rank], sizes[:rank] = taken, S
        set_fields(
            self,
            matrix=(Vt[:rank].T * (S * inverse)) @ (U[:, :rank].T * scales),
            basis=Vt[rank:].T,
            sigma=float(S[-1]),
            lost=np.asarray(U**2 @ shares),
            is_whole=not shares.any(),
            _tool_directions=U,
            _joint_directions=Vt[:rank],
            _shares=shares,
            _sizes=sizes,
            _scales=scales,
        )

    def in_lost_directions(self, a: Array) -> Array:
        """Return the part of a joint acceleration that damping leaves free to other uses, shape (nv,)."""
        directions = self._joint_directions
        part: Array = directions.T @ (self._shares[: len(directions)] * (directions @ a))
        return part

    def missing(self, b: Array, a: Array) -> Array:
        """Return b - J·(J^#·b + the part of a in lost directions), shape (6,): zero to the last bit where all is kept.

        Args:
            b: Tool acceleration that is wanted, shape (6,).
            a: Joint acceleration that is put into the lost directions, shape (nv,).
        """
        U, directions = self._tool_directions, self._joint_directions
        along = U.T @ (self._scales * b)
        along[: len(directions)] -= self._sizes[: len(directions)] * (directions @ a)
        part: Array = U @ (self._shares * along) / self._scales
        return part


def continued_basis(basis: Array, before: Array) -> Array:
    """Return the orthonormal basis of the same space that is nearest to the one of the tick before, shape (nv, n).

    A singular value decomposition gives null vectors of any sign and, where there are several, in any mixture.

    Args:
        basis: Orthonormal basis, shape (nv, n).
        before: The basis to continue, shape (nv, n).
    """
    overlap = basis.T @ before
    if len(overlap) == 0:
        return basis
    if len(overlap) == 1:
        return np.asarray(np.copysign(1.0, overlap[0, 0]) * basis)
    U, _, Vt = np.linalg.svd(overlap)  # orthogonal Procrustes problem
    nearest: Array = basis @ (U @ Vt)
    return nearest


def basis_rate(J: Array, J_rate: Array, basis: Array, damping: Damping) -> Array:
    """Return V̇ = -J⁺·J̇·V, the rate of the null space's basis, shape (nv, n).

    Args:
        J: Jacobian, shape (6, nv).
        J_rate: Its rate J̇, shape (6, nv).
        basis: V, shape (nv, n).
        damping: Whose length scales the rows.
    """
    scales = damping.scales()[:, None]
    A = scales * J
    inverse = A.T @ np.linalg.inv(A @ A.T + RATE_DAMPING * np.eye(6))
    rate: Array = -inverse @ (scales * (J_rate @ basis))
    return rate
