"""Sensors between the environment and the controller, against their transfer functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.interaction import Chain, Delay, JointTorque, LowPass, Perfect, Sensor
from rbimpedance.simulation.replay import replay_sensor
from rbimpedance.trajectories import hold

from .. import laws

Array = NDArray[np.float64]
DT = 1e-3


def tell(sensor: Sensor[Any], truth: Array) -> Array:
    """What the sensor tells of a sequence of torques, shape (N, nv)."""
    state, none, told = sensor.init(), np.zeros(2), []
    for tau_ext in truth:
        answer, state = sensor.step(state, none, none, none, tau_ext)
        told.append(answer)
    return np.array(told)


def test_perfect_sensor_tells_the_truth(rng: np.random.Generator) -> None:
    truth = rng.normal(size=(5, 2))
    assert_array_equal(tell(Perfect(), truth), truth)


@pytest.mark.parametrize("ticks", [0, 1, 3])
def test_delay_tells_what_was_true_and_before_the_start_the_first(
    ticks: int, rng: np.random.Generator
) -> None:
    truth = rng.normal(size=(8, 2))
    expected = np.vstack([np.repeat(truth[:1], ticks, axis=0), truth])[:8]
    assert_array_equal(tell(Delay(ticks), truth), expected)


@pytest.mark.parametrize("frequency", [1.0, 20.0, 60.0])
def test_low_pass_turns_a_sine_by_its_phase_loss(frequency: float) -> None:
    sensor = LowPass(20.0, DT)
    t = DT * np.arange(3000)
    wave = np.exp(2j * np.pi * frequency * t)
    told = tell(sensor, np.column_stack([wave.real, wave.imag]))
    answer = (told[-1, 0] + 1j * told[-1, 1]) / wave[-1]
    assert answer == pytest.approx(complex(sensor.response(frequency)), rel=1e-9)
    assert -np.angle(answer) == pytest.approx(float(sensor.phase_loss(frequency)), rel=1e-9)


def test_low_pass_is_the_continuous_one_as_the_period_shrinks() -> None:
    lost = [float(LowPass(20.0, dt).phase_loss(20.0)) for dt in (1e-3, 1e-4, 1e-5)]
    assert lost[-1] == pytest.approx(np.pi / 4.0, rel=1e-3)
    assert abs(lost[2] - np.pi / 4.0) < abs(lost[0] - np.pi / 4.0)


def test_low_pass_follows_a_ramp_late_by_its_delay() -> None:
    sensor, t = LowPass(20.0, DT), DT * np.arange(2000)
    told = tell(sensor, np.column_stack([3.0 * t, -t]))
    assert_allclose(told[-1], np.array([3.0, -1.0]) * (t[-1] - sensor.delay), rtol=1e-9)
    assert sensor.delay == pytest.approx(1.0 / (2.0 * np.pi * 20.0), rel=0.1)


def test_low_pass_starts_settled() -> None:
    assert_array_equal(tell(LowPass(5.0, DT), np.ones((4, 2))), np.ones((4, 2)))


def test_chain_is_one_sensor_after_the_other(rng: np.random.Generator) -> None:
    truth = rng.normal(size=(20, 2))
    expected = tell(LowPass(30.0, DT), tell(Delay(2), truth))
    assert_array_equal(tell(Chain(Delay(2), LowPass(30.0, DT)), truth), expected)


def step_torque(t: float) -> list[float]:
    return [2.0, -1.0] if t > 0.05 else [0.0, 0.0]


def simulate(sensor: Sensor[Any] | None) -> rbi.SimulationResult:
    arm = rbi.load_robot("two_link")
    return rbi.simulate(
        laws.controller(arm, dt=DT),
        arm,
        hold(arm),
        environment=JointTorque(step_torque),
        sensor=sensor,
        duration=0.2,
    )


def test_perfect_sensor_changes_nothing_in_a_run() -> None:
    bare, perfect = simulate(None), simulate(Perfect())
    for name in ("q", "v", "tau", "tau_ext", "s"):
        assert_array_equal(getattr(bare, name), getattr(perfect, name))


def test_controller_acts_on_what_the_sensor_tells_and_the_log_keeps_the_truth() -> None:
    result = simulate(Delay(7))
    assert_array_equal(result.tau_ext, [step_torque(t) for t in result.t])
    told = replay_sensor(result, Delay(7))
    assert_array_equal(told[7:], result.tau_ext[:-7])
    # The impedance filter, run on what was told, gives the q_r of the run.
    target = rbi.Impedance(1.0, 10.0, 20.0).filter(2, DT)
    q_e, v_e = np.zeros(2), np.zeros(2)
    for q_r, torque in zip(result.q_r, told, strict=True):
        assert_allclose(q_r, q_e, rtol=0.0, atol=1e-13)
        q_e, v_e = target.advance(q_e, v_e, torque)
    assert np.abs(q_e).max() > 1e-3


def test_run_says_which_sensor_it_had() -> None:
    assert simulate(Delay(7)).provenance["sensor"] == {"type": "Delay", "ticks": 7}
    assert simulate(None).provenance["sensor"] == {"type": "Perfect"}
    chain = simulate(Chain(Delay(1), LowPass(50.0, DT))).provenance["sensor"]
    assert chain == "Chain(Delay(ticks=1), LowPass(cutoff=50.0, dt=0.001))"


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Delay(-1), r"^ticks must be"),
        (lambda: Delay(1.5), r"^ticks must be"),  # type: ignore[arg-type]
        (lambda: Delay(True), r"^ticks must be"),
        (lambda: LowPass(0.0, DT), r"^cutoff must be"),
        (lambda: LowPass(1.0, -DT), r"^dt must be"),
    ],
)
def test_unusable_sensor_is_refused(build: Callable[[], object], words: str) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        build()
