"""The wrist sensor, against the weight of a tool written out and against what acts on the arm."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.interaction import FrameWrench, LowPass, Sum, WrenchSensor, calibrate_tool

from ..arms import manipulator, spinner

Array = NDArray[np.float64]
BIAS = np.array([1.0, -2.0, 0.5, 0.1, 0.2, -0.3])
COM = np.array([0.02, -0.01, 0.08])
WRENCH = np.array([4.0, 1.0, -6.0, 0.3, -0.2, 0.5])


def test_unloaded_sensor_reads_bias_and_the_weight_of_its_tool(rng: np.random.Generator) -> None:
    arm = manipulator()
    q = arm.random_configuration(rng)
    sensor = WrenchSensor(arm, tool_mass=1.3, tool_com=COM, bias=BIAS)
    rotation, _ = arm.frame_placement(q)
    weight = rotation.T @ np.array([0.0, 0.0, -1.3 * 9.81])
    expected = np.concatenate([weight, np.cross(COM, weight)]) + BIAS
    assert_allclose(sensor.reading(q, np.zeros(6)), expected, rtol=1e-12, atol=1e-12)


def test_tools_weight_is_the_torque_that_a_payload_adds(rng: np.random.Generator) -> None:
    arm = manipulator()
    q, rest = arm.random_configuration(rng), np.zeros(6)
    weight = WrenchSensor(arm, tool_mass=1.3, tool_com=COM).weight(q)
    added = arm.with_payload(1.3, COM).bias(q, rest) - arm.bias(q, rest)
    assert_allclose(arm.external_torque(q, weight, None, "local"), -added, rtol=1e-9, atol=1e-12)


def test_processed_reading_is_the_contacts_torque(rng: np.random.Generator) -> None:
    arm = spinner()
    q = arm.random_configuration(rng)
    sensor = WrenchSensor(arm, tool_mass=1.3, tool_com=COM, bias=BIAS)
    torque, _ = sensor.torque(None, q, sensor.reading(q, WRENCH))
    assert_allclose(torque, arm.external_torque(q, WRENCH), rtol=1e-12, atol=1e-12)


def test_wrong_bias_passes_for_contact(rng: np.random.Generator) -> None:
    arm = manipulator()
    q = arm.random_configuration(rng)
    hardware = WrenchSensor(arm, bias=BIAS)
    torque, _ = WrenchSensor(arm).torque(None, q, hardware.reading(q, np.zeros(6)))
    assert_allclose(torque, arm.external_torque(q, BIAS, None, "local"), rtol=1e-12, atol=1e-12)


def test_low_pass_of_the_sensor_settles_at_its_rate() -> None:
    arm, q = manipulator(), np.full(6, 0.4)
    sensor = WrenchSensor(arm, low_pass=LowPass(20.0, 1e-3))
    _, state = sensor.torque(None, q, np.zeros(6))
    for _ in range(10):
        torque, state = sensor.torque(state, q, BIAS)
    share = 1.0 - np.exp(-2.0 * np.pi * 20.0 * 10e-3)
    assert_allclose(torque, share * arm.external_torque(q, BIAS, None, "local"), rtol=1e-10)


def test_mounted_sensor_feels_what_acts_beyond_it_and_nothing_else() -> None:
    arm, dt = manipulator(), 2e-3
    q = np.full(6, 0.4)
    near = FrameWrench([0.0, 5.0, 0.0, 0.0, 0.0, 0.0], "wrist1_body")
    beyond = FrameWrench(lambda t: t * WRENCH, "effector_body")
    sensor = WrenchSensor(arm, "wrist2_body", tool_mass=0.7, tool_com=COM, bias=BIAS)
    mounted = sensor.mounted(beyond, dt, believed=sensor)
    state, v = mounted.init(), np.zeros(6)
    for k in range(5):
        truth = Sum(near, beyond).torque(arm, k * dt, q, v)
        told, state = mounted.step(state, q, v, v, truth)
        # A wrench beyond the sensor, seen from it, does the same work on the joints before it.
        expected = beyond.torque(arm, k * dt, q, v)
        assert_allclose(told[:5], expected[:5], rtol=1e-10, atol=1e-12)
    assert np.abs(expected).max() > 1e-3


def test_calibration_finds_mass_centre_and_bias(rng: np.random.Generator) -> None:
    arm = manipulator()
    sensor = WrenchSensor(arm, tool_mass=1.3, tool_com=COM, bias=BIAS)
    poses = [arm.random_configuration(rng) for _ in range(5)]
    readings = [sensor.reading(q, np.zeros(6)) for q in poses]
    found = calibrate_tool(arm, poses, readings)
    assert found.mass == pytest.approx(1.3, rel=1e-10)
    assert_allclose(found.com, COM, rtol=1e-9)
    assert_allclose(found.bias, BIAS, rtol=1e-9)
    assert_allclose(found.residual, 0.0, atol=1e-12)


def test_poses_that_do_not_tell_bias_from_weight_are_refused() -> None:
    arm = manipulator()
    poses = np.tile(np.full(6, 0.4), (4, 1))
    with pytest.raises(rbi.ParameterError, match=r"^configurations must be poses in which gravity"):
        calibrate_tool(arm, poses, np.ones((4, 6)))
    with pytest.raises(rbi.DimensionError, match=r"^readings must be shape \(4, 6\)"):
        calibrate_tool(arm, poses, np.ones((3, 6)))


def test_unusable_sensor_is_refused() -> None:
    arm = manipulator()
    with pytest.raises(rbi.ParameterError, match=r"^tool_mass must be"):
        WrenchSensor(arm, tool_mass=-1.0)
    with pytest.raises(rbi.ModelError, match="no frame 'wrist'"):
        WrenchSensor(arm, "wrist")
    with pytest.raises(rbi.DimensionError, match=r"^bias must be"):
        WrenchSensor(arm, bias=[0.0])
    with pytest.raises(rbi.DimensionError, match=r"^reading must be"):
        WrenchSensor(arm).torque(None, np.zeros(6), np.zeros(5))
