"""Differences and steps of single joints on the manifold, and small linear systems, in compiled code."""

from __future__ import annotations

import math

from ..._common.arrays import Array
from ..._numba.compile import inline
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .law import add_angle, angle_between


@inline
def difference(arm: ArmTables, j: int, q0: Array, q1: Array) -> float:
    """Entry j of q1 (-) q0."""
    i = arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] == CONTINUOUS:
        return angle_between(q0[i], q0[i + 1], q1[i], q1[i + 1])
    step: float = q1[i] - q0[i]
    return step


@inline
def add_step(arm: ArmTables, j: int, q: Array, step: float, q_next: Array) -> None:
    """Write entry j of q (+) step; q_next may be q."""
    i = arm.topology[j, Q_INDEX]
    if arm.topology[j, KIND] == CONTINUOUS:
        q_next[i], q_next[i + 1] = add_angle(q[i], q[i + 1], step)
    else:
        q_next[i] = q[i] + step


@inline
def factorize(M: Array, L: Array) -> None:
    """Write the Cholesky factor of M."""
    for i in range(len(M)):
        for j in range(i + 1):
            entry = M[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = entry / L[j, j] if j < i else math.sqrt(entry)


@inline
def solve(L: Array, x: Array) -> None:
    """Replace x by the solution y of L·Lᵀ·y = x."""
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
