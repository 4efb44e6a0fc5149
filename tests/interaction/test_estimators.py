"""Momentum observers as sensors, against closed forms of their filters and against torques that were applied."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.interaction import (
    Chain,
    Delay,
    JointTorque,
    LowPass,
    Perfect,
    Push,
    Sensor,
)
from rbimpedance.interaction.estimators import MomentumObserver, SuperTwistingMomentumObserver
from rbimpedance.simulation.replay import replay_sensor
from rbimpedance.trajectories import hold

from .. import laws
from ..arms import ARMS, manipulator
from ..oracles import two_link
from ..runs import pushed_swing

Array = NDArray[np.float64]
GAIN = 80.0


def quick_momentum(arm: rbi.ArmModel, dt: float) -> MomentumObserver:
    return MomentumObserver(arm, 5.0 * GAIN, dt)


def super_twisting(arm: rbi.ArmModel, dt: float) -> SuperTwistingMomentumObserver:
    return SuperTwistingMomentumObserver(arm, rbi.SuperTwisting(20.0, 90.0), dt)


def momentum(arm: rbi.ArmModel, dt: float) -> MomentumObserver:
    return MomentumObserver(arm, GAIN, dt)


ESTIMATORS: dict[str, Callable[[rbi.ArmModel, float], Sensor[Any]]] = {
    "momentum": momentum,
    "super-twisting": super_twisting,
}


@pytest.mark.parametrize("name", ARMS)
def test_torque_on_an_arm_that_is_held_comes_through_a_first_order_low_pass(name: str) -> None:
    arm, dt = ARMS[name](), 2e-3
    q, rest = arm.neutral, np.zeros(arm.nv)
    torque, gains = np.linspace(-3.0, 4.0, arm.nv), np.linspace(20.0, 90.0, arm.nv)
    observer = MomentumObserver(arm, gains, dt)
    state, held = observer.init(), arm.bias(q, rest) - torque
    _, state = observer.step(state, q, rest, held, rest)
    for k in range(1, 60):
        told, state = observer.step(state, q, rest, held, rest)
        assert_allclose(told, (1.0 - np.exp(-gains * dt * k)) * torque, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_moving_arm_makes_no_torque_of_its_own_to_second_order(name: str) -> None:
    arm = ARMS[name]()
    push = Push([5.0, -3.0, 8.0, 0.5, 0.2, -0.3], 0.2, 0.6)
    steps, errors = np.array([8e-3, 4e-3, 2e-3]), []
    for dt in steps:
        result = pushed_swing(arm, dt, environment=push)
        mean = (result.tau_ext[1:] + result.tau_ext[:-1]) / 2.0  # of a period
        r = np.zeros_like(result.tau)
        for k in range(1, len(r)):
            r[k] = r[k - 1] + (1.0 - np.exp(-GAIN * dt)) * (mean[k - 1] - r[k - 1])
        errors.append(np.abs(replay_sensor(result, momentum(arm, dt)) - r).max())
    assert errors[-1] < 0.01
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.7


@pytest.mark.slow
def test_ramp_is_followed_late_by_the_delay() -> None:
    arm, dt, rate = manipulator(), 1e-3, np.linspace(2.0, -3.0, 6)
    result = pushed_swing(arm, dt, environment=JointTorque(lambda t: rate * t))
    observer = momentum(arm, dt)
    late = rate * (result.t[-1] - observer.delay)
    assert_allclose(replay_sensor(result, observer)[-1], late, rtol=0.0, atol=2e-3)
    assert_allclose(observer.delay, 1.0 / GAIN, rtol=1e-2)
    assert np.abs(rate * observer.delay).max() > 0.03


@pytest.mark.slow
def test_super_twisting_estimate_is_the_disturbance_of_a_run_without_measured_torque() -> None:
    arm, dt = manipulator(), 1e-3
    result = pushed_swing(arm, dt, environment=JointTorque(np.linspace(-3.0, 4.0, 6)))
    estimate = replay_sensor(result, super_twisting(arm, dt))
    assert_allclose(estimate[result.t > 0.5], result.tau_ext[result.t > 0.5], atol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATORS)
def test_payload_that_the_model_lacks_reads_as_a_weight_on_the_tool(name: str) -> None:
    arm, q_d = rbi.load_robot("two_link"), np.array([0.4, 0.3])
    impedance = rbi.Impedance(1.0, 80.0, 200.0)
    result = rbi.simulate(
        rbi.baselines.PDGravity(arm, impedance, 1e-3),
        arm.with_payload(2.0),
        hold(arm, q_d),
        q0=q_d,
        duration=10.0,
        substeps=1,
    )
    weight = two_link.jacobian(result.q[-1]).T @ [0.0, -2.0 * two_link.GRAVITY]
    told = replay_sensor(result, ESTIMATORS[name](arm, 1e-3))[-1]
    assert_allclose(told, weight, rtol=0.0, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("build", [quick_momentum, super_twisting])
def test_what_the_model_lacks_is_told_as_contact_and_nothing_else(
    build: Callable[[rbi.ArmModel, float], Sensor[Any]],
) -> None:
    arm = manipulator()
    plant = arm.with_scaled_inertia(1.1).with_friction(viscous=arm.viscous + 0.5)
    result = pushed_swing(arm, 1e-3, plant)
    acceleration_deficit = []
    for q, v, tau, tau_ext in zip(result.q, result.v, result.tau, result.tau_ext, strict=True):
        a = plant.forward_dynamics(q, v, tau, tau_ext)
        acceleration_deficit.append(arm.inverse_dynamics(q, v, a) - plant.inverse_dynamics(q, v, a))
    told = replay_sensor(result, build(arm, 1e-3))
    late = result.t > 0.3
    believed, lack = (told - result.tau_ext)[late], np.array(acceleration_deficit)[late]
    assert np.abs(lack).max() > 1.0
    assert np.sqrt(np.mean((believed - lack) ** 2)) < 0.1 * np.sqrt(np.mean(lack**2))


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimator_finds_a_push_in_the_closed_loop(name: str) -> None:
    arm, dt = manipulator(), 1e-3
    estimator = ESTIMATORS[name](arm, dt)
    controller = laws.controller(arm, 15.0, 50.0, dt=dt)
    torque = np.linspace(-1.0, 2.0, 6)
    result = rbi.simulate(
        controller,
        arm,
        hold(arm),
        environment=JointTorque(torque),
        sensor=estimator,
        duration=3.0,
        substeps=1,
    )
    assert_allclose(replay_sensor(result, estimator)[-1], torque, atol=5e-3)
    assert_allclose(result.q[-1], torque / 20.0, atol=2e-3)  # the spring K_d, at rest


@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimate_does_not_look_at_the_truth_and_is_pure(
    name: str, rng: np.random.Generator
) -> None:
    arm = ARMS["spinner"]()
    estimator = ESTIMATORS[name](arm, 1e-3)
    _, state = estimator.step(estimator.init(), arm.neutral, *rng.normal(size=(3, 3)))
    q, v, tau = arm.random_configuration(rng), *rng.normal(size=(2, 3))
    first, after = estimator.step(state, q, v, tau, rng.normal(size=3))
    second, again = estimator.step(state, q, v, tau, rng.normal(size=3))
    assert_array_equal(first, second)
    for one, other in zip(after, again, strict=True):
        assert_array_equal(one, other)
    assert np.abs(first).max() > 0.0


@pytest.mark.slow
def test_sense_tells_what_the_controller_was_told() -> None:
    arm, dt = manipulator(), 2e-3
    told: list[Array] = []

    class Spy(Perfect):
        """Lets the torque pass, and keeps it."""

        def step(self, state: None, *measured: Any) -> tuple[Array, None]:
            told.append(measured[-1].copy())
            return super().step(state, *measured)

    sensor = Chain(momentum(arm, dt), Delay(2), LowPass(30.0, dt))
    result = pushed_swing(arm, dt, sensor=Chain(sensor, Spy()))
    assert_array_equal(replay_sensor(result, sensor), told)


def test_unusable_estimator_is_refused() -> None:
    arm = manipulator()
    with pytest.raises(rbi.ParameterError, match=r"^gain must be"):
        MomentumObserver(arm, 0.0, 1e-3)
    with pytest.raises(rbi.DimensionError, match=r"^gain must be"):
        MomentumObserver(arm, [1.0, 2.0], 1e-3)
    with pytest.raises(rbi.ParameterError, match=r"^dt must be"):
        MomentumObserver(arm, 1.0, 0.0)
    with pytest.raises(rbi.DimensionError, match="k1"):
        SuperTwistingMomentumObserver(arm, rbi.SuperTwisting([1.0, 2.0], 1.0), 1e-3)
    short = rbi.scenarios.paper(duration=0.01).simulate()
    with pytest.raises(rbi.DimensionError, match="nv = 6"):
        replay_sensor(short, momentum(arm, 1e-3))
