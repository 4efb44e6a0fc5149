"""Spatial algebra on tuples of numbers: what the compiler turns into straight code without a trace of a call.

Vectors are (x, y, z), rotations nine numbers row by row, symmetric matrices (xx, xy, xz, yy, yz, zz). A spatial motion
is (angular, linear), a spatial force (moment, force), as in R. Featherstone, Rigid Body Dynamics Algorithms, 2008,
whose sections and tables the docstrings name. The compiled routines keep them in rows of tables.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ..._numba.lanes import any_of, select
from ...law import vectors

Vector: TypeAlias = vectors.Vector
Matrix: TypeAlias = vectors.Matrix
Symmetric: TypeAlias = tuple[float, float, float, float, float, float]
SpatialMotion: TypeAlias = tuple[Vector, Vector]
Force: TypeAlias = tuple[Vector, Vector]
Inertia: TypeAlias = tuple[Symmetric, Matrix, Symmetric]
"""[[I, H], [Hᵀ, M]]: rotational part, coupling, mass part."""

# --- vectors and matrices -------------------------------------------------------------------------------------------

add = fused(vectors.add)
scale = fused(vectors.scale)
dot = fused(vectors.dot)
cross = fused(vectors.cross)
rotate = fused(vectors.rotate)
unrotate = fused(vectors.unrotate)
product = fused(vectors.product)
transposed = fused(vectors.transposed)
subtract = fused(vectors.subtract)


@fused
def add_z(a: Vector, k: float) -> Vector:
    """A + k·z."""
    return a[0], a[1], a[2] + k


@fused
def add_cross_z(a: Vector, b: Vector, k: float) -> Vector:
    """A + b × k·z."""
    return a[0] + b[1] * k, a[1] - b[0] * k, a[2]


@fused
def transform(S: Symmetric, a: Vector) -> Vector:
    """S·a, S symmetric."""
    return (
        S[0] * a[0] + S[1] * a[1] + S[2] * a[2],
        S[1] * a[0] + S[3] * a[1] + S[4] * a[2],
        S[2] * a[0] + S[4] * a[1] + S[5] * a[2],
    )


@fused
def turn_about_z(R: Matrix, cos: float, sin: float) -> Matrix:
    """R·R_z: the first two columns turn."""
    return (
        R[0] * cos + R[1] * sin,
        R[1] * cos - R[0] * sin,
        R[2],
        R[3] * cos + R[4] * sin,
        R[4] * cos - R[3] * sin,
        R[5],
        R[6] * cos + R[7] * sin,
        R[7] * cos - R[6] * sin,
        R[8],
    )


@fused
def z_axis(R: Matrix) -> Vector:
    """R·z."""
    return R[2], R[5], R[8]


@fused
def congruence(R: Matrix, S: Symmetric) -> Symmetric:
    """R·S·Rᵀ, S symmetric."""
    x, y, z = (R[0], R[1], R[2]), (R[3], R[4], R[5]), (R[6], R[7], R[8])
    Sx, Sy, Sz = transform(S, x), transform(S, y), transform(S, z)
    return dot(x, Sx), dot(x, Sy), dot(x, Sz), dot(y, Sy), dot(y, Sz), dot(z, Sz)


@fused
def cross_columns(a: Vector, A: Matrix) -> Matrix:
    """[a]×·A."""
    x, y, z = (
        cross(a, (A[0], A[3], A[6])),
        cross(a, (A[1], A[4], A[7])),
        cross(a, (A[2], A[5], A[8])),
    )
    return x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]


# --- motions, forces, inertias --------------------------------------------------------------------------------------


@fused
def add_pair(a: SpatialMotion, b: SpatialMotion) -> SpatialMotion:
    """A + b for motions or forces."""
    return add(a[0], b[0]), add(a[1], b[1])


@fused
def scale_pair(k: float, a: SpatialMotion) -> SpatialMotion:
    """K·a for a motion or a force."""
    return scale(k, a[0]), scale(k, a[1])


@fused
def power(m: SpatialMotion, f: Force) -> float:
    """M·f, the scalar product of a motion and a force (Featherstone, §2.2)."""
    return dot(m[0], f[0]) + dot(m[1], f[1])


@fused
def cross_force(v: SpatialMotion, f: Force) -> Force:
    """V ×* f (Featherstone, §2.9)."""
    return add(cross(v[0], f[0]), cross(v[1], f[1])), cross(v[0], f[1])


@fused
def shift_motion(m: SpatialMotion, r: Vector) -> SpatialMotion:
    """A motion at the point r away, axes as they are (Featherstone, §2.8)."""
    return m[0], add(m[1], cross(m[0], r))


@fused
def shift_force(f: Force, r: Vector) -> Force:
    """A force that acts at r, at the origin, axes as they are (Featherstone, §2.8)."""
    return add(f[0], cross(r, f[1])), f[1]


@fused
def shift_inertia(I: Inertia, r: Vector) -> Inertia:  # noqa: E741 (the letter of the literature)
    """An inertia at r, at the origin, axes as they are: [I + r̃·Hᵀ - H'·r̃, H' = H + r̃·M, M] (Featherstone, §2.13)."""
    rotational, H, M = I
    moved = add_matrix(H, cross_columns(r, full(M)))
    A, B = cross_columns(r, transposed(H)), cross_columns(r, transposed(moved))
    return add_symmetric(rotational, upper(add_matrix(A, transposed(B)))), moved, M


@fused
def rigid_inertia(mass: float, h: Vector, rotational: Symmetric) -> Inertia:
    """Spatial inertia of a body with first moment h (Featherstone, §2.13)."""
    x, y, z = h
    return rotational, (0.0, -z, y, z, 0.0, -x, -y, x, 0.0), (mass, 0.0, 0.0, mass, 0.0, mass)


@fused
def rigid_momentum(I: Inertia, v: SpatialMotion) -> Force:  # noqa: E741 (the letter of the literature)
    """I·v of a single body, spared the zeros of its inertia."""
    rotational, H, M = I
    h = (H[7], H[2], H[3])
    return (
        add(transform(rotational, v[0]), cross(h, v[1])),
        add(scale(M[0], v[1]), cross(v[0], h)),
    )


@fused
def apply(I: Inertia, m: SpatialMotion) -> Force:  # noqa: E741
    """I·m."""
    rotational, H, M = I
    return (
        add(transform(rotational, m[0]), rotate(H, m[1])),
        add(unrotate(H, m[0]), transform(M, m[1])),
    )


@fused
def add_inertia(A: Inertia, B: Inertia) -> Inertia:
    """A + B."""
    return add_symmetric(A[0], B[0]), add_matrix(A[1], B[1]), add_symmetric(A[2], B[2])


@fused
def without_direction(I: Inertia, U: Force, k: float) -> Inertia:  # noqa: E741
    """I - k·U·Uᵀ: articulated inertia seen through a joint (Featherstone, Table 7.1)."""
    n, f = U
    kn, kf = scale(-k, n), scale(-k, f)
    return (
        add_symmetric(I[0], upper(outer(kn, n))),
        add_matrix(I[1], outer(kn, f)),
        add_symmetric(I[2], upper(outer(kf, f))),
    )


@fused
def outer(a: Vector, b: Vector) -> Matrix:
    """A·bᵀ."""
    x, y, z = scale(a[0], b), scale(a[1], b), scale(a[2], b)
    return x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]


@fused
def full(S: Symmetric) -> Matrix:
    """A symmetric matrix with all its entries."""
    return S[0], S[1], S[2], S[1], S[3], S[4], S[2], S[4], S[5]


@fused
def upper(A: Matrix) -> Symmetric:
    """The symmetric matrix with the upper triangle of A."""
    return A[0], A[1], A[2], A[4], A[5], A[8]


@fused
def add_symmetric(A: Symmetric, B: Symmetric) -> Symmetric:
    """A + B."""
    return A[0] + B[0], A[1] + B[1], A[2] + B[2], A[3] + B[3], A[4] + B[4], A[5] + B[5]


@fused
def add_matrix(A: Matrix, B: Matrix) -> Matrix:
    """A + B."""
    return (
        A[0] + B[0], A[1] + B[1], A[2] + B[2],
        A[3] + B[3], A[4] + B[4], A[5] + B[5],
        A[6] + B[6], A[7] + B[7], A[8] + B[8],
    )  # fmt: skip


# --- rows of a table of float64 as such tuples, and back ------------------------------------------------------------


@fused
def get_vector(table: Array, j: int, k: int) -> Vector:
    """Three numbers of row j from column k."""
    return table[j, k], table[j, k + 1], table[j, k + 2]


@fused
def get_pair(table: Array, j: int, k: int) -> SpatialMotion:
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
def put_pair(table: Array, j: int, k: int, a: SpatialMotion) -> None:
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


# --- cosine and sine of many angles at once ---------------------------------------------------------------------------
#
# A loop without branches, which the compiler turns into vector instructions: eight angles take 8 ns where the C library
# takes 9 ns for one, 7 % of a compiled tick. The reduction is that of Cody and Waite in three parts of π/2, the
# polynomials are those of fdlibm; the error is below 2 units of 2⁻⁵³ for angles up to `LARGEST_ANGLE`, beyond which the
# C library takes over.

LARGEST_ANGLE = 1e5

_TWO_OVER_PI = 0.6366197723675814
_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)


@routine
def cosines_and_sines(angles: Array, cosines: Array, sines: Array) -> None:
    """Write the cosine and sine of every angle.

    The three must be arrays of their own: the compiler cannot prove that two rows of one array do not overlap.

    Args:
        angles: Angles [rad]; as many as a multiple of `VECTOR`, or the rest is done one by one.
        cosines: Where the cosines go, as long.
        sines: Where the sines go, as long.
    """
    largest = 0.0
    for i in range(len(angles)):
        largest = max(largest, abs(angles[i]))
    if any_of(largest > LARGEST_ANGLE):
        for i in range(len(angles)):
            cosines[i], sines[i] = math.cos(angles[i]), math.sin(angles[i])
    else:
        for i in range(len(angles)):
            cosines[i], sines[i] = _cosine_and_sine(angles[i])


@fused
def _cosine_and_sine(x: float) -> tuple[float, float]:
    quarters = math.floor(x * _TWO_OVER_PI + 0.5)
    r = ((x - quarters * _HALF_PI[0]) - quarters * _HALF_PI[1]) - quarters * _HALF_PI[2]
    cos, sin = _cosine(r * r), _sine(r, r * r)
    is_turned, is_opposite = _is_odd(quarters), _is_odd(math.floor(0.5 * quarters))
    cos, sin = select(is_turned, -sin, cos), select(is_turned, cos, sin)
    return select(is_opposite, -cos, cos), select(is_opposite, -sin, sin)


@fused
def _is_odd(whole: float) -> bool:
    return 0.5 * whole != math.floor(0.5 * whole)


@fused
def _sine(r: float, z: float) -> float:
    """Sine on [-π/4, π/4], z = r²."""
    p = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    p = -1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * p)
    p = -1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * p)
    return r + r * z * p


@fused
def _cosine(z: float) -> float:
    """Cosine on [-π/4, π/4], z = r²."""
    p = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
    p = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * p)
    p = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * p)
    return 1.0 - 0.5 * z + z * z * p
