"""Rows of a table of float64 as the tuples of `spatial`, and back."""

from __future__ import annotations

from ..._common.arrays import Array
from ..._numba.compile import fused
from .spatial import Inertia, Matrix, Motion, Symmetric, Vector


@fused
def get_vector(table: Array, j: int, k: int) -> Vector:
    """Three numbers of row j from column k."""
    return table[j, k], table[j, k + 1], table[j, k + 2]


@fused
def get_pair(table: Array, j: int, k: int) -> Motion:
    """A motion or a force of row j from column k."""
    return get_vector(table, j, k), get_vector(table, j, k + 3)


@fused
def get_symmetric(table: Array, j: int, k: int) -> Symmetric:
    """A symmetric matrix of row j from column k."""
    x, y = get_pair(table, j, k)
    return x[0], x[1], x[2], y[0], y[1], y[2]


@fused
def get_matrix(table: Array, j: int, k: int) -> Matrix:
    """A matrix of row j from column k."""
    x, y = get_pair(table, j, k)
    z = get_vector(table, j, k + 6)
    return x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]


@fused
def get_inertia(table: Array, j: int, k: int) -> Inertia:
    """An inertia of row j from column k."""
    return get_symmetric(table, j, k), get_matrix(table, j, k + 6), get_symmetric(table, j, k + 15)


@fused
def put_vector(table: Array, j: int, k: int, a: Vector) -> None:
    """Write three numbers to row j from column k."""
    table[j, k], table[j, k + 1], table[j, k + 2] = a[0], a[1], a[2]


@fused
def put_pair(table: Array, j: int, k: int, a: Motion) -> None:
    """Write a motion or a force to row j from column k."""
    put_vector(table, j, k, a[0])
    put_vector(table, j, k + 3, a[1])


@fused
def put_symmetric(table: Array, j: int, k: int, S: Symmetric) -> None:
    """Write a symmetric matrix to row j from column k."""
    put_vector(table, j, k, (S[0], S[1], S[2]))
    put_vector(table, j, k + 3, (S[3], S[4], S[5]))


@fused
def put_matrix(table: Array, j: int, k: int, R: Matrix) -> None:
    """Write a matrix to row j from column k."""
    put_vector(table, j, k, (R[0], R[1], R[2]))
    put_vector(table, j, k + 3, (R[3], R[4], R[5]))
    put_vector(table, j, k + 6, (R[6], R[7], R[8]))


@fused
def put_inertia(table: Array, j: int, k: int, I: Inertia) -> None:  # noqa: E741
    """Write an inertia to row j from column k."""
    put_symmetric(table, j, k, I[0])
    put_matrix(table, j, k + 6, I[1])
    put_symmetric(table, j, k + 15, I[2])
