"""Estimators find what is there: speed, disturbance and friction of plants whose truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.estimation import (
    ExtendedStateObserver,
    FrictionLearner,
    NoiseGate,
    RobustDifferentiator,
)
from rbimpedance.control.estimation.differentiator import implicit_correction
from rbimpedance.control.estimation.extended_state import correction
from rbimpedance.control.estimation.friction_learning import OWN, Expectation, released, waves

from ..arms import pendulum, spinner

H = 1e-3


def test_observer_gains_place_three_poles_at_once() -> None:
    omega = 80.0
    l1, l2, l3 = (float(part[0]) for part in correction(np.ones(1), np.array([omega]), H))
    predict = np.array([[1.0, H, H * H / 2], [0.0, 1.0, H], [0.0, 0.0, 1.0]])
    error = predict @ (np.eye(3) - np.outer([l1, l2, l3], [1.0, 0.0, 0.0]))
    poles = np.linalg.eigvals(error)
    assert np.poly(error) == pytest.approx(np.poly(np.full(3, np.exp(-omega * H))), abs=1e-9)
    assert np.abs(poles).max() < 1.0


@pytest.mark.parametrize("delay", [0, 2])
def test_observer_finds_a_constant_torque_behind_lag_and_delay(delay: int) -> None:
    """A free mass with a lagging motor and an unknown load; the plant's steps are a hundred times finer."""
    arm, lag, load = pendulum().with_gravity(np.zeros(3)), 3e-3, 0.7
    inertia = float(arm.mass_matrix(arm.neutral)[0, 0])
    observer = ExtendedStateObserver(arm, 100.0, H, lag=lag, delay=delay)
    state = observer.init(arm.neutral)
    q = v = torque = 0.0
    sent = [0.0] * delay
    for k in range(400):
        estimate = observer.correct(state, observer.innovation(state, np.array([q])))
        tau = np.array([np.sin(0.05 * k)])
        sent.append(float(tau[0]))
        acting = sent.pop(0)
        for _ in range(100):
            torque += (acting - torque) * -np.expm1(-H / 100 / lag)
            v += H / 100 * (torque + load) / inertia
            q += H / 100 * v
        state = observer.predict(estimate, tau, np.zeros(1))
    assert state.disturbance == pytest.approx(load, abs=0.02)
    assert state.v == pytest.approx(v, abs=2e-3)
    assert state.torque == pytest.approx(torque, abs=0.02)


def test_observer_looks_ahead_to_when_its_torque_acts() -> None:
    arm = spinner()
    observer = ExtendedStateObserver(arm, 50.0, H, lag=2e-3, delay=3)
    rng = np.random.default_rng(0)
    state = observer.init(arm.neutral, 0.3 * rng.normal(size=arm.nv))
    state = state._replace(pending=rng.normal(size=(3, arm.nv)))
    estimate = observer.correct(state, np.zeros(arm.nv))
    q, v = observer.ahead(estimate, np.zeros(arm.nv))
    for _ in range(3):  # the model at one posture, three times
        state = observer.predict(estimate, np.zeros(arm.nv), np.zeros(arm.nv))
        estimate = estimate._replace(state=state)
    assert arm.difference(state.q, q) == pytest.approx(0.0, abs=1e-12)
    assert state.v == pytest.approx(v, abs=1e-12)


def test_gate_stays_closed_under_noise_of_a_count_and_opens_at_a_disturbance() -> None:
    count = 1e-5
    gate = NoiseGate(np.array([10.0]), np.array([60.0]), count, H)
    state, rng = gate.init(), np.random.default_rng(1)
    for _ in range(2000):
        state = gate.step(state, count * rng.uniform(-1.0, 1.0, 1))
    assert state.opening == pytest.approx(0.0, abs=1e-12)
    assert gate.bandwidth(state) == pytest.approx(10.0)
    for _ in range(100):
        state = gate.step(state, np.array([20.0 * count]))
    assert gate.bandwidth(state) == pytest.approx(60.0, rel=1e-3)
    closing = [state := gate.step(state, np.zeros(1)) for _ in range(1000)]
    assert closing[-1].opening < 0.02


def follow(late: Any, torque: Any, share: Any) -> None:
    """What an observer makes of a torque: three low-passes."""
    for k in range(3):
        late[k] += share * (torque - late[k])
        torque = late[k]


def test_ripple_is_learned_beside_friction_at_a_bandwidth_below_its_frequency() -> None:
    """Ripple of 42 rad/s behind an observer of 27 rad/s, on a torque of 60 N·m."""
    expected = Expectation(
        np.zeros((7, 1)), np.array([[2.0], [1.0], [0.1], *[[0.03]] * 2, *[[1e-3]] * 2])
    )
    learner, omega = FrictionLearner(1, H, expected=expected), np.array([27.0])
    state, late, share, N = learner.init(), np.zeros((3, 1)), -np.expm1(-omega * H), np.array([200])
    for k in range(12000):
        angle, v = np.array([0.2 * np.sin(k * H)]), np.array([0.2 * np.cos(k * H)])
        wave = waves(angle, N, np.array([60.0]))
        truth = 1.5 * np.tanh(v / 0.02) + 0.5 * v + 0.02 * wave[0] - 0.01 * wave[1]
        follow(late, truth, share)
        state = learner.step(state, v, -late[2], omega, wave=wave)
    assert state.parameters[0] == pytest.approx(1.5, abs=0.1)
    assert state.parameters[3:5, 0] == pytest.approx([0.02, -0.01], abs=5e-4)


def test_friction_is_learned_from_the_disturbance_that_it_leaves() -> None:
    """The disturbance is what an ideal observer, three low-passes late, would give."""
    learner, omega = FrictionLearner(1, H), np.array([60.0])
    state, late = learner.init(), np.zeros((3, 1))
    share = -np.expm1(-omega * H)
    for k in range(12000):
        v = np.array([0.4 * np.sin(k * H * 2.0)])
        truth = 1.5 * np.tanh(v / 0.02) + 0.8 * v + 0.3
        follow(late, truth, share)
        state = learner.step(state, v, -late[2], omega)
    assert state.parameters[:3, 0] == pytest.approx([1.5, 0.8, 0.3], abs=0.05)
    assert learner.torque(state, np.array([0.3])) == pytest.approx(1.5 + 0.24 + 0.3, abs=0.05)


def test_load_and_friction_are_distinguished_in_a_motion_that_never_reverses() -> None:
    """Three joints in one direction: gravity of one kilogram acts on two of them; friction alone could explain it."""
    expected = Expectation(
        np.tile([[1.0], [0.5], *[[0.0]] * 5], 3),
        np.tile([[1.0], [0.5], [0.15], [1e-3], [1e-3], [0.05], [1.0]], 3),
    )
    learner, omega = FrictionLearner(3, H, expected=expected), np.full(3, 60.0)
    state, dry, load = learner.init(), np.array([1.5, 0.5, 2.0]), 0.8
    late, share = np.zeros((3, 3)), -np.expm1(-omega * H)
    for k in range(3000):
        v = np.array([0.3, 0.2, 0.1]) * np.sin(k * H)
        loads = np.array([[5.0, 3.0, 0.0], [8.0 * np.cos(k * H), 3.0, 0.0]])
        truth = dry * np.tanh(v / 0.02) + 0.5 * v + load * loads[1]
        follow(late, truth, share)
        state = learner.step(state, v, -late[2], omega, np.zeros(3), loads)
    assert state.parameters[6] == pytest.approx(load, abs=0.1)
    assert state.parameters[0] == pytest.approx(dry, abs=0.3)
    assert np.ptp(state.parameters[6]) == 0.0


def test_joint_at_rest_teaches_nothing_and_forgets_nothing() -> None:
    learner = FrictionLearner(1, H)
    state = learner.init()
    for _ in range(1000):
        state = learner.step(state, np.array([0.2]), np.array([-1.0]), np.array([60.0]))
    known = state.parameters
    for _ in range(1000):
        state = learner.step(state, np.zeros(1), np.array([3.0]), np.array([60.0]))
    assert state.parameters == pytest.approx(known, abs=1e-12)


def test_least_squares_are_those_of_the_whole_system() -> None:
    """Elimination joint by joint against one dense solve of all parameters."""
    rng, nv = np.random.default_rng(3), 3
    learner = FrictionLearner(nv, H, memory=0.05, stribeck=0.3)
    state, omega = learner.init(), np.full(nv, 80.0)
    for _ in range(200):
        v, d, fed = rng.normal(size=(3, nv))
        loads, (sine, cosine) = rng.normal(size=(2, 2, nv))
        state = learner.step(state, v, d, omega, fed, loads, (sine, cosine))
    size = OWN * nv + 2
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for j in range(nv):
        own = [*range(OWN * j, OWN * j + OWN), size - 2, size - 1]
        upper = np.zeros((7, 8))
        upper[np.triu_indices(7, 0, 8)] = (state.normal + learner.equations)[:, j]
        matrix[np.ix_(own, own)] += upper[:, :7] + np.triu(upper[:, :7], 1).T
        right[own] += upper[:, 7]
    matrix[[-2, -1], [-2, -1]] += learner.shared_weights
    theta = np.linalg.solve(matrix, right)
    assert state.parameters[OWN:, 0] == pytest.approx(theta[-2:], rel=1e-8, abs=1e-12)
    found = theta[:-2].reshape(nv, OWN).T
    assert state.parameters[:2] == pytest.approx(np.maximum(found[:2], 0.0), rel=1e-8)
    assert state.parameters[2:OWN] == pytest.approx(found[2:], rel=1e-8)


def test_reversal_releases_what_a_joint_that_sticks_has_wound_up_and_no_more() -> None:
    """A reference through zero at 0.2 rad/s²: what dry friction may have caused goes, the excess of a load stays."""
    small, large, dry = np.array([1.5]), np.array([20.0]), np.array([2.0])
    still = np.array([0.7])
    for k in range(-400, 400):
        v, before = 0.2 * np.array([k * H]), 0.2 * np.array([(k - 1) * H])
        small = small - released(small, dry, v, before, 0.2)
        large = large - released(large, dry, v, before, 0.2)
        still = still - released(still, dry, np.zeros(1), np.zeros(1), 0.2)
    assert abs(small[0]) < 0.05
    assert large[0] > 20.0 - 2.4 * 4.2
    assert still[0] == 0.7


def test_gate_opens_at_an_error_that_no_count_shows() -> None:
    gate = NoiseGate(10.0, 60.0, 1e-5, H, accuracy=1e-3)
    state = gate.init()
    for _ in range(200):
        state = gate.step(state, np.zeros(1), np.array([0.9e-3]))
    assert state.opening == 0.0
    for _ in range(200):
        state = gate.step(state, np.zeros(1), np.array([-2e-3]))
    assert gate.bandwidth(state) == pytest.approx(60.0, rel=1e-3)


def test_differentiator_is_exact_where_the_acceleration_is_bounded() -> None:
    law, k = RobustDifferentiator(5.0, H), np.arange(4000)
    q, v = np.sin(2.0 * k * H), 2.0 * np.cos(2.0 * k * H)  # accelerations up to 4
    state, speeds = law.init(1), []
    for position in q:
        state = law.step(state, np.array([position]))
        speeds.append(float(state.v[0]))
    late = slice(2000, None)
    lag = np.abs(np.array(speeds)[late] - v[late]).max()
    assert lag < 5.0 * H  # the acceleration times a period
    assert (
        np.abs(np.diff(speeds)[late]).max() < 1.1 * 5.0 * H
    )  # no chatter: the speed moves as the signal does


def test_implicit_step_solves_its_own_equation() -> None:
    rng, k1, k2, h = np.random.default_rng(0), np.array(3.0), np.array(20.0), 0.01
    for ahead in rng.uniform(-0.02, 0.02, 50):
        e, sign = implicit_correction(np.array(ahead), k1, k2, h)
        assert e + h * k1 * np.sqrt(np.abs(e)) * np.sign(e) + h * h * k2 * sign == pytest.approx(
            ahead, abs=1e-15
        )
        assert abs(sign) <= 1.0
        assert e == 0.0 or sign == np.sign(e)


def test_observer_is_quieter_than_differences_by_the_ratio_that_its_text_states() -> None:
    """Speeds from counts of a slow motion: the noise of a difference, and of the observer at ω·h = 0.1."""
    arm, count = pendulum().with_gravity(np.zeros(3)), 2.0 * np.pi / 2**17
    observer = ExtendedStateObserver(arm, 100.0, H)
    state, before, seen, told = observer.init(arm.neutral), 0.0, [], []
    for k in range(3000):
        q = np.rint(0.1237 * k * H / count) * count
        estimate = observer.correct(state, observer.innovation(state, np.array([q])))
        seen.append((q - before) / H)
        told.append(float(estimate.state.v[0]))
        before, state = q, observer.predict(estimate, np.zeros(1), np.zeros(1))
    noise = [float(np.std(series[1000:])) for series in (seen, told)]
    assert noise[0] > 20.0 * noise[1]
    assert np.mean(told[1000:]) == pytest.approx(0.1237, rel=1e-2)


def test_learned_state_leaves_the_one_before_as_it_was() -> None:
    learner = FrictionLearner(2, H)
    state = learner.init()
    kept = [np.array(part) for part in state]
    learner.step(state, np.ones(2), np.ones(2), np.full(2, 50.0))
    assert all(np.array_equal(a, b) for a, b in zip(state, kept, strict=True))


def test_bounds_of_the_estimators_are_checked() -> None:
    arm = pendulum()
    for make in (
        lambda: ExtendedStateObserver(arm, -1.0),
        lambda: NoiseGate(1.0, 0.0, 1e-5, H),
        lambda: FrictionLearner(1, 0.0),
        lambda: RobustDifferentiator(0.0, H),
    ):
        with pytest.raises(rbi.ParameterError):
            make()
