"""The sliding surfaces against finite differences and against integrations of their own motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.law.super_twisting import Scheme
from rbimpedance.law.surfaces import Surface, sig

Array = NDArray[np.float64]

POWER = rbi.PowerSurface(gamma=3.0, exponent=5.0 / 3.0)
FAST = rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6, smoothing=1e-3)
NONSINGULAR = rbi.NonsingularTerminalSurface(beta=3.0, exponent=5.0 / 3.0)
ALL = pytest.mark.parametrize("surface", [POWER, FAST, NONSINGULAR])


def _errors(rng: np.random.Generator, count: int = 1000) -> Array:
    """Errors of both signs over seven decades, the smoothing radius well inside."""
    return rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-7.0, 0.5, count)


def _slide(rate: Callable[[Array], Array], e1: float, end: float) -> float:
    """Time of a numeric integration of de1/dt = rate(e1) from e1 > 0 until e1 = end."""

    def slope(t: float, e: Array) -> Array:
        del t
        return rate(e)

    def arrived(t: float, e: Array) -> float:
        del t
        return float(e[0] - end)

    arrived.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        slope, (0.0, 60.0), [e1], method="LSODA", events=arrived, rtol=1e-10, atol=1e-14
    )
    assert run.t_events is not None
    return float(run.t_events[0][0])


# --- what every surface has -----------------------------------------------------------------------


@ALL
def test_surface_is_odd(surface: Surface, rng: np.random.Generator) -> None:
    e1, e2 = _errors(rng), _errors(rng)
    assert_array_equal(surface.value(-e1, -e2), -surface.value(e1, e2))
    assert_array_equal(surface.feedforward(-e1, -e2), -surface.feedforward(e1, e2))
    assert_array_equal(surface.value(np.zeros(2), np.zeros(2)), 0.0)


@ALL
def test_surface_is_strictly_increasing_in_e1(surface: Surface, rng: np.random.Generator) -> None:
    edges = np.concatenate([_errors(rng), [0.0], 1e-3 * (1.0 + np.array([-1e-6, 0.0, 1e-6]))])
    e1 = np.unique(np.concatenate([edges, -edges]))
    assert (np.diff(surface.value(e1, np.zeros_like(e1))) > 0.0).all()


@ALL
def test_surface_of_a_vector_is_that_of_its_scalars(
    surface: Surface, rng: np.random.Generator
) -> None:
    e1, e2 = _errors(rng, 7), _errors(rng, 7)
    for name in ("value", "feedforward"):
        function = getattr(surface, name)
        each = [function(e1[i : i + 1], e2[i : i + 1])[0] for i in range(7)]
        assert_allclose(function(e1, e2), each, rtol=1e-14)


def test_surface_takes_its_own_parameters_on_each_joint(rng: np.random.Generator) -> None:
    rate, gamma, alpha, eps = [1.0, 2.0], [3.0, 4.0], [0.6, 0.8], [1e-3, 1e-2]
    both = rbi.FastTerminalSurface(rate, gamma, alpha, eps)
    e1, e2 = _errors(rng, 2), _errors(rng, 2)
    for j in range(2):
        one = rbi.FastTerminalSurface(rate[j], gamma[j], alpha[j], eps[j])
        value = one.value(e1[j : j + 1], e2[j : j + 1])[0]
        assert both.value(e1, e2)[j] == pytest.approx(value, rel=1e-14)
        assert both.sliding_time(e1)[j] == pytest.approx(float(one.sliding_time(e1[j])), rel=1e-14)


# --- rates along the flow -------------------------------------------------------------------------


@pytest.mark.parametrize("surface", [POWER, FAST])
def test_feedforward_is_the_rate_of_the_e1_part(surface: Surface, rng: np.random.Generator) -> None:
    e1, e2 = _errors(rng), _errors(rng)
    step = 1e-5 * np.abs(e1) / np.abs(e2)
    ahead, behind = surface.value(e1 + step * e2, e2), surface.value(e1 - step * e2, e2)
    # Both differences carry the rounding of s, which holds e2; the quotient, 1e-5 of e1's slope.
    noise = 4.0 * np.finfo(float).eps * np.maximum(np.abs(ahead), np.abs(e2)) / step
    difference = (ahead - behind) / (2.0 * step)
    assert (
        np.abs(difference - surface.feedforward(e1, e2)) <= 1e-5 * np.abs(difference) + noise
    ).all()


@pytest.mark.parametrize("surface", [POWER, FAST])
def test_s_obeys_the_reaching_law_along_the_flow(
    surface: Surface, rng: np.random.Generator
) -> None:
    e1, e2, u = rng.uniform(0.1, 1.0, 500), rng.uniform(-2.0, 2.0, 500), rng.normal(0.0, 5.0, 500)
    rate = -(surface.feedforward(e1, e2) + u)
    h = 1e-6
    after = surface.value(e1 + h * e2, e2 + h * rate)
    before = surface.value(e1 - h * e2, e2 - h * rate)
    assert_allclose((after - before) / (2.0 * h), -u, rtol=0.0, atol=1e-6)


def test_nonsingular_surface_has_the_gain_that_its_docs_say(rng: np.random.Generator) -> None:
    e1, e2, u = _errors(rng, 500), rng.uniform(0.1, 2.0, 500), rng.normal(0.0, 5.0, 500)
    rate = -(NONSINGULAR.feedforward(e1, e2) + u)
    h = 1e-6
    after = NONSINGULAR.value(e1 + h * e2, e2 + h * rate)
    before = NONSINGULAR.value(e1 - h * e2, e2 - h * rate)
    p, beta = 5.0 / 3.0, 3.0
    assert_allclose(
        (after - before) / (2.0 * h), -p / beta * e2 ** (p - 1.0) * u, rtol=0.0, atol=1e-6
    )


def test_fast_surface_is_smooth_at_the_smoothing_radius_and_nowhere_singular() -> None:
    eps, one = 1e-3, np.ones(1)
    inside, outside = np.array([eps * (1.0 - 1e-9)]), np.array([eps * (1.0 + 1e-9)])
    zero = np.zeros(1)
    assert_allclose(FAST.value(inside, zero), FAST.value(outside, zero), rtol=1e-8)
    assert_allclose(FAST.feedforward(inside, one), FAST.feedforward(outside, one), rtol=1e-8)
    e1 = np.linspace(-1.0, 1.0, 20_001)
    steepest = 2.0 + 3.0 * (2.0 - 0.6) * eps ** (0.6 - 1.0)  # λ + γ·φ'(0)
    assert FAST.feedforward(e1, np.ones_like(e1)).max() == pytest.approx(steepest, rel=1e-12)


# --- an acceleration that is held for a period ----------------------------------------------------


def _after_a_held_period(e1: Array, e2: Array, u: Array, dt: float, divided: bool) -> Array:
    """s after dt under the acceleration of the law, held; e1 moves under it by dt²/2."""
    gain = FAST.zoh_gain(e1, dt) if divided else 1.0
    a = (FAST.feedforward(e1, e2) + u) / gain
    return FAST.value(e1 + e2 * dt - a * dt**2 / 2.0, e2 - a * dt)


@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4])
def test_held_acceleration_changes_s_by_what_the_scheme_asked_for(dt: float) -> None:
    zero, u = np.zeros(1), np.array([0.05])
    after = _after_a_held_period(zero, zero, u, dt, divided=True)
    curvature = 3.0 * (1.0 - 0.6) * 1e-3 ** (0.6 - 2.0)  # of φ on either side of 0
    moved = u * dt**2 / 2.0
    assert_allclose(after, -u * dt, rtol=0.0, atol=float(curvature * moved[0] ** 2))


def test_undivided_acceleration_has_too_much_gain_by_a_third_at_ten_milliseconds() -> None:
    zero, u = np.zeros(1), np.array([0.01])
    after = _after_a_held_period(zero, zero, u, 1e-2, divided=False)
    assert -after[0] / (u[0] * 1e-2) == pytest.approx(1.34, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["matched", "implicit"])
@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_fast_surface_does_not_chatter_at_any_period(scheme: Scheme, dt: float) -> None:
    scenario = rbi.scenarios.paper(surface="fast-terminal", scheme=scheme, dt=dt)
    late = scenario.simulate().metrics(after=5.0)
    assert late["tau_variation"][0] <= 6.0
    assert late["e1_max"].max() <= (2e-5 if dt == 1e-2 else 2e-6)


class Undivided(rbi.FastTerminalSurface):
    """The continuous law, held."""

    def zoh_gain(self, e1: Array, dt: float) -> Array:
        del dt
        return np.ones_like(e1)


@pytest.mark.slow
def test_it_is_the_hold_gain_that_spares_the_implicit_scheme_the_chatter() -> None:
    scenario = rbi.scenarios.paper(surface="fast-terminal", scheme="implicit", dt=1e-2)
    old = scenario.controller
    assert isinstance(old, rbi.ImpedanceController)
    controller = rbi.ImpedanceController(
        old.arm,
        old.impedance,
        Undivided(2.0, 3.0, 0.6, 1e-3),
        old.reaching,
        old.dt,
        model=old.model,
    )
    result = replace(scenario, controller=controller).simulate()
    assert result.metrics(after=5.0)["tau_variation"][0] > 1000.0


@pytest.mark.parametrize("surface", [POWER, NONSINGULAR])
def test_other_surfaces_leave_the_law_as_printed(
    surface: Surface, rng: np.random.Generator
) -> None:
    assert_array_equal(surface.zoh_gain(_errors(rng), 1e-2), 1.0)


# --- sliding times --------------------------------------------------------------------------------


@pytest.mark.parametrize("e1", [0.002, 0.03, 0.4, 3.0])
def test_fast_surface_slides_for_the_time_it_says(e1: float) -> None:
    def rate(e: Array) -> Array:
        return -FAST.value(e, np.zeros_like(e))  # e2 on s = 0

    for end in (1e-3, 1e-5, 1e-7):
        assert FAST.time_to(end, e1) == pytest.approx(_slide(rate, e1, end), rel=1e-6)
    assert FAST.sliding_time(e1) == pytest.approx(_slide(rate, e1, 1e-3), rel=1e-6)
    assert FAST.sliding_time(-e1) == FAST.sliding_time(e1)


def test_fast_surface_slides_within_the_bound_of_its_docs(rng: np.random.Generator) -> None:
    lam, gamma, alpha = (
        rng.uniform(0.1, 10.0, 200),
        rng.uniform(0.1, 10.0, 200),
        rng.uniform(0.51, 0.99, 200),
    )
    e1 = _errors(rng, 200)
    surface = rbi.FastTerminalSurface(lam, gamma, alpha, 1e-3)
    bound = np.log(1.0 + lam / gamma * np.abs(e1) ** (1.0 - alpha)) / (lam * (1.0 - alpha))
    assert (surface.sliding_time(e1) <= bound).all()
    within = np.abs(e1) <= 1e-3
    assert_array_equal(surface.sliding_time(e1)[within], 0.0)
    assert (surface.sliding_time(e1)[~within] > 0.0).all()


@pytest.mark.parametrize("e1", [0.002, 0.4, 3.0])
def test_nonsingular_surface_slides_for_the_time_it_says(e1: float) -> None:
    def rate(e: Array) -> Array:
        return -sig(3.0 * e, 3.0 / 5.0)  # e2 on s = 0

    for end in (1e-3, 1e-6):
        assert NONSINGULAR.time_to(end, e1) == pytest.approx(_slide(rate, e1, end), rel=1e-6)
    rest = NONSINGULAR.sliding_time(e1) - NONSINGULAR.time_to(1e-9, e1)
    assert rest == pytest.approx(float(NONSINGULAR.sliding_time(1e-9)), rel=1e-9)
    assert NONSINGULAR.value(np.array([e1]), rate(np.array([e1])))[0] == pytest.approx(
        0.0, abs=1e-12
    )


@pytest.mark.parametrize("e1", [0.05, 0.7, 2.0])
def test_power_surface_slides_for_the_time_it_says_and_for_ever(e1: float) -> None:
    def rate(e: Array) -> Array:
        return -POWER.value(e, np.zeros_like(e))

    for end in (1e-2, 1e-3):
        assert POWER.time_to(end, e1) == pytest.approx(_slide(rate, e1, end), rel=1e-6)
    assert np.isposinf(POWER.sliding_time(e1))
    assert POWER.sliding_time(0.0) == 0.0


@ALL
def test_no_time_is_needed_where_the_tolerance_holds_already(surface: Surface) -> None:
    assert surface.time_to(1e-2, 5e-3) == 0.0
    assert surface.time_to(5e-3, -5e-3) == 0.0


def test_power_surface_follows_its_closed_form_in_the_closed_loop() -> None:
    result = rbi.scenarios.paper(surface="power", scheme="implicit", duration=10.0).simulate()
    sliding = result.t >= 3.0
    t, e1 = result.t[sliding] - 3.0, np.abs(result.e1[sliding])
    assert np.abs(result.s[sliding]).max() < 1e-4
    predicted = (e1[0] ** (1.0 - 5.0 / 3.0) + 3.0 * (2.0 / 3.0) * t[:, None]) ** (-1.5)
    assert_allclose(e1, predicted, rtol=0.01)


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.0, -1.0, np.nan, np.inf, "fast", [[1.0]]])
def test_bad_gain_is_refused(gamma: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=r"gamma must be positive"):
        rbi.PowerSurface(gamma, 5.0 / 3.0)
    with pytest.raises(rbi.ParameterError, match=r"gamma must be positive"):
        rbi.FastTerminalSurface(2.0, gamma, 0.6)
    with pytest.raises(rbi.ParameterError, match=r"beta must be positive"):
        rbi.NonsingularTerminalSurface(gamma, 5.0 / 3.0)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 0.5, np.nan])
def test_exponent_outside_its_interval_is_refused(exponent: float) -> None:
    with pytest.raises(rbi.ParameterError, match="strictly between 1 and 2"):
        rbi.PowerSurface(3.0, exponent)
    with pytest.raises(rbi.ParameterError, match="strictly between 1 and 2"):
        rbi.NonsingularTerminalSurface(3.0, exponent)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 0.3, np.nan])
def test_exponent_of_the_fast_surface_outside_its_interval_is_refused(exponent: float) -> None:
    with pytest.raises(rbi.ParameterError, match=r"strictly between 0.5 and 1"):
        rbi.FastTerminalSurface(2.0, 3.0, exponent)


@pytest.mark.parametrize("name", ["rate", "smoothing"])
def test_fast_surface_refuses_what_is_not_positive(name: str) -> None:
    with pytest.raises(rbi.ParameterError, match=f"{name} must be positive"):
        rbi.FastTerminalSurface(**({"rate": 2.0, "gamma": 3.0, "exponent": 0.6} | {name: 0.0}))
