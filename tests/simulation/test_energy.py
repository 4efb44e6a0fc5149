"""The energy balance, against closed forms and the order of its quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.interaction import Wall
from rbimpedance.simulation.energy import energy_balance
from rbimpedance.trajectories import hold

from ..arms import ARMS, manipulator, pendulum
from ..runs import pushed_swing


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_balance_closes_to_second_order_in_the_period(name: str) -> None:
    arm = ARMS[name]()
    steps = np.array([8e-3, 4e-3, 2e-3])
    lost = []
    for dt in steps:
        energy = energy_balance(pushed_swing(arm, float(dt)), arm)
        exchanged = np.ptp(energy.environment) + np.ptp(energy.friction)
        lost.append(np.abs(energy.residual).max() / exchanged)
    assert lost[-1] < 1e-3
    assert np.polyfit(np.log(steps), np.log(lost), 1)[0] > 1.7


@pytest.mark.slow
def test_balance_closes_for_semi_implicit_euler_too() -> None:
    arm = manipulator()
    energy = energy_balance(pushed_swing(arm, 1e-3, integrator="semi-implicit", substeps=4), arm)
    assert np.abs(energy.residual).max() < 5e-3 * np.ptp(energy.environment)


@pytest.mark.slow
def test_pendulum_trades_height_for_speed() -> None:
    arm = pendulum()
    rest = rbi.baselines.PDGravity(
        arm.with_gravity(np.zeros(3)), rbi.Impedance(1.0, 1e-9, 1e-9), 1e-3
    )
    result = rbi.simulate(
        rest, arm, hold(arm), q0=[1.2], duration=2.0, substeps=1, integrator="rk4"
    )
    energy = energy_balance(result, arm)
    height = 0.5 * (np.cos(1.2) - np.cos(result.q[:, 0]))  # bob at -l·cos q
    assert np.ptp(height) > 0.2
    assert_allclose(energy.potential, 2.0 * 9.81 * height, atol=1e-5)
    assert_allclose(energy.kinetic, 0.5 * 2.0 * 0.25 * result.v[:, 0] ** 2, rtol=1e-12)
    assert_allclose(energy.kinetic + energy.potential, 0.0, atol=1e-5)


@pytest.mark.slow
def test_work_of_a_constant_force_is_force_times_way() -> None:
    arm = manipulator()
    force = np.array([4.0, -2.0, 6.0, 0.0, 0.0, 0.0])
    result = rbi.simulate(
        rbi.baselines.PDGravity(arm, rbi.Impedance(1.0, 5.0, 20.0), 1e-3),
        arm,
        hold(arm),
        environment=force,
        duration=0.5,
        substeps=1,
        integrator="rk4",
    )
    places = np.array([arm.frame_placement(q)[1] for q in result.q])
    work = (places - places[0]) @ force[:3]
    assert work[-1] > 0.1
    assert_allclose(energy_balance(result, arm).environment, work, atol=1e-5 * work[-1])


@pytest.mark.slow
def test_friction_and_a_damped_wall_only_take() -> None:
    arm, q0 = manipulator(), np.full(6, 0.5)
    place = arm.frame_placement(q0)[1]
    wall = Wall(place - [0.0, 0.0, 0.01], [0, 0, 1], 2e3, 30.0)
    result = rbi.simulate(
        rbi.baselines.PDGravity(arm.with_gravity([0, 0, -4.0]), rbi.Impedance(1.0, 2.0, 5.0), 1e-3),
        arm,
        hold(arm, q0),
        environment=wall,
        q0=q0,
        duration=1.0,
        integrator="rk4",
    )
    energy = energy_balance(result, arm)
    assert (np.diff(energy.friction) >= 0.0).all()
    assert energy.friction[-1] > 0.01
    assert energy.environment[-1] < -1e-3
    # A wall at rest gives back at most what its spring holds, which is less than nothing gained.
    assert energy.environment.max() < 1e-6


def test_another_arm_than_the_plant_is_refused() -> None:
    arm = manipulator()
    with pytest.raises(rbi.ModelError, match="did not simulate"):
        energy_balance(pushed_swing(arm, 8e-3), arm.with_payload(1.0))
