"""Vectors of space and their matrices as tuples of numbers: the same functions serve plain Python and compiled code.

Vectors are (x, y, z), matrices nine numbers row by row.
"""

from __future__ import annotations

from typing import TypeAlias

from .._common.arrays import Array

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(k: float, a: Vector) -> Vector:
    """Return k·a."""
    return k * a[0], k * a[1], k * a[2]


def dot(a: Vector, b: Vector) -> float:
    """Return a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def rotate(R: Matrix, a: Vector) -> Vector:
    """Return R·a."""
    return (
        R[0] * a[0] + R[1] * a[1] + R[2] * a[2],
        R[3] * a[0] + R[4] * a[1] + R[5] * a[2],
        R[6] * a[0] + R[7] * a[1] + R[8] * a[2],
    )


def unrotate(R: Matrix, a: Vector) -> Vector:
    """Return Rᵀ·a."""
    return (
        R[0] * a[0] + R[3] * a[1] + R[6] * a[2],
        R[1] * a[0] + R[4] * a[1] + R[7] * a[2],
        R[2] * a[0] + R[5] * a[1] + R[8] * a[2],
    )


def transposed(A: Matrix) -> Matrix:
    """Return Aᵀ."""
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


def product(A: Matrix, B: Matrix) -> Matrix:
    """Return A·B."""
    a, b, c, d, e, f, g, h, i = B
    return (
        A[0] * a + A[1] * d + A[2] * g, A[0] * b + A[1] * e + A[2] * h, A[0] * c + A[1] * f + A[2] * i,
        A[3] * a + A[4] * d + A[5] * g, A[3] * b + A[4] * e + A[5] * h, A[3] * c + A[4] * f + A[5] * i,
        A[6] * a + A[7] * d + A[8] * g, A[6] * b + A[7] * e + A[8] * h, A[6] * c + A[7] * f + A[8] * i,
    )  # fmt: skip


def vector_of(array: Array) -> Vector:
    """Return an array of shape (3,) as a vector."""
    x, y, z = array.tolist()
    return x, y, z


def matrix_of(array: Array) -> Matrix:
    """Return an array of shape (3, 3) as a matrix."""
    (a, b, c), (d, e, f), (g, h, i) = array.tolist()
    return a, b, c, d, e, f, g, h, i
