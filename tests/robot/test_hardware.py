"""One description of drives and sensors, and what is made from it."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.simulation.plants.sticking import StickingPlant

from ..arms import manipulator, spinner


def test_everything_is_perfect_by_default() -> None:
    hardware = rbi.Hardware()
    assert hardware.is_perfect
    assert not rbi.Hardware(delay=1).is_perfect
    assert not rbi.Hardware(joint_stiffness=1e4).is_perfect


def test_counts_are_finer_behind_a_gear_and_not_on_the_link() -> None:
    arm = spinner()
    motor = rbi.Hardware(encoder_bits=17, gear_ratio=[100.0, 50.0, 1.0])
    assert motor.count(arm) == pytest.approx(2.0 * np.pi / 2**17 / np.array([100.0, 50.0, 1.0]))
    link = motor.but(encoder_side="link")
    assert link.count(arm) == pytest.approx(2.0 * np.pi / 2**17)
    assert link.noise_bound(arm) == pytest.approx(np.pi / 2**17)
    assert not rbi.Hardware().count(arm).any()


def test_delay_bound_counts_lag_delay_and_half_a_period() -> None:
    arm, hardware = spinner(), rbi.Hardware(torque_lag=2e-3, delay=3)
    assert hardware.delay_bound(arm, 1e-3) == pytest.approx(5.5e-3)


def test_plant_and_encoders_are_made_from_it() -> None:
    arm = spinner().with_friction(0.1, 0.2)
    hardware = rbi.Hardware(
        encoder_bits=18, torque_lag=2e-3, delay=2, ripple=0.02, stribeck=0.3, ripple_periods=60
    )
    plant = rbi.DrivenPlant.for_(hardware, arm, dt=2e-3)
    assert plant.time_constant == pytest.approx(2e-3)
    assert plant.dead_time == pytest.approx(4e-3)
    assert isinstance(plant.links, StickingPlant)
    assert plant.links.stribeck == 0.3
    assert np.array_equal(plant.ripple_periods, np.full(arm.nv, 60.0))
    encoders = rbi.QuantizedEncoders.for_(hardware, rbi.ImpedanceController(manipulator()))
    assert encoders.resolution == pytest.approx(2.0 * np.pi / 2**18)
    with pytest.raises(rbi.ParameterError, match="encoder_bits"):
        rbi.QuantizedEncoders.for_(rbi.Hardware(), rbi.ImpedanceController(manipulator()))


def test_named_entries_take_figures_of_ones_own() -> None:
    hardware = rbi.Hardware.of("panda", encoder_bits=20)
    assert hardware.delay == 1
    assert hardware.torque_rate == 1000.0
    assert hardware.encoder_bits == 20
    with pytest.raises(rbi.ParameterError, match='"panda" or "fr3"'):
        rbi.Hardware.of("toaster")


@pytest.mark.parametrize(
    "wrong",
    [
        {"encoder_bits": -1},
        {"encoder_side": "tool"},
        {"torque_lag": -1e-3},
        {"delay": 1.5},
        {"delay": -1},
        {"joint_stiffness": 0.0},
        {"stribeck": -0.1},
        {"ripple_periods": 2.5},
        {"torque_rate": -1.0},
        {"torque_bandwidth": np.inf},
    ],
)
def test_numbers_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(rbi.ParameterError, match=next(iter(wrong))):
        rbi.Hardware(**wrong)  # type: ignore[arg-type]


def test_numbers_for_another_arm_are_refused() -> None:
    with pytest.raises(rbi.DimensionError):
        rbi.Hardware(encoder_bits=[17, 18]).count(spinner())
