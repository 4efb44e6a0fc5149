"""The inverse from tool to joints: exact where regular, bounded and open about its losses where not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import null_space
from scipy.stats import ortho_group

from rbimpedance.law.damped_inverse import DampedInverse, Damping, basis_rate, continued_basis
from rbimpedance.law.joint_bounds import APPROACH_RATE, SPEED_SHARE, JointBounds

DAMPING = Damping()


def jacobian(
    rng: np.random.Generator, sizes: list[float], nv: int = 7
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """A Jacobian whose scaled form has given singular values."""
    U, V = ortho_group.rvs(6, random_state=rng), ortho_group.rvs(nv, random_state=rng)
    rank = min(6, nv)
    return (U[:, :rank] * sizes[:rank]) @ V[:rank] / DAMPING.scales()[:, None]


@pytest.mark.parametrize("nv", [6, 7, 9])
def test_inverse_is_exact_and_nothing_is_lost_above_the_threshold(
    nv: int, rng: np.random.Generator
) -> None:
    J = jacobian(rng, [3.0, 2.0, 1.0, 0.5, 0.3, 0.1], nv)
    inverse = DampedInverse(J, DAMPING)
    assert inverse.is_whole
    assert not inverse.lost.any()
    assert_allclose(J @ inverse.matrix, np.eye(6), atol=1e-12)
    assert_allclose(inverse.sigma, 0.1, rtol=1e-12)
    assert_allclose(J @ inverse.basis, 0.0, atol=1e-12)
    b = rng.normal(size=6)
    assert (inverse.missing(b, rng.normal(size=nv)) == 0.0).all()


@pytest.mark.parametrize("sigma", [0.05, 1e-3, 0.0])
def test_inverse_stays_bounded_and_says_what_is_lost(
    sigma: float, rng: np.random.Generator
) -> None:
    J = jacobian(rng, [3.0, 2.0, 1.0, 0.5, 0.3, sigma])
    inverse = DampedInverse(J, DAMPING)
    largest = np.linalg.svd(inverse.matrix / DAMPING.scales(), compute_uv=False)[0]
    assert largest < 1.0 / (2.0 * DAMPING.strength * (1.0 - (0.05 / 0.08) ** 2)) + 1.0 / 0.3
    share = 1.0 - np.trace(J @ inverse.matrix) + 5.0
    assert_allclose(inverse.lost.sum(), share, atol=1e-9)
    assert not inverse.is_whole
    b, posture = rng.normal(size=(6,)), rng.normal(size=7)
    moved = J @ (inverse.matrix @ b + inverse.in_lost_directions(posture))
    assert_allclose(inverse.missing(b, posture), b - moved, atol=1e-12)


def test_axes_that_an_arm_does_not_have_are_lost_and_the_others_exact() -> None:
    J = np.vstack([np.eye(3), np.zeros((3, 3))])
    inverse = DampedInverse(J, DAMPING)
    assert inverse.lost.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    assert_allclose(inverse.matrix, J.T, atol=1e-15)
    assert_allclose(inverse.missing(np.arange(1.0, 7.0), np.zeros(3)), [0, 0, 0, 4, 5, 6])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_continued_basis_spans_the_same_space_and_does_not_jump(
    n: int, rng: np.random.Generator
) -> None:
    basis = np.linalg.qr(rng.normal(size=(6 + n, n)))[0]
    mixed = basis @ ortho_group.rvs(n, random_state=rng) if n > 1 else -basis
    continued = continued_basis(mixed, basis)
    assert_allclose(continued, basis, atol=1e-12)


def test_basis_rate_is_that_of_the_moving_null_space(rng: np.random.Generator) -> None:
    J, J_rate = rng.normal(size=(6, 7)), rng.normal(size=(6, 7))
    h, V = 1e-6, null_space(J)
    before, after = (continued_basis(null_space(J + step * J_rate), V) for step in (-h, h))
    damped = basis_rate(J, J_rate, V, DAMPING)
    assert_allclose(damped, (after - before) / (2.0 * h), rtol=2e-2, atol=1e-3)


BOUNDS = JointBounds(np.full(7, -1.0), np.full(7, 1.0), np.full(7, 2.0), 1e-3)


def test_accelerations_within_their_bounds_are_not_touched(rng: np.random.Generator) -> None:
    a, J = rng.normal(size=7), jacobian(rng, [3.0, 2.0, 1.0, 0.5, 0.3, 0.2])
    kept = BOUNDS.keep(a, np.zeros(7), np.zeros(7), J, DAMPING)
    assert kept.a is a
    assert not kept.held.any()


def test_a_redundant_arm_keeps_the_tool_where_one_joint_is_held(rng: np.random.Generator) -> None:
    J = jacobian(rng, [3.0, 2.0, 1.5, 1.0, 0.8, 0.6])
    a, v = rng.normal(size=7), np.zeros(7)
    v[2], a[2] = SPEED_SHARE * 2.0, 5.0  # as fast as it may be, and asked for more
    kept = BOUNDS.keep(a, np.zeros(7), v, J, DAMPING)
    assert kept.held.tolist() == [False, False, True, False, False, False, False]
    assert kept.a[2] == 0.0
    assert_allclose(J @ kept.a, J @ a, atol=1e-9)


def test_a_joint_that_is_driven_at_its_bounds_passes_neither_limit() -> None:
    x, v, J = np.zeros(7), np.zeros(7), np.vstack([np.eye(7)[:6]])
    fastest = 0.0
    for _ in range(4000):
        a = BOUNDS.keep(np.full(7, 1e3), x, v, J, DAMPING).a
        v = v + 1e-3 * a
        x = x + 1e-3 * v
        fastest = max(fastest, float(v.max()))
    assert fastest <= 2.0
    assert x.max() <= 1.0
    assert_allclose(x, 1.0, atol=1e-6)
    assert APPROACH_RATE * 1.0 > 2.0  # both bounds have acted
