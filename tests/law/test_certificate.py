from __future__ import annotations

import re
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from rbimpedance.exceptions import DimensionError, NonFiniteError, ParameterError
from rbimpedance.law.certificate import Certificate, certify
from rbimpedance.law.surfaces import (
    FastTerminalSurface,
    NonsingularTerminalSurface,
    PowerSurface,
    Surface,
)

from ..oracles import reaching
from ..oracles.reaching import Array, Laws

B, C = np.array([0.0, 1.0]), np.array([1.0, 0.0])


def _certify(laws: Laws, surface: Surface | None = None, e0: Array | None = None) -> Certificate:
    k1, k2, d_max, s0, disturbance0 = laws
    return certify(k1, k2, d_max, s0=s0, disturbance0=disturbance0, surface=surface, e0=e0)


def _x0(laws: Laws) -> Array:
    return np.column_stack([np.sign(laws.s0) * np.sqrt(np.abs(laws.s0)), -laws.disturbance0])


def _matrix(k1: Array, k2: Array) -> Array:
    zero, half = np.zeros_like(k1), np.full_like(k1, 0.5)
    return np.moveaxis(np.array([[-k1 / 2.0, half], [-k2, zero]]), -1, 0)


def _inequality(laws: Laws, certificate: Certificate) -> Array:
    """The left-hand side of the matrix inequality (13) as printed, shape (count, 3, 3)."""
    P, A = certificate.P, _matrix(laws.k1, laws.k2)
    corner = A.swapaxes(1, 2) @ P + P @ A
    corner = corner + laws.d_max[:, None, None] ** 2 * np.outer(C, C)
    corner = corner + certificate.epsilon[:, None, None] * P
    matrix = np.zeros((laws.k1.size, 3, 3))
    matrix[:, :2, :2] = corner
    matrix[:, :2, 2] = matrix[:, 2, :2] = P @ B
    matrix[:, 2, 2] = -1.0
    return matrix


def _riccati_limit(k1: Array, k2: Array) -> Array:
    """Largest d for which the Riccati equation of (13) at ε = 0 has a stabilising solution.

    It has one as long as the Hamiltonian matrix has no eigenvalue on the imaginary axis.
    """
    A = _matrix(k1 / np.sqrt(k2), np.ones_like(k2))  # in units in which k2 = 1
    hamiltonian = np.zeros((k1.size, 4, 4))
    hamiltonian[:, :2, :2], hamiltonian[:, 2:, 2:] = A, -A.swapaxes(1, 2)
    hamiltonian[:, 2, 0] = -1.0
    low, high = np.zeros_like(k1), np.full_like(k1, 2.0)
    for _ in range(45):
        d = (low + high) / 2.0
        hamiltonian[:, 1, 3] = d**2
        solvable = np.abs(np.linalg.eigvals(hamiltonian).real).min(axis=1) > 1e-7
        low, high = np.where(solvable, d, low), np.where(solvable, high, d)
    return low * k2


def _random_pairs(rng: np.random.Generator) -> tuple[Array, Array]:
    k1 = np.exp(rng.uniform(np.log(0.2), np.log(100.0), 1000))
    k2 = np.exp(rng.uniform(np.log(0.1), np.log(1000.0), 1000))
    return k1, k2


@pytest.fixture(scope="module")
def laws() -> Laws:
    return reaching.random_laws(np.random.default_rng(31), 75)


@pytest.fixture(scope="module")
def certificate(laws: Laws) -> Certificate:
    return _certify(laws)


@pytest.mark.slow
def test_admissible_rate_is_the_limit_of_the_riccati_equation(rng: np.random.Generator) -> None:
    k1, k2 = _random_pairs(rng)
    limit = certify(k1, k2, k2, s0=1.0, disturbance0=0.0).d_max_admissible
    np.testing.assert_allclose(limit, _riccati_limit(k1, k2), rtol=1e-6)


def test_admissible_rate_is_the_inverse_of_the_resonance_peak(rng: np.random.Generator) -> None:
    k1, k2 = _random_pairs(rng)
    limit = certify(k1, k2, k2, s0=1.0, disturbance0=0.0).d_max_admissible
    np.testing.assert_allclose(limit, 1.0 / reaching.peak_gain(k1, k2), rtol=1e-6)


@pytest.mark.slow
def test_feasible_exactly_below_the_frequency_condition(rng: np.random.Generator) -> None:
    k1, k2 = _random_pairs(rng)
    limit = 1.0 / reaching.peak_gain(k1, k2)
    below = certify(k1, k2, (1.0 - 1e-6) * limit, s0=1.0, disturbance0=0.0)
    above = certify(k1, k2, (1.0 + 1e-6) * limit, s0=1.0, disturbance0=0.0)
    assert below.feasible.all()
    assert np.isfinite(below.reaching_time).all()
    assert not above.feasible.any()
    assert np.isinf(above.reaching_time).all()


def test_paper_condition_is_the_overdamped_case() -> None:
    certificate = certify([8.0, 100.0], 10.0, 0.0, s0=1.0, disturbance0=0.0)
    np.testing.assert_allclose(certificate.d_max_admissible, 10.0, rtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0 - 1e-4])
def test_matrix_inequality_holds_strictly(laws: Laws, share: float) -> None:
    loaded = laws._replace(d_max=share / reaching.peak_gain(laws.k1, laws.k2))
    certificate = _certify(loaded)
    assert certificate.epsilon.min() > 0.0
    assert np.linalg.eigvalsh(certificate.P).min() > 0.0
    assert np.linalg.eigvalsh(_inequality(loaded, certificate)).max() < 0.0


@pytest.mark.slow
def test_times_follow_from_the_certificate_alone(laws: Laws, certificate: Certificate) -> None:
    x0, P = _x0(laws), certificate.P
    energy = np.einsum("ij,ijk,ik->i", x0, P, x0)
    s_bound = energy * np.linalg.inv(P)[:, 0, 0]
    np.testing.assert_allclose(certificate.s_bound, s_bound, rtol=1e-9)
    np.testing.assert_allclose(
        certificate.reaching_time, 2.0 * np.sqrt(s_bound) / certificate.epsilon, rtol=1e-9
    )


def test_reaching_time_never_exceeds_the_printed_formula(
    laws: Laws, certificate: Certificate
) -> None:
    x0, P = _x0(laws), certificate.P
    energy = np.einsum("ij,ijk,ik->i", x0, P, x0)
    printed = 2.0 * np.sqrt(energy / np.linalg.eigvalsh(P)[:, 0]) / certificate.epsilon
    assert np.all(certificate.reaching_time <= certificate.reaching_time_paper)
    assert np.all(certificate.reaching_time_paper <= printed * (1.0 + 1e-12))


@pytest.mark.slow
def test_printed_formula_is_at_its_best_riccati_solution(
    laws: Laws, certificate: Certificate
) -> None:
    A, x0, CtC = _matrix(laws.k1, laws.k2), _x0(laws), np.outer(C, C)
    for i in range(5):
        times, d = [], laws.d_max[i]
        for epsilon in laws.k1[i] / 2.0 * np.geomspace(1e-3, 0.999, 40):
            shifted = A[i] + epsilon / 2.0 * np.eye(2)
            try:
                P = solve_continuous_are(shifted, d * B[:, None], CtC, [[-1.0]])
            except np.linalg.LinAlgError:
                continue
            residual = shifted.T @ P + P @ shifted + CtC + d**2 * np.outer(P @ B, P @ B)
            if np.abs(residual).max() < 1e-9 and np.linalg.eigvalsh(P)[0] > 0.0:
                energy = x0[i] @ P @ x0[i] / np.linalg.eigvalsh(P)[0]
                times.append(2.0 * np.sqrt(energy) / epsilon)
        assert certificate.reaching_time_paper[i] <= 1.001 * min(times)


def test_no_other_lyapunov_function_gives_a_smaller_bound(
    rng: np.random.Generator, laws: Laws, certificate: Certificate
) -> None:
    A, x0 = _matrix(laws.k1, laws.k2), _x0(laws)
    for i in range(20):
        corners = A[i] + laws.d_max[i] * np.array([[[0, 0], [1, 0]], [[0, 0], [-1, 0]]])
        near = np.linalg.cholesky(certificate.P[i]) @ (
            np.eye(2) + rng.normal(size=(2000, 2, 2)) * 10.0 ** rng.uniform(-4, 0.3, (2000, 1, 1))
        )
        P = near @ near.swapaxes(1, 2)
        flow = np.linalg.solve(
            P[:, None], corners.swapaxes(1, 2) @ P[:, None] + P[:, None] @ corners
        )
        epsilon = -np.linalg.eigvals(flow).real.max(axis=(1, 2))  # by the inequality's corners
        size = np.sqrt(np.einsum("j,njk,k->n", x0[i], P, x0[i]) * np.linalg.inv(P)[:, 0, 0])
        shortest = np.min(2.0 * size[epsilon > 0] / epsilon[epsilon > 0])
        assert certificate.reaching_time[i] <= 1.0002 * shortest


def test_integration_meets_the_exact_reaching_time(laws: Laws) -> None:
    at_zero = laws._replace(s0=np.zeros_like(laws.s0), d_max=np.zeros_like(laws.s0))
    measured = reaching.measure_reaching(at_zero, lambda time, x1, z: 0.0 * time * x1 * z)
    np.testing.assert_allclose(measured.time, reaching.exact_reaching_time(at_zero), rtol=1e-3)


@pytest.mark.slow
def test_reaching_time_bounds_the_exact_one(laws: Laws) -> None:
    at_zero = laws._replace(s0=np.zeros_like(laws.s0), d_max=np.zeros_like(laws.s0))
    assert np.all(reaching.exact_reaching_time(at_zero) <= _certify(at_zero).reaching_time)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sine", "square", "random", "worst-sign"])
def test_measured_reaching_stays_within_the_certificate(
    laws: Laws, certificate: Certificate, kind: str
) -> None:
    rate = reaching.disturbances(np.random.default_rng(32), laws)[kind]
    measured = reaching.measure_reaching(laws, rate)
    assert certificate.feasible.all()
    assert np.all(measured.time <= certificate.reaching_time)
    assert np.all(measured.s_peak <= certificate.s_bound * (1.0 + 1e-12))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sine", "square", "random", "worst-sign"])
def test_measured_settling_stays_within_the_certificate(laws: Laws, kind: str) -> None:
    rng = np.random.default_rng(33)
    nv, smoothing = laws.k1.size, 1e-3
    lam, gamma = rng.uniform(0.5, 4.0, (2, nv))
    alpha, e0 = rng.uniform(0.55, 0.9, nv), rng.uniform(-1.0, 1.0, nv)
    certificate = _certify(laws, FastTerminalSurface(lam, gamma, alpha, smoothing), e0)

    def phi(e1: Array) -> Array:
        size = np.abs(e1)
        inner = (2.0 - alpha) * smoothing ** (alpha - 1.0) * size
        inner = inner + (alpha - 1.0) * smoothing ** (alpha - 2.0) * size**2
        outer = np.maximum(size, smoothing) ** alpha
        value: Array = lam * e1 + gamma * np.sign(e1) * np.where(size > smoothing, outer, inner)
        return value

    measured = reaching.measure_settling(
        laws,
        reaching.disturbances(rng, laws)[kind],
        phi,
        e0,
        smoothing,
        1.05 * certificate.total_time,
        steps=8_000,
    )
    assert np.all(measured.time <= certificate.total_time)
    assert np.all(measured.e1_peak <= certificate.e1_bound * (1.0 + 1e-12))


@pytest.mark.slow
def test_total_time_starts_sliding_from_the_largest_error(laws: Laws) -> None:
    surface = FastTerminalSurface(2.0, 3.0, 0.6)
    certificate = _certify(laws, surface, np.full(laws.k1.size, 0.3))
    assert np.all(certificate.e1_bound >= 0.3)
    np.testing.assert_array_equal(
        certificate.sliding_time, surface.sliding_time(certificate.e1_bound)
    )
    np.testing.assert_array_equal(
        certificate.total_time, certificate.reaching_time + certificate.sliding_time
    )


def test_power_surface_has_no_finite_total_time() -> None:
    surface = PowerSurface(3.0, 5.0 / 3.0)
    certificate = certify(8, 10, 5, s0=1.0, disturbance0=2.0, surface=surface, e0=0.5)
    assert certificate.feasible.all()
    assert np.isfinite(certificate.reaching_time).all()
    assert np.isinf(certificate.total_time).all()
    assert "PowerSurface" in certificate.reason[0]
    assert "finite time" in certificate.explain()


@pytest.mark.parametrize("beta", [1.0, 2.0 ** (2.0 / 3.0), 3.0])
def test_theorem_is_not_claimed_on_the_nonsingular_terminal_surface(beta: float) -> None:
    surface = NonsingularTerminalSurface(beta, 5.0 / 3.0)
    certificate = certify(8, 10, 5, s0=1.0, disturbance0=2.0, surface=surface, e0=0.5)
    assert not certificate.feasible.any()
    assert np.isinf(certificate.reaching_time).all()
    assert np.isinf(certificate.total_time).all()
    assert "NonsingularTerminalSurface" in certificate.reason[0]


def test_without_a_surface_nothing_is_said_of_the_error() -> None:
    certificate = certify(8, 10, 5, s0=1.0, disturbance0=2.0)
    assert certificate.reason == ("",)
    assert np.isfinite(certificate.reaching_time).all()
    for time in (certificate.e1_bound, certificate.sliding_time, certificate.total_time):
        assert np.isinf(time).all()
    assert "e1" not in certificate.explain()


def test_start_at_rest_is_reached_at_once() -> None:
    certificate = certify(8, 10, 5, s0=0.0, disturbance0=0.0)
    assert certificate.feasible.all()
    assert certificate.reaching_time[0] == 0.0
    assert certificate.reaching_time_paper[0] == 0.0
    assert certificate.s_bound[0] == 0.0


@pytest.mark.slow
def test_times_scale_as_the_homogeneous_law_does(laws: Laws, certificate: Certificate) -> None:
    grown = laws._replace(s0=9.0 * laws.s0, disturbance0=3.0 * laws.disturbance0)
    np.testing.assert_allclose(
        _certify(grown).reaching_time, 3.0 * certificate.reaching_time, rtol=1e-5
    )
    mirrored = laws._replace(s0=-laws.s0, disturbance0=-laws.disturbance0)
    np.testing.assert_allclose(
        _certify(mirrored).reaching_time, certificate.reaching_time, rtol=1e-12
    )


@pytest.mark.slow
def test_two_signs_cover_every_smaller_start(rng: np.random.Generator) -> None:
    both = certify(8, 10, 5, s0=1.0, disturbance0=[2.0, -2.0]).reaching_time.max()
    inside = certify(
        8, 10, 5, s0=rng.uniform(-1, 1, 50), disturbance0=rng.uniform(-2, 2, 50)
    ).reaching_time
    assert np.all(inside <= both)


def test_bound_is_larger_for_a_stronger_disturbance() -> None:
    times = certify(8, 10, np.linspace(0.0, 9.9, 30), s0=1.0, disturbance0=2.0).reaching_time
    assert np.all(np.diff(times) > 0.0)


@pytest.mark.parametrize(("k1", "k2", "d_max"), [(2.0, 10.0, 7.0), (0.1, 50.0, 49.0)])
def test_advice_of_a_larger_k1_is_exact(k1: float, k2: float, d_max: float) -> None:
    reason = certify(k1, k2, d_max, s0=1.0, disturbance0=0.0).reason[0]
    found = re.search(r"raise k1 above (\S+)$", reason)
    assert found is not None
    advised = float(found[1])
    assert certify(1.001 * advised, k2, d_max, s0=1.0, disturbance0=0.0).feasible.all()
    assert not certify(0.999 * advised, k2, d_max, s0=1.0, disturbance0=0.0).feasible.any()


def test_advice_is_about_k2_where_no_k1_helps() -> None:
    certificate = certify([8.0, 8.0], 10.0, [12.0, 5.0], s0=1.0, disturbance0=0.0)
    assert "raise k2 above 12" in certificate.reason[0]
    assert certificate.reason[1] == ""
    np.testing.assert_array_equal(certificate.feasible, [False, True])
    assert not certificate.P[0].any()
    assert certificate.epsilon[0] == 0.0


def test_explanation_names_times_conditions_and_limits() -> None:
    surface = FastTerminalSurface(2.0, 3.0, 0.6, 1e-3)
    certificate = certify(8, 10, [5, 12], s0=1.0, disturbance0=2.0, surface=surface, e0=0.5)
    text = certificate.explain()
    assert f"{certificate.reaching_time[0]:.4g} s" in text
    assert f"{certificate.total_time[0]:.4g} s" in text
    assert "smoothing radius (0.001)" in text
    assert "Joint 1: Not guaranteed" in text
    assert "sampled" in text


def test_certificate_cannot_be_changed() -> None:
    certificate = certify(8, 10, 5, s0=1.0, disturbance0=2.0)
    with pytest.raises(FrozenInstanceError):
        certificate.settled = "now"  # type: ignore[misc]
    for name in ("k1", "P", "epsilon", "reaching_time", "feasible", "total_time"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(certificate, name)[0] = 1.0


def test_caller_keeps_his_arrays() -> None:
    k1 = np.array([8.0, 9.0])
    certify(k1, 10, 5, s0=np.ones(2), disturbance0=0.0)
    k1[0] = 7.0
    assert k1[0] == 7.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("k1", 0.0), ("k1", [8.0, -1.0]), ("k2", -10.0), ("d_max", -1.0), ("k2", np.inf)],
)
def test_inadmissible_gain_is_refused(name: str, value: object) -> None:
    arguments: dict[str, object] = {"k1": 8.0, "k2": 10.0, "d_max": 5.0, name: value}
    with pytest.raises(ParameterError) as caught:
        certify(**arguments, s0=1.0, disturbance0=0.0)  # type: ignore[arg-type]
    assert caught.value.name == name


@pytest.mark.parametrize("name", ["s0", "disturbance0", "e0"])
def test_start_that_is_not_finite_is_refused(name: str) -> None:
    starts: dict[str, object] = {"s0": 1.0, "disturbance0": 0.0, "e0": 0.0, name: [0.0, np.nan]}
    with pytest.raises(NonFiniteError) as caught:
        certify(8, 10, 5, surface=PowerSurface(3.0, 1.5), **starts)  # type: ignore[arg-type]
    assert caught.value.name == name
    assert caught.value.index == (1,)


@pytest.mark.parametrize(
    ("name", "value"), [("s0", np.ones(3)), ("disturbance0", np.ones((2, 2))), ("s0", "much")]
)
def test_start_of_another_shape_is_refused(name: str, value: object) -> None:
    starts: dict[str, object] = {"s0": 1.0, "disturbance0": 0.0, name: value}
    with pytest.raises(DimensionError):
        certify([8.0, 8.0], 10, 5, **starts)  # type: ignore[arg-type]


@pytest.mark.parametrize("count", [1, 2])
def test_surface_for_other_joints_is_refused(count: int) -> None:
    surface = PowerSurface([3.0, 3.0, 3.0], 1.5)
    with pytest.raises(DimensionError, match="surface"):
        certify(8, 10, 5, s0=np.ones(count), disturbance0=0.0, surface=surface, e0=0.0)


def test_surface_and_error_go_together() -> None:
    with pytest.raises(DimensionError, match="together"):
        certify(8, 10, 5, s0=1.0, disturbance0=0.0, surface=PowerSurface(3.0, 1.5))
    with pytest.raises(DimensionError, match="together"):
        certify(8, 10, 5, s0=1.0, disturbance0=0.0, e0=0.5)
