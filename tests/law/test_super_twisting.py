"""The discretisations of the reaching law against the continuous law and on ds/dt = w - u, sampled exactly."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.law.super_twisting import ReachingState, Scheme

Array = NDArray[np.float64]

K1, K2, L = 8.0, 10.0, 5.0
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
EACH_SCHEME = pytest.mark.parametrize("scheme", SCHEMES)


class Run(NamedTuple):
    """The sampled loop from a quarter of its length on; first axis time, one column a lane."""

    s: Array
    u: Array


def _loop(law: rbi.SuperTwisting, h: float, duration: float, rates: Any, gain: Any = 1.0) -> Run:
    """Sample ds/dt = w - gain·u from s = 1, w = 0; dw/dt = rates(t, s) is held, u is held."""
    lanes = np.broadcast_shapes(np.shape(rates(0.0, np.ones(1))), np.shape(gain), (1,))
    s, w = np.ones(lanes), np.zeros(lanes)
    state = law.start(s)
    log: list[tuple[Array, Array]] = []
    for k in range(round(duration / h)):
        u, state = law.step(s, state, h)
        log.append((s, u))
        rate = rates(k * h, s)
        s = s + h * (w + rate * h / 2.0) - h * gain * u
        w = w + rate * h
    columns = [np.array(column)[len(log) // 4 :] for column in zip(*log, strict=True)]
    return Run(*columns)


def _three_disturbances() -> Any:
    """Lanes: the worst sign, a square wave, and a random sign at every period; abs(dw/dt) = L."""
    rng = np.random.default_rng(20_250_3)

    def rates(t: float, s: Array) -> Array:
        worst = 1.0 if s.flat[0] >= 0.0 else -1.0
        square = 1.0 if t % 1.0 < 0.5 else -1.0
        return L * np.array([worst, square, rng.choice([-1.0, 1.0])])

    return rates


def _square(t: float, s: Array) -> Array:
    del s
    return np.array([L if t % 1.0 < 0.5 else -L])


def _states(rng: np.random.Generator, count: int) -> tuple[Array, ReachingState]:
    s = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-9.0, 1.0, count)
    z, x, a = rng.normal(0.0, 1.0, (3, count))
    return s, ReachingState(z, s + 1e-3 * x, 1e-3 * a)


# --- what every scheme has ------------------------------------------------------------------------


@EACH_SCHEME
def test_scheme_is_odd(scheme: Scheme, rng: np.random.Generator) -> None:
    law = rbi.SuperTwisting(K1, K2, scheme=scheme)
    s, state = _states(rng, 1000)
    u, following = law.step(s, state, 1e-3)
    mirrored, opposite = law.step(-s, ReachingState(*(-part for part in state)), 1e-3)
    assert_array_equal(mirrored, -u)
    for part, other in zip(following, opposite, strict=True):
        assert_array_equal(other, -part)


@EACH_SCHEME
def test_scheme_of_a_vector_is_that_of_its_scalars(
    scheme: Scheme, rng: np.random.Generator
) -> None:
    k1, k2 = rng.uniform(1.0, 20.0, 7), rng.uniform(1.0, 50.0, 7)
    s, state = _states(rng, 7)
    u, following = rbi.SuperTwisting(k1, k2, scheme=scheme).step(s, state, 1e-3)
    for j in range(7):
        one = rbi.SuperTwisting(k1[j], k2[j], scheme=scheme)
        u_one, following_one = one.step(
            s[j : j + 1], ReachingState(*(part[j : j + 1] for part in state)), 1e-3
        )
        assert_allclose(u[j], u_one[0], rtol=1e-14)
        for part, other in zip(following, following_one, strict=True):
            assert_allclose(part[j], other[0], rtol=1e-14, atol=1e-20)


@EACH_SCHEME
@pytest.mark.parametrize("h", [1e-2, 1e-3])
def test_u_is_bounded_on_bounded_s(scheme: Scheme, h: float, rng: np.random.Generator) -> None:
    law = rbi.SuperTwisting(K1, K2, scheme=scheme)
    s = np.concatenate(
        [rng.uniform(-2.0, 2.0, 1000), 10.0 ** rng.uniform(-300.0, -3.0, 100), [0.0]]
    )
    u, following = law.step(s, law.start(s), h)
    assert (np.abs(u) <= K1 * np.sqrt(2.0) + 2.0 * h * K2).all()
    assert (np.abs(following.z) <= h).all()


@EACH_SCHEME
def test_scheme_tends_to_the_continuous_law_at_first_order(scheme: Scheme) -> None:
    duration = 0.08  # s stays positive, so that the continuous law is a smooth equation here

    def rate(t: float, s: Array) -> Array:
        slope: Array = -K1 * np.sqrt(s) - K2 * t + 2.0 * np.sin(30.0 * t)
        return slope

    truth = solve_ivp(rate, (0.0, duration), [1.0], rtol=1e-12, atol=1e-14).y[0, -1]
    law = rbi.SuperTwisting(K1, K2, scheme=scheme)
    steps = np.array([200, 400, 800, 1600])
    errors = []
    for n in steps:
        h, s = duration / n, np.ones(1)
        state = law.start(s)
        for k in range(n):
            u, state = law.step(s, state, h)
            s = s - h * u + (np.cos(30.0 * k * h) - np.cos(30.0 * (k + 1) * h)) / 15.0
        errors.append(abs(s[0] - truth))
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.05)


@EACH_SCHEME
def test_step_changes_nothing_that_it_was_given(scheme: Scheme, rng: np.random.Generator) -> None:
    s, state = _states(rng, 5)
    kept = s.copy(), ReachingState(*(part.copy() for part in state))
    rbi.SuperTwisting(K1, K2, scheme=scheme).step(s, state, 1e-3)
    assert_array_equal(s, kept[0])
    for part, before in zip(state, kept[1], strict=True):
        assert_array_equal(part, before)


# --- worst-case precision -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("h", "duration"), [(1e-2, 20.0), (1e-3, 8.0)])
def test_implicit_scheme_has_the_best_precision_that_is_possible(h: float, duration: float) -> None:
    """s shows the mean of w one period late, when it may be off by L·h: no law stays below L·h²."""
    worst = {
        scheme: np.abs(
            _loop(rbi.SuperTwisting(K1, K2, scheme=scheme), h, duration, _three_disturbances()).s
        ).max(axis=0)
        / (L * h**2)
        for scheme in SCHEMES
    }
    assert (worst["implicit"] <= 1.02).all()
    assert worst["implicit"][0] >= 0.98
    assert (worst["explicit"] > 2.5).all()
    assert (worst["explicit"] < 4.3).all()
    assert (worst["matched"] > worst["explicit"]).all()
    assert (worst["matched"] < 17.0).all()


def test_implicit_scheme_rests_at_zero_without_a_disturbance() -> None:
    law = rbi.SuperTwisting(K1, K2, scheme="implicit")
    run = _loop(law, 1e-3, 4.0, lambda t, s: 0.0 * t * s)
    assert_allclose(run.s[-100:], 0.0, atol=1e-12)
    assert_allclose(run.u[-100:], 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["matched", "implicit"])
def test_torque_does_not_chatter_where_forward_euler_does(scheme: Scheme) -> None:
    """w varies by L a second: that is what u has to do, and these schemes do no more."""

    def variation(scheme: Scheme) -> float:
        u = _loop(rbi.SuperTwisting(K1, K2, scheme=scheme), 1e-3, 8.0, _square).u
        return float(np.abs(np.diff(u, axis=0)).sum() / 6.0)

    assert variation(scheme) == pytest.approx(L, rel=0.01)
    assert variation("explicit") > 2.5 * L


# --- a wrong input gain ---------------------------------------------------------------------------


def test_matched_scheme_bears_gains_from_0_8_to_2_2() -> None:
    gains = np.linspace(0.8, 2.2, 15)
    run = _loop(rbi.SuperTwisting(K1, K2, scheme="matched"), 1e-3, 12.0, _square, gains)
    assert (np.abs(run.s).max(axis=0) < 50.0 * L * 1e-6).all()
    variation = np.abs(np.diff(run.u, axis=0)).sum(axis=0) / 9.0
    assert_allclose(variation, L / gains, rtol=0.02)


@pytest.mark.slow
def test_implicit_scheme_bears_gains_from_0_5_to_1_2_and_diverges_at_1_5() -> None:
    law = rbi.SuperTwisting(K1, K2, scheme="implicit")
    run = _loop(law, 1e-3, 12.0, _square, np.linspace(0.55, 1.2, 10))
    assert (np.abs(run.s).max(axis=0) < 4.0 * L * 1e-6).all()
    diverging = _loop(law, 1e-3, 2.0, _square, np.array([1.5]))
    assert np.abs(diverging.s).max() > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("margin", [2.0, 4.0, 10.0])
def test_margin_buys_gain_and_costs_precision(margin: float) -> None:
    gains = np.array([1.0, margin, 2.2 * margin + 8.0])
    run = _loop(rbi.SuperTwisting(K1, K2, "matched", margin), 1e-3, 12.0, _square, gains)
    variation = np.abs(np.diff(run.u, axis=0)).sum(axis=0) / 9.0
    assert_allclose(variation[:2], L / gains[:2], rtol=0.05)  # no chatter
    assert variation[2] > 10.0 * L / gains[2]  # beyond what it bears
    precision = np.abs(run.s).max(axis=0)[0] / (L * 1e-6)
    assert precision == pytest.approx(16.0 * margin**2, rel=0.15)


@pytest.mark.parametrize(
    ("scheme", "margin"), [("implicit", 1.0), ("matched", 1.0), ("matched", 2.0), ("matched", 4.0)]
)
def test_law_rests_up_to_the_gain_that_its_linear_form_at_zero_bears(
    scheme: Scheme, margin: float
) -> None:
    """Poles of [[1 - 2g/m, -g·h·k2], [1/(m²·h·k2), 1]] in the unit circle: g < 4m²/(4m - 1)."""
    limit = 4.0 * margin**2 / (4.0 * margin - 1.0)

    def pulse(t: float, s: Array) -> Array:
        return np.full_like(s, L if t < 0.5 else 0.0)

    gains = limit * np.array([0.5, 0.98, 1.1])
    swing = np.abs(_loop(rbi.SuperTwisting(K1, K2, scheme, margin), 1e-3, 6.0, pulse, gains).s)
    assert (swing[-1000:, :2] < 1e-9 * L * 1e-6).all()
    assert swing[-1000:, 2].max() > 1e-2 * L * 1e-6


def test_margin_may_differ_from_joint_to_joint(rng: np.random.Generator) -> None:
    s, state = _states(rng, 2)
    u, _ = rbi.SuperTwisting(K1, K2, "matched", [1.0, 4.0]).step(s, state, 1e-3)
    for j, margin in enumerate([1.0, 4.0]):
        one, _ = rbi.SuperTwisting(K1, K2, "matched", margin).step(s, state, 1e-3)
        assert u[j] == one[j]


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["k1", "k2"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "high", [1.0, 0.0]])
def test_bad_gain_is_refused(name: str, value: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=f"{name} must be positive"):
        rbi.SuperTwisting(**({"k1": K1, "k2": K2} | {name: value}))


def test_unknown_scheme_is_refused_with_the_known_ones() -> None:
    with pytest.raises(rbi.ParameterError, match='"explicit", "matched" or "implicit"'):
        rbi.SuperTwisting(K1, K2, scheme="backward")  # type: ignore[arg-type]


def test_margin_below_one_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match="margin must be at least 1"):
        rbi.SuperTwisting(K1, K2, "matched", 0.5)


@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_margin_of_a_scheme_without_one_is_refused(scheme: Scheme) -> None:
    with pytest.raises(rbi.ParameterError, match="only 'matched' has a margin"):
        rbi.SuperTwisting(K1, K2, scheme, 2.0)
