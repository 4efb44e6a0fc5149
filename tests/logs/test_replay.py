"""Logs of simulated arms, and estimators along logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.exceptions import LogError
from rbimpedance.logs import Log
from rbimpedance.logs.arm_log import positions


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


@pytest.fixture(scope="module")
def result(arm: rbi.ArmModel) -> rbi.SimulationResult:
    """A run in which joint 2 is pushed by 3 N·m."""
    return rbi.simulate(
        rbi.ImpedanceController(arm),
        arm.copy(),
        rbi.trajectories.cosine(arm),
        environment=rbi.JointTorque([0.0, 3.0]),
        duration=0.6,
    )


def test_a_result_comes_back_from_mcap_as_the_arm_saw_it(
    tmp_path: Path, arm: rbi.ArmModel, result: rbi.SimulationResult
) -> None:
    log = Log.read(result.save_mcap(tmp_path / "run.mcap")).on(arm)
    np.testing.assert_allclose(log.t, result.t, rtol=0, atol=1e-9)
    for name in ("q", "v", "tau", "tau_ext"):
        assert np.array_equal(getattr(log, name), getattr(result, name)), name


def test_an_estimator_finds_in_a_log_the_torque_that_nobody_measured(
    arm: rbi.ArmModel, result: rbi.SimulationResult
) -> None:
    whole = result.log()
    assert whole.velocity is not None
    log = Log.from_arrays(
        whole.t,
        whole.position,
        joint_names=whole.joint_names,
        velocity=whole.velocity,
        effort=whole.effort,
    )
    found = rbi.replay_sensor(log.on(arm), rbi.MomentumObserver(arm, dt=1e-3))
    np.testing.assert_allclose(found[-1], [0.0, 3.0], atol=0.05)


def test_an_estimator_of_another_period_is_refused(
    arm: rbi.ArmModel, result: rbi.SimulationResult
) -> None:
    with pytest.raises(LogError, match=r"0.001 s apart.*give the sensor dt=0.001"):
        rbi.replay_sensor(result.log().on(arm), rbi.MomentumObserver(arm, dt=2e-3))


def test_a_log_without_torques_is_refused(arm: rbi.ArmModel, result: rbi.SimulationResult) -> None:
    log = Log.from_arrays(result.t, result.q, joint_names=result.joint_names).on(arm)
    with pytest.raises(LogError, match="no motor torques"):
        rbi.replay_sensor(log, rbi.MomentumObserver(arm, dt=1e-3))


def test_continuous_joints_count_their_turns_and_go_back_to_configurations() -> None:
    arm = rbi.load_robot("kinova")
    t = np.linspace(0.0, 2.0, 400)
    angles = np.outer(5.0 * t, np.ones(arm.nv)) * (arm.joint_limits()[0] == -np.inf)
    log = Log.from_arrays(t, angles, joint_names=arm.joint_names).on(arm)
    np.testing.assert_allclose(positions(arm, log.q), angles, atol=1e-12)
    expected = [arm.integrate(arm.zero, row) for row in angles]
    np.testing.assert_allclose(log.q, expected, atol=1e-12)
