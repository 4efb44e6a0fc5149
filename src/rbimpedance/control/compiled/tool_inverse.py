"""Inverse of the Jacobian and null space in compiled code; `law.damped_inverse` specifies them.

Where no direction is damped, σ ≥ σ₀, the inverse is AᵀG⁻¹ with G = A·Aᵀ by Cholesky; whether this is so, the factor of
G - σ₀²·I shows. Otherwise one-sided Jacobi rotations find the directions: rows of Uᵀ·A that are orthogonal have the
singular values as their lengths (G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., section 8.6.3).
"""

from __future__ import annotations

import math

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ..._numba.formulas import helper
from ...law.damped_inverse import RATE_DAMPING, damped
from .tool_block import SIX
from .tool_tables import COLUMN, LENGTH, SHARES, STRENGTH, THRESHOLD, ToolScratch

_damped = helper(damped)

_SWEEPS = 40  # of rotations at most; some six are usual
_ORTHOGONAL = 1e-14  # cosine below which two rows count as orthogonal
_NOTHING = 1e-31  # square of a row, relative to that of all, that is rounding only
_NO_LENGTH = 1e-9  # length of a row, relative to the longest, that has no direction
_LEAST_OVERLAP = 0.5  # of the null space with the one of the tick before
_ROUNDS = 30  # of the iteration for the nearest orthonormal basis
_ROUNDING = 1e-15


@fused
def invert(numbers: Array, work: ToolScratch, jacobian: Array, free: Array) -> bool:
    """Write J^# of the joints that are free and the share of every direction that is lost; whether nothing is.

    Args:
        numbers: Of the tables.
        work: With `inverse`, `scaled`, and where something is lost, `directions`, `along` and `tool[SHARES]`.
        jacobian: Jᵀ, shape (nv, 6).
        free: 0 where a joint is held, 1 elsewhere, shape (nv,).
    """
    A, G = work.scaled, work.gram
    for j in range(len(jacobian)):
        for i in range(SIX):
            A[j, i] = free[j] * jacobian[j, i] * _row_scale(numbers, i)
    _put_gram(A, G)
    if not _factorize(G, -(numbers[THRESHOLD] ** 2), work.factor):
        return not _invert_by_directions(numbers, work)
    _factorize(G, 0.0, work.factor)
    for j in range(len(A)):
        row = work.inverse[j]
        for i in range(SIX):
            row[i] = A[j, i]
        _solve(work.factor, row)
        for i in range(SIX):
            row[i] *= _row_scale(numbers, i)
    return True


@fused
def _row_scale(numbers: Array, i: int) -> float:
    return 1.0 / numbers[LENGTH] if i < 3 else 1.0


@fused
def _put_gram(A: Array, G: Array) -> None:
    """Write Aᵀ·A of a matrix with six columns."""
    for i in range(SIX):
        for k in range(i + 1):
            total = 0.0
            for j in range(len(A)):
                total += A[j, i] * A[j, k]
            G[i, k] = G[k, i] = total


@fused
def _factorize(G: Array, shift: float, L: Array) -> bool:
    """Write the Cholesky factor of G + shift·I with one over its diagonal; whether that is positive definite."""
    for i in range(SIX):
        for j in range(i + 1):
            entry = G[i, j] + shift if i == j else G[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = entry * L[j, j]
            elif entry > 0.0:
                L[i, i] = 1.0 / math.sqrt(entry)
            else:
                return False
    return True


@fused
def _solve(L: Array, x: Array) -> None:
    """Replace x by the solution y of the system whose factor is L."""
    for i in range(SIX):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] *= L[i, i]
    for i in range(SIX - 1, -1, -1):
        for k in range(i + 1, SIX):
            x[i] -= L[k, i] * x[k]
        x[i] *= L[i, i]


@routine
def _invert_by_directions(numbers: Array, work: ToolScratch) -> bool:
    """Write the damped inverse; whether something is lost."""
    U, B, A, inverse = work.directions, work.along, work.scaled, work.inverse
    for i in range(SIX):
        for k in range(SIX):
            U[i, k] = 1.0 if i == k else 0.0
        for j in range(len(A)):
            B[i, j] = A[j, i]
    for _ in range(_SWEEPS):
        if not _rotate_rows(U, B):
            break
    inverse[:] = 0.0
    is_lost = False
    for i in range(SIX):
        factor, share = _damped(_dot(B[i], B[i]), numbers[THRESHOLD], numbers[STRENGTH])
        work.tool[SHARES, i] = share
        is_lost = is_lost or share != 0.0
        for j in range(len(A)):
            for k in range(SIX):
                inverse[j, k] += B[i, j] * factor * U[i, k] * _row_scale(numbers, k)
    return is_lost


@routine
def _rotate_rows(U: Array, B: Array) -> bool:
    """Turn every pair of rows until they are orthogonal, once; whether there was one to turn."""
    turned, total = False, 0.0
    for p in range(SIX):
        total += _dot(B[p], B[p])
    for p in range(SIX - 1):
        for q in range(p + 1, SIX):
            a, b, c = _dot(B[p], B[p]), _dot(B[q], B[q]), _dot(B[p], B[q])
            if abs(c) <= _ORTHOGONAL * math.sqrt(a * b) or min(a, b) <= _NOTHING * total:
                continue
            turned = True
            zeta = (b - a) / (2.0 * c)
            t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
            cos = 1.0 / math.sqrt(1.0 + t * t)
            _turn(B[p], B[q], cos, t * cos)
            _turn(U[p], U[q], cos, t * cos)
    return turned


@fused
def _dot(x: Array, y: Array) -> float:
    total = 0.0
    for j in range(len(x)):
        total += x[j] * y[j]
    return total


@fused
def _turn(x: Array, y: Array, cos: float, sin: float) -> None:
    for j in range(len(x)):
        x[j], y[j] = cos * x[j] - sin * y[j], sin * x[j] + cos * y[j]


@routine
def lost_shares(work: ToolScratch, lost: Array) -> None:
    """Write the share of each axis' motion that is lost, shape (6,), after `invert` has found that some is."""
    for k in range(SIX):
        lost[k] = 0.0
        for i in range(SIX):
            lost[k] += work.directions[i, k] ** 2 * work.tool[SHARES, i]


@routine
def fill_lost(
    numbers: Array, work: ToolScratch, b: Array, posture: Array, wanted: Array, missing: Array
) -> None:
    """Add what a posture asks for in the lost directions, and write what the tool then misses.

    With V_r the directions of the joints, V_r·shares·V_rᵀ = I - V·Vᵀ - J^#·J.

    Args:
        numbers: Of the tables.
        work: After `invert` and `continue_basis`.
        b: Acceleration that the tool wants, shape (6,).
        posture: Joint acceleration that the posture wants, shape (nv,).
        wanted: What it is added to, shape (nv,).
        missing: Where b - J·(J^#·b + the part added) goes, shape (6,).
    """
    J, V = work.jacobian, work.basis
    missing[:] = 0.0
    for i in range(SIX):
        residual = -_dot(work.along[i], posture)
        for k in range(SIX):
            residual += work.directions[i, k] * _row_scale(numbers, k) * b[k]
        for k in range(SIX):
            of_row = work.directions[i, k] / _row_scale(numbers, k)
            missing[k] += of_row * work.tool[SHARES, i] * residual
    for j in range(len(J)):
        wanted[j] += posture[j]
    for k in range(SIX):
        _add(wanted, -_dot(J[:, k], posture), work.inverse[:, k])
    for c in range(V.shape[1]):
        _add(wanted, -_dot(V[:, c], posture), V[:, c])


@fused
def _add(x: Array, k: float, y: Array) -> None:
    """Add k·y to x."""
    for j in range(len(x)):
        x[j] += k * y[j]


@fused
def continue_basis(work: ToolScratch, is_whole: bool) -> bool:
    """Turn the basis of the tick before, in `work.basis`, into the nearest orthonormal one of the null space.

    Args:
        work: After `invert`.
        is_whole: What it returned.

    Returns:
        Whether the two spaces are near enough; if not, it has to come from a decomposition of J.
    """
    V, S = work.basis, work.overlap
    n = V.shape[1]
    for c in range(n):
        if is_whole:
            _project_whole(work, c)
        else:
            _project_on_directions(work, c)
    for _ in range(
        _ROUNDS
    ):  # V·(VᵀV)^(-1/2): V ← V·(3·I - VᵀV)/2, which for one column is its length
        apart = 0.0
        for c in range(n):
            for d in range(n):
                total = 0.0
                for j in range(len(V)):
                    total += V[j, c] * V[j, d]
                S[c, d] = total
                apart = max(apart, abs(total - (1.0 if c == d else 0.0)))
        if not apart < _LEAST_OVERLAP:
            return False
        if apart <= 4.0 * _ROUNDING:
            return True
        _improve(V, S, work.basis_rate)
    return True


@fused
def _improve(V: Array, S: Array, improved: Array) -> None:
    """Replace V by V·(3·I - S)/2; the last argument is work space."""
    n = V.shape[1]
    for j in range(len(V)):
        for c in range(n):
            total = 3.0 * V[j, c]
            for d in range(n):
                total -= V[j, d] * S[d, c]
            improved[j, c] = total / 2.0
    for j in range(len(V)):
        for c in range(n):
            V[j, c] = improved[j, c]


@fused
def _project_whole(work: ToolScratch, c: int) -> None:
    """Take J^#·J·x off a column x of V."""
    V, J, image = work.basis, work.jacobian, work.tool[COLUMN]
    for i in range(SIX):
        image[i] = 0.0
        for j in range(len(V)):
            image[i] += J[j, i] * V[j, c]
    for j in range(len(V)):
        for i in range(SIX):
            V[j, c] -= work.inverse[j, i] * image[i]


@fused
def _project_on_directions(work: ToolScratch, c: int) -> None:
    """Take the parts along the joint directions of the tool off a column of V; those without a length stay."""
    V, B = work.basis, work.along
    longest = 0.0
    for i in range(SIX):
        longest = max(longest, _dot(B[i], B[i]))
    for i in range(SIX):
        square, part = _dot(B[i], B[i]), 0.0
        if square <= longest * _NO_LENGTH**2:
            continue
        for j in range(len(V)):
            part += B[i, j] * V[j, c]
        for j in range(len(V)):
            V[j, c] -= B[i, j] * part / square


@fused
def put_basis_rate(work: ToolScratch, numbers: Array) -> None:
    """Write V̇ = -J⁺·J̇·V; see `law.damped_inverse.basis_rate`.

    Args:
        work: After `invert` of all joints and `continue_basis`.
        numbers: Of the tables.
    """
    A, V, rate, column = work.scaled, work.basis, work.basis_rate, work.tool[COLUMN]
    _put_gram(A, work.gram)
    _factorize(work.gram, RATE_DAMPING, work.factor)
    for c in range(V.shape[1]):
        for i in range(SIX):
            column[i] = 0.0
            for j in range(len(V)):
                column[i] += _row_scale(numbers, i) * work.rate[j, i] * V[j, c]
        _solve(work.factor, column)
        for j in range(len(V)):
            rate[j, c] = -_dot(A[j], column)
