"""The target impedances and their filters, against theory and against a general ODE solver."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.law.impedance import TargetFilter
from rbimpedance.law.surfaces import sig

Array = NDArray[np.float64]


def _spd(rng: np.random.Generator, size: int) -> Array:
    root = rng.normal(size=(size, size))
    matrix: Array = root @ root.T + size * np.eye(size)
    return matrix


def _solve(acceleration: Any, duration: float, x: Array, v: Array) -> tuple[Array, Array]:
    """State after a time, by an explicit solver of order 8 at tight tolerances."""

    def field(t: float, state: Array) -> Array:
        del t
        return np.concatenate([state[len(x) :], acceleration(state[: len(x)], state[len(x) :])])

    start = np.concatenate([x, v])
    end = solve_ivp(field, (0.0, duration), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return end[: len(x)], end[len(x) :]


def _run(
    target: TargetFilter, x: float, v: float, ticks: int, tau: float = 0.0
) -> tuple[Array, Array]:
    """Position and velocity of one joint at every tick."""
    q_e, v_e, held = np.array([x]), np.array([v]), np.array([tau])
    path = [(q_e, v_e)]
    for _ in range(ticks):
        q_e, v_e = target.advance(q_e, v_e, held)
        path.append((q_e, v_e))
    positions, velocities = (np.concatenate(part) for part in zip(*path, strict=True))
    return positions, velocities


# Linear


@pytest.mark.parametrize("dt", [1e-3, 0.1])
def test_linear_filter_steps_along_the_exact_solution(dt: float, rng: np.random.Generator) -> None:
    M, D, K = (_spd(rng, 3) for _ in range(3))
    target = rbi.Impedance(M, D, K).filter(3, dt)
    for _ in range(10):
        q_e, v_e, tau = rng.normal(size=(3, 3))
        step = target.advance(q_e, v_e, tau)
        truth = _solve(lambda x, v, tau=tau: np.linalg.solve(M, tau - D @ v - K @ x), dt, q_e, v_e)
        assert_allclose(step, truth, rtol=0.0, atol=1e-11)


def test_linear_filter_gives_the_same_path_at_every_period(rng: np.random.Generator) -> None:
    impedance = rbi.Impedance(*(_spd(rng, 4) for _ in range(3)))
    fine, coarse = impedance.filter(4, 1e-2), impedance.filter(4, 1e-1)
    q_e, v_e, tau = rng.normal(size=(3, 4))
    state = (q_e, v_e)
    for _ in range(10):
        state = fine.advance(*state, tau)
    assert_allclose(state, coarse.advance(q_e, v_e, tau), rtol=0.0, atol=1e-14)


def test_linear_acceleration_balances_the_target(rng: np.random.Generator) -> None:
    M, D, K = (_spd(rng, 3) for _ in range(3))
    q_e, v_e, tau = rng.normal(size=(3, 3))
    a_e = rbi.Impedance(M, D, K).filter(3, 1e-3).acceleration(q_e, v_e, tau)
    assert_allclose(M @ a_e + D @ v_e + K @ q_e, tau, rtol=0.0, atol=1e-12)


def test_scalar_vector_and_matrix_say_the_same(rng: np.random.Generator) -> None:
    q_e, v_e, tau = rng.normal(size=(3, 3))
    steps = [
        rbi.Impedance(*gains).filter(3, 1e-2).advance(q_e, v_e, tau)
        for gains in (
            (2.0, 10.0, 20.0),
            ([2.0] * 3, [10.0] * 3, [20.0] * 3),
            (2.0 * np.eye(3), 10.0 * np.eye(3), 20.0 * np.eye(3)),
        )
    ]
    assert_array_equal(steps[0], steps[1])
    assert_array_equal(steps[0], steps[2])


@pytest.mark.parametrize("zeta", [0.2, 0.7, 1.0])
def test_every_mode_has_the_damping_ratio_asked_for(zeta: float, rng: np.random.Generator) -> None:
    M, D, K = rbi.Impedance(_spd(rng, 4), stiffness=_spd(rng, 4), damping_ratio=zeta).matrices(4)
    companion = np.block(
        [[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]]
    )
    poles = np.linalg.eigvals(companion)
    assert_allclose(-poles.real / np.abs(poles), zeta, atol=1e-6)  # double poles at ζ = 1: √eps
    assert_allclose(D, D.T, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    "impedance",
    [rbi.Impedance(1.5, 10.0, 20.0), rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, exponent=0.6)],
)
def test_error_is_the_residual_of_the_target(
    impedance: rbi.Impedance | rbi.FiniteTimeImpedance, rng: np.random.Generator
) -> None:
    target = impedance.filter(3, 1e-3)
    alpha1 = getattr(impedance, "exponent", 1.0)
    alpha2 = 2.0 * alpha1 / (1.0 + alpha1)
    for _ in range(100):
        q_e, v_e, tau, q_d, v_d, a_d, q, v, a = rng.normal(size=(9, 3))
        a_e = target.acceleration(q_e, v_e, tau)
        e_im = target.error(q_d + q_e - q, v_d + v_e - v, a_d + a_e - a, q_e, v_e)
        spring, damper = 20.0 * sig(q_d - q, alpha1), 10.0 * sig(v_d - v, alpha2)
        residual = 1.5 * (a_d - a) + damper + spring + tau  # (2), homogeneous
        assert_allclose(e_im, residual, rtol=0.0, atol=1e-12)


def test_gains_are_copied_and_locked() -> None:
    stiffness = np.array([10.0, 20.0])
    for impedance in (
        rbi.Impedance(1.0, 5.0, stiffness),
        rbi.FiniteTimeImpedance(1.0, 5.0, stiffness, 0.5),
    ):
        assert not np.shares_memory(impedance.stiffness, stiffness)
        with pytest.raises(ValueError, match="read-only"):
            impedance.stiffness[0] = 0.0


@pytest.mark.parametrize(
    ("gains", "name"),
    [
        ({"mass": 0.0, "damping": 1.0, "stiffness": 1.0}, "mass"),
        ({"mass": 1.0, "damping": -1.0, "stiffness": 1.0}, "damping"),
        ({"mass": 1.0, "damping": 1.0, "stiffness": np.nan}, "stiffness"),
        ({"mass": 1.0, "damping": 1.0}, "stiffness"),
        ({"mass": "heavy", "damping": 1.0, "stiffness": 1.0}, "mass"),
        ({"mass": 1.0, "damping": 1.0, "stiffness": 1.0, "damping_ratio": 1.0}, "damping_ratio"),
        ({"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.0}, "damping_ratio"),
        ({"mass": [[1.0, 0.2], [0.1, 1.0]], "damping": 1.0, "stiffness": 1.0}, "mass"),
        ({"mass": [[1.0, 2.0], [2.0, 1.0]], "damping": 1.0, "stiffness": 1.0}, "mass"),
    ],
)
def test_inadmissible_impedance_is_refused_by_name(gains: dict[str, Any], name: str) -> None:
    with pytest.raises(rbi.ParameterError) as caught:
        rbi.Impedance(**gains)
    assert caught.value.name == name
    if name != "mass" or np.ndim(gains["mass"]) == 0:
        with pytest.raises(rbi.ParameterError) as caught:
            rbi.FiniteTimeImpedance(**gains, exponent=0.7)
        assert caught.value.name == name


@pytest.mark.parametrize(
    ("gains", "damping"),
    [
        ({"mass": 1.0, "stiffness": 100.0}, 20.0),
        ({"mass": 4.0, "stiffness": [25.0, 100.0]}, [20.0, 40.0]),
        ({"mass": [1.0, 4.0], "stiffness": 100.0, "damping_ratio": 0.5}, [10.0, 20.0]),
        ({"mass": 1.0, "damping": [3.0, 4.0], "stiffness": 100.0}, [3.0, 4.0]),
    ],
)
def test_damping_is_critical_unless_it_is_given(gains: dict[str, Any], damping: Any) -> None:
    """D_d = 2ζ√(M_d·K_d), joint by joint."""
    D_d = rbi.Impedance(**gains).matrices(2).D_d
    assert_allclose(D_d, damping * np.eye(2), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("gains", "name"), [({}, "mass"), ({"mass": 1.0}, "stiffness")])
def test_missing_part_is_named_with_an_example(gains: dict[str, Any], name: str) -> None:
    with pytest.raises(rbi.ParameterError, match=r"Impedance\(1\.0, stiffness=100\.0\)") as caught:
        rbi.Impedance(**gains)
    assert caught.value.name == name


def test_impedance_for_another_number_of_joints_is_refused() -> None:
    with pytest.raises(rbi.DimensionError, match="stiffness"):
        rbi.Impedance(1.0, 1.0, [1.0, 2.0]).filter(3, 1e-3)
    with pytest.raises(rbi.DimensionError, match="damping"):
        rbi.FiniteTimeImpedance(1.0, [1.0, 2.0], 1.0, 0.7).filter(3, 1e-3)


# Finite time


def _alpha2(alpha1: float) -> float:
    return 2.0 * alpha1 / (1.0 + alpha1)


def _energy(m: float, k: float, alpha1: float, x: Array, v: Array) -> Array:
    energy: Array = m * v**2 / 2.0 + k * np.abs(x) ** (1.0 + alpha1) / (1.0 + alpha1)
    return energy


def test_exponent_one_is_the_linear_impedance(rng: np.random.Generator) -> None:
    mass, damping, stiffness = rng.uniform(1.0, 30.0, size=(3, 4))
    linear = rbi.Impedance(mass, damping, stiffness).filter(4, 1e-3)
    limit = rbi.FiniteTimeImpedance(mass, damping, stiffness, exponent=1).filter(4, 1e-3)
    q_e, v_e = rng.normal(size=(2, 4))
    state = truth = (q_e, v_e)
    for _ in range(1000):
        tau = rng.normal(size=4)
        truth, state = linear.advance(*truth, tau), limit.advance(*state, tau)
        assert_allclose(state, truth, rtol=0.0, atol=1e-12)


def test_distance_to_the_linear_impedance_falls_with_one_minus_the_exponent() -> None:
    linear, _ = _run(rbi.Impedance(1.0, 10.0, 20.0).filter(1, 1e-3), 0.3, 0.0, 1000, tau=4.0)
    distances = []
    for gap in (1e-1, 1e-2, 1e-3):
        target = rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, exponent=1.0 - gap).filter(1, 1e-3)
        distances.append(np.abs(_run(target, 0.3, 0.0, 1000, tau=4.0)[0] - linear).max())
    assert_allclose(np.array(distances[1:]) / distances[:-1], 0.1, rtol=0.1)


def _on_the_curve(alpha1: float, m: float, k: float) -> tuple[float, float, float]:
    """Slope μ, damping and settling time from x = 1 on the invariant curve v = -μ·sig(x)^β.

    There m·β·μ² - d·μ^α2 + k = 0 with β = (1 + α1)/2, and x(t) = [1 - (1 - β)·μ·t]^(1/(1-β)).
    """
    beta = (1.0 + alpha1) / 2.0
    mu = 0.5 * np.sqrt(_alpha2(alpha1) * k / m)  # half the slope at critical damping
    d = (k + m * beta * mu**2) / mu ** _alpha2(alpha1)
    return float(mu), float(d), float(1.0 / ((1.0 - beta) * mu))


@pytest.mark.slow
@pytest.mark.parametrize("alpha1", [0.3, 0.5, 0.7, 0.9])
def test_second_order_along_the_closed_form_until_it_settles(alpha1: float) -> None:
    m, k, beta = 1.3, 20.0, (1.0 + alpha1) / 2.0
    mu, d, settled = _on_the_curve(alpha1, m, k)
    steps, errors = np.array([8e-3, 4e-3, 2e-3]), []
    for h in steps:
        ticks = round(1.2 * settled / h)
        target = rbi.FiniteTimeImpedance(m, d, k, alpha1).filter(1, h)
        x, _ = _run(target, 1.0, -mu, ticks)
        left = np.maximum(1.0 - (1.0 - beta) * mu * h * np.arange(ticks + 1), 0.0)
        errors.append(np.abs(x - left ** (1.0 / (1.0 - beta))).max())
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 2e-6


@pytest.mark.slow
@pytest.mark.parametrize(("alpha1", "damping"), [(0.35, 10.0), (0.5, 10.0), (0.8, 1.0)])
def test_order_across_reversals_is_that_of_the_kinks(
    alpha1: float, damping: float, rng: np.random.Generator
) -> None:
    """The field is only Hölder continuous, sig^α1, where the joint crosses zero: order 1 + α1."""
    m, k, steps = 1.0, 20.0, np.array([1e-2, 5e-3, 2.5e-3, 1.25e-3])
    targets = [rbi.FiniteTimeImpedance(m, damping, k, alpha1).filter(1, h) for h in steps]
    total = np.zeros(len(steps))
    for x, v, tau in rng.normal(size=(24, 3)) * [1.0, 2.0, 3.0]:
        truth, _ = _solve(
            lambda x, v, tau=tau: (
                (tau - damping * sig(v, _alpha2(alpha1)) - k * sig(x, alpha1)) / m
            ),
            0.5,
            np.array([x]),
            np.array([v]),
        )
        runs = [_run(f, x, v, round(0.5 / h), tau)[0] for f, h in zip(targets, steps, strict=True)]
        total += [abs(path[-1] - truth[0]) for path in runs]
    assert np.polyfit(np.log(steps), np.log(total), 1)[0] > 1.0 + alpha1


@pytest.mark.slow
def test_target_never_gives_more_energy_than_it_was_given(rng: np.random.Generator) -> None:
    for _ in range(1000):
        m, d, k = 10.0 ** rng.uniform((-1, -2, -1), (1, 4, 4))
        alpha1, h = rng.uniform(0.05, 0.99), 10.0 ** rng.uniform(-4, -1)
        x, v, tau = rng.choice([-1.0, 1.0], 3) * 10.0 ** rng.uniform(-9, 1, 3)
        target = rbi.FiniteTimeImpedance(m, d, k, alpha1).filter(1, h)
        positions, velocities = _run(target, x, v, 20, tau)
        stored = _energy(m, k, alpha1, positions, velocities)
        supplied = tau * np.diff(positions)
        scale = stored[:-1] + np.abs(supplied)
        assert (np.diff(stored) - supplied <= 1e-11 * scale).all()


def test_filter_is_odd(rng: np.random.Generator) -> None:
    target = rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.6).filter(50, 1e-3)
    q_e, v_e, tau = rng.normal(size=(3, 50))
    assert_array_equal(target.advance(-q_e, -v_e, -tau), np.negative(target.advance(q_e, v_e, tau)))


def _settling_time(target: TargetFilter, x: float, h: float, horizon: float) -> float:
    """First time from which abs(q_e) stays below 1e-12, from rest."""
    positions, _ = _run(target, x, 0.0, round(horizon / h))
    outside = np.flatnonzero(np.abs(positions) >= 1e-12)
    return float(h * (outside[-1] + 1))


def test_target_lets_go_in_finite_time_where_the_linear_one_does_not() -> None:
    finite = rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.5).filter(1, 1e-3)
    linear = rbi.Impedance(1.0, 10.0, 20.0).filter(1, 1e-3)
    assert _settling_time(finite, 1.0, 1e-3, 4.0) < 2.0
    assert abs(_run(linear, 1.0, 0.0, 2000)[0][-1]) > 1e-3
    positions, velocities = _run(finite, 1.0, 0.0, 4000)
    assert max(abs(positions[-1]), abs(velocities[-1])) < 1e-300


@pytest.mark.slow
@pytest.mark.parametrize("alpha1", [0.4, 0.7])
def test_settling_time_scales_as_homogeneity_demands(alpha1: float) -> None:
    target = rbi.FiniteTimeImpedance(1.0, 8.0, 20.0, alpha1).filter(1, 5e-4)
    near, far = (_settling_time(target, x, 5e-4, 8.0) for x in (1.0 / 16.0, 1.0))
    assert far / near == pytest.approx(16.0 ** ((1.0 - alpha1) / 2.0), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("alpha1", [0.3, 0.5, 0.8, 1.0])
def test_damping_ratio_one_is_the_limit_of_overshoot(alpha1: float) -> None:
    lowest = []
    for ratio in (0.8, 1.0, 1.3):
        impedance = rbi.FiniteTimeImpedance(
            2.0, stiffness=30.0, exponent=alpha1, damping_ratio=ratio
        )
        lowest.append(_run(impedance.filter(1, 1e-3), 1.0, 0.0, 6000)[0].min())
    assert lowest[0] < -1e-6
    assert lowest[1] > -1e-12
    assert lowest[2] > -1e-12


@pytest.mark.slow
@pytest.mark.parametrize("alpha1", [0.4, 0.5])
def test_equilibrium_under_a_constant_torque_is_crept_to_polynomially(alpha1: float) -> None:
    k, tau, h = 20.0, 5.0, 1e-2
    target = rbi.FiniteTimeImpedance(1.0, 10.0, k, alpha1).filter(1, h)
    x, _ = _run(target, 0.0, 0.0, 20000, tau)
    gap = (tau / k) ** (1.0 / alpha1) - x
    t = h * np.arange(len(x))
    late = t > 50.0
    slope = np.polyfit(np.log(t[late]), np.log(gap[late]), 1)[0]
    assert slope == pytest.approx(-2.0 * alpha1 / (1.0 - alpha1), rel=0.05)


@pytest.mark.parametrize("exponent", [0.0, 1.1, -0.5, np.nan, 1e-3, None, "half"])
def test_inadmissible_exponent_is_refused(exponent: Any) -> None:
    with pytest.raises(rbi.ParameterError, match="exponent"):
        rbi.FiniteTimeImpedance(1.0, 1.0, 1.0, exponent)


def test_matrices_are_refused_with_the_reason() -> None:
    with pytest.raises(rbi.ParameterError, match="joint by joint"):
        rbi.FiniteTimeImpedance(1.0, 1.0, np.eye(2), 0.5)


@pytest.mark.slow
def test_controller_achieves_the_finite_time_target_on_an_unknown_arm() -> None:
    scenario = rbi.scenarios.paper(known="inertia", surface="fast-terminal", scheme="matched")
    proposed = scenario.controller
    assert isinstance(proposed, rbi.ImpedanceController)
    controller = rbi.ImpedanceController(
        proposed.arm,
        rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.7),
        proposed.surface,
        proposed.reaching,
        dt=1e-3,
        model="inertia",
    )
    result = rbi.simulate(
        controller,
        scenario.plant,
        scenario.trajectory,
        environment=scenario.environment,
        q0=scenario.q0,
        duration=6.0,
    )
    late = result.metrics(after=5.0)
    assert late["e1_max"].max() < 2e-6
    assert late["e_im_max"].max() < 2e-3
