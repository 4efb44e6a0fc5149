"""The inner torque loop, held to the second order that it is made for."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.interaction.wrenches import Nothing
from rbimpedance.simulation.plants.torque_loop import TorqueLoop

from ..arms import pendulum

B, K, OMEGA, H = 0.5, 1e4, 600.0, 2e-5
FREE = Nothing()


def hardware() -> rbi.Hardware:
    return rbi.Hardware(
        joint_stiffness=K, rotor_inertia=B, torque_sensor=0.0, torque_bandwidth=OMEGA
    )


def heavy() -> rbi.ArmModel:
    """Links so heavy that they stand still behind the spring."""
    return pendulum().with_gravity(np.zeros(3)).with_scaled_inertia(1e6)


def test_loop_has_the_gains_of_its_bandwidth() -> None:
    loop = TorqueLoop.for_(hardware(), heavy())
    assert K * (1.0 + loop.gain) / B == pytest.approx(OMEGA**2)
    assert loop.damping * K / B == pytest.approx(1.4 * OMEGA)
    with pytest.raises(rbi.ParameterError, match="torque_sensor"):
        TorqueLoop.for_(rbi.Hardware(joint_stiffness=K), heavy())


def test_torque_behind_the_spring_answers_as_a_damped_second_order() -> None:
    """Step of 1 N·m against 1 - e^(-ζωt)·(cos + ζ/√(1-ζ²)·sin): the spring's own damping comes on top."""
    arm = heavy()
    plant = rbi.DrivenPlant(
        arm,
        stiffness=K,
        damping=0.0,
        rotor_inertia=B,
        torque_loop=TorqueLoop.for_(hardware(), arm),
    )
    state, torque = plant.begin(arm.neutral, np.zeros(1), H), []
    for i in range(round(0.02 / H)):
        state = plant.step(state, np.ones(1), FREE, i * H, H)
        torque.append(float(K * state.delta[0]))
    t = H * np.arange(1, len(torque) + 1)
    zeta, omega = 0.7, OMEGA * np.sqrt(1.0 - 0.49)
    wave = np.cos(omega * t) + zeta / np.sqrt(1.0 - zeta**2) * np.sin(omega * t)
    expected = 1.0 - np.exp(-zeta * OMEGA * t) * wave
    assert (
        np.abs(np.array(torque) - expected).max() < 0.2
    )  # the rate's low-pass is no faster than three times ω
    assert torque[-1] == pytest.approx(1.0, abs=0.01)


def test_law_sees_a_lag_of_the_loop_and_a_lighter_rotor() -> None:
    arm = pendulum()
    assert hardware().lag(arm) == pytest.approx(1.4 / OMEGA)
    assert rbi.Hardware(torque_lag=2e-3).lag(arm) == pytest.approx(2e-3)


def test_motor_encoders_with_a_torque_sensor_tell_where_the_link_is() -> None:
    arm = pendulum().with_armature(0.0)
    plant = rbi.DrivenPlant.for_(hardware(), arm)
    state = plant.begin(arm.neutral + 0.5, np.zeros(1), 1e-4)
    assert abs(float(state.delta[0])) > 1e-5
    assert plant.measured(state).q == pytest.approx(arm.neutral + 0.5, abs=1e-12)


def test_gear_friction_holds_a_rotor_at_rest() -> None:
    arm = heavy().with_friction(0.0, 2.0)
    plant = rbi.DrivenPlant.for_(hardware().but(torque_sensor=None), arm)
    state = plant.begin(arm.neutral, np.zeros(1), H)
    for i in range(500):
        state = plant.step(state, np.array([1.9]), FREE, i * H, H)
    assert state.delta == [0.0]
    for i in range(500):
        state = plant.step(state, np.array([2.5]), FREE, i * H, H)
    assert state.delta[0] > 0.0


def test_noise_of_the_sensor_depends_on_seed_and_step_alone() -> None:
    loop = TorqueLoop(np.ones(1), 0.0, noise=0.1)
    state = loop.init(np.zeros(1))
    first, _ = loop.step(state, np.zeros(1), np.zeros(1), H)
    again, following = loop.step(state, np.zeros(1), np.zeros(1), H)
    assert first == again != 0.0
    other, _ = loop.step(following, np.zeros(1), np.zeros(1), H)
    assert other != first
