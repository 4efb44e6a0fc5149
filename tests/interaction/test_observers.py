"""The disturbance observer, against disturbances that were injected and against the closed form."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.law.super_twisting import Scheme
from rbimpedance.trajectories import cosine, hold

from ..arms import ARMS, manipulator
from ..oracles import two_link

Array = NDArray[np.float64]

K1, K2 = 12.0, 30.0


def _run(
    arm: rbi.ArmModel, dt: float, disturbance: Callable[[float], Array]
) -> rbi.SimulationResult:
    """A swing under a torque that is then struck from the record, as no sensor measured it."""
    impedance = rbi.Impedance(1.0, 20.0, 100.0)
    trajectory = cosine(arm, amplitude=0.3, period=2.0)
    result = rbi.simulate(
        rbi.baselines.ComputedTorqueImpedance(arm, impedance, dt),
        arm,
        trajectory,
        environment=rbi.JointTorque(disturbance),
        q0=trajectory(0.0).q,
        duration=3.0,
        substeps=2,
        integrator="rk4",
    )
    return dataclasses.replace(result, tau_ext=np.zeros_like(result.tau_ext))


def _error(
    result: rbi.SimulationResult,
    arm: rbi.ArmModel,
    disturbance: Callable[[float], Array],
    scheme: Scheme,
) -> Array:
    """Largest error of each joint once the observer has converged."""
    w = rbi.estimate_disturbance(result, arm, rbi.SuperTwisting(K1, K2, scheme))
    truth = np.array([disturbance(t) for t in result.t])
    error: Array = np.abs(w - truth)[result.t > 1.5].max(axis=0)
    return error


@pytest.mark.slow
@pytest.mark.parametrize("make", [manipulator, ARMS["spinner"]])
def test_constant_disturbance_is_found_to_second_order(make: Callable[[], rbi.ArmModel]) -> None:
    arm = make()
    torque = np.linspace(-3.0, 4.0, arm.nv)
    steps = np.array([8e-3, 4e-3, 2e-3])
    errors = [
        _error(_run(arm, dt, lambda _: torque), arm, lambda _: torque, "implicit").max()
        for dt in steps
    ]
    assert errors[-1] < 1e-3
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.15)


def test_disturbance_of_an_arm_at_rest_is_found_to_rounding() -> None:
    arm, torque = rbi.load_robot("two_link"), np.array([3.0, -1.0])
    q = np.array([0.3, 0.4])
    held = arm.bias(q, np.zeros(2)) - torque
    observer = rbi.SuperTwistingDisturbanceObserver(arm, rbi.SuperTwisting(K1, K2), 1e-3)
    state = observer.init()
    for _ in range(2000):
        estimate, state = observer.step(state, q, np.zeros(2), held, np.zeros(2))
    assert_allclose(estimate.w, torque, rtol=0.0, atol=1e-12)
    assert_allclose(estimate.s, 0.0, atol=1e-14)


def _lag(reaching: rbi.SuperTwisting, dt: float, rate: Array) -> Array:
    """Time by which a ramp is followed late; docs/theory.md derives it."""
    if reaching.scheme == "implicit":
        return np.full_like(rate, dt / 2.0)
    k1, k2 = reaching.k1, reaching.k2
    r = rate / k2  # s/D at the fixed point of the matched scheme, s = r·D
    root_s = dt * (r * k1 + np.sqrt(r**2 * k1**2 + 4.0 * (1.0 - r) * r * k2)) / (2.0 * (1.0 - r))
    lag: Array = dt / 2.0 + k1 / k2 * root_s
    return lag


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit", "matched"])
def test_sine_is_followed_with_the_lag_that_theory_gives(scheme: Scheme) -> None:
    arm, omega, dt = manipulator(), 3.0, 1e-3
    amplitude = np.linspace(1.0, 2.0, arm.nv)

    def disturbance(t: float) -> Array:
        sine: Array = amplitude * np.sin(omega * t)
        return sine

    error = _error(_run(arm, dt, disturbance), arm, disturbance, scheme)
    rate = amplitude * omega
    lag = _lag(rbi.SuperTwisting(K1, K2, scheme), dt, rate)
    assert_allclose(error, rate * lag, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["matched", "implicit"])
def test_what_the_papers_controller_does_not_know_is_found(scheme: Scheme) -> None:
    arm, reaching, errors = rbi.load_robot("two_link"), rbi.SuperTwisting(60.0, 200.0, scheme), []
    for dt in (2e-3, 1e-3):
        scenario = rbi.scenarios.paper(
            surface="fast-terminal", scheme="matched", dt=dt, duration=5.0, substeps=1
        )
        result = dataclasses.replace(scenario, integrator="rk4").simulate()
        w = rbi.estimate_disturbance(result, arm, reaching, model="inertia")
        motion = zip(result.q, result.v, strict=True)
        truth = np.array([-two_link.bias(q, v) for q, v in motion])  # -(C v + G + F v)
        late = result.t > 2.0
        error = np.abs(w - truth)[late].max(axis=0)
        rate = np.abs(np.diff(truth[late], axis=0)).max(axis=0) / dt
        assert np.abs(truth[late]).max() > 20.0
        assert (error <= 1.1 * rate * _lag(reaching, dt, rate)).all()
        errors.append(error)
    assert (errors[1] / errors[0] < 0.52).all()  # first order, or better


@pytest.mark.slow
def test_payload_shows_as_its_weight() -> None:
    arm, q_d = rbi.load_robot("two_link"), np.array([0.4, 0.3])
    controller = rbi.baselines.PDGravity(arm, rbi.Impedance(1.0, 80.0, 200.0), 1e-3)
    result = rbi.simulate(
        controller, arm.with_payload(2.0), hold(arm, q_d), q0=q_d, duration=10.0, substeps=1
    )
    w = rbi.estimate_disturbance(result, arm, rbi.SuperTwisting(60.0, 200.0))
    weight = two_link.jacobian(result.q[-1]).T @ [0.0, -2.0 * two_link.GRAVITY]
    assert_allclose(w[-1], weight, rtol=0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_exact_model_leaves_nothing_to_find(name: str) -> None:
    arm = ARMS[name]()
    result = _run(arm, 2e-3, lambda _: np.zeros(arm.nv))
    w = rbi.estimate_disturbance(result, arm, rbi.SuperTwisting(K1, K2))
    assert np.abs(w).max() < 5e-3


def test_estimate_is_unchanged_when_the_step_is_repeated(rng: np.random.Generator) -> None:
    arm = ARMS["spinner"]()
    observer = rbi.SuperTwistingDisturbanceObserver(
        arm, rbi.SuperTwisting(K1, K2), 1e-3, model="inertia"
    )
    _, state = observer.step(
        observer.init(), arm.random_configuration(rng), *rng.normal(size=(3, arm.nv))
    )
    inputs = (arm.random_configuration(rng), *rng.normal(size=(3, arm.nv)))
    before = [np.copy(x) for x in (*state, *inputs)]
    first, after = observer.step(state, *inputs)
    second, _ = observer.step(state, *inputs)
    for one, other in zip(first, second, strict=True):
        assert_array_equal(one, other)
    for old, new in zip(before, (*state, *inputs), strict=True):
        assert_array_equal(old, new)
    for array in (*first, *after[1:]):
        assert not any(np.shares_memory(array, x) for x in inputs)


def test_bad_input_is_refused() -> None:
    arm, gains, zero = rbi.load_robot("two_link"), rbi.SuperTwisting(K1, K2), np.zeros(2)
    observer = rbi.SuperTwistingDisturbanceObserver(arm, gains, 1e-3)
    with pytest.raises(rbi.DimensionError, match="tau must"):
        observer.step(observer.init(), zero, zero, np.zeros(3), zero)
    with pytest.raises(rbi.NonFiniteError, match="tau_ext"):
        observer.step(observer.init(), zero, zero, zero, [0.0, np.inf])
    with pytest.raises(rbi.ParameterError, match="dt"):
        rbi.SuperTwistingDisturbanceObserver(arm, gains, -1.0)
    with pytest.raises(rbi.ParameterError, match="model"):
        rbi.SuperTwistingDisturbanceObserver(arm, gains, 1e-3, model="none")  # type: ignore[arg-type]
    with pytest.raises(rbi.DimensionError, match="k2"):
        rbi.SuperTwistingDisturbanceObserver(arm, rbi.SuperTwisting(1.0, [1.0] * 3), 1e-3)


def test_run_of_another_arm_is_refused() -> None:
    arm = rbi.load_robot("two_link")
    result = rbi.scenarios.paper(duration=0.01).simulate()
    with pytest.raises(rbi.DimensionError, match="nv = 6"):
        rbi.estimate_disturbance(result, manipulator(), rbi.SuperTwisting(K1, K2))
    short = dataclasses.replace(result, t=result.t[:1])
    with pytest.raises(rbi.DimensionError, match="two samples"):
        rbi.estimate_disturbance(short, arm, rbi.SuperTwisting(K1, K2))
