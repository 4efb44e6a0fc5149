"""`simulate_batch` on hardware: world by world what `simulate` does on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance._numba import warn_once
from rbimpedance.simulation.closed_loop import LOGGED

from .. import arms

CHANNELS = tuple(LOGGED)
COUNTED = rbi.Hardware(encoder_bits=19, torque_lag=2e-3, delay=1, ripple=0.03, stribeck=0.2)


def law(arm: rbi.ArmModel, hardware: rbi.Hardware = COUNTED) -> rbi.HardwareController:
    return rbi.HardwareController(arm, hardware, bandwidths=(20.0, 60.0))


def worlds(arm: rbi.ArmModel) -> dict[str, list[Any]]:
    """Worlds that differ in everything: two compiled ones on hardware, one in Python on it, and one without."""
    slow = COUNTED.but(delay=3, encoder_bits=17, ripple=0.0)
    usual = rbi.baselines.PIDImpedance(arm, rbi.Impedance(1.0, 10.0, 20.0), 20.0, 1e-3)
    plain = rbi.ImpedanceController(arm)
    rubbing = arm.with_friction(0.1, 0.5)
    return {
        "controller": [law(arm), law(arm, slow), usual, plain],
        "plant": [rubbing.with_payload(0.2), rubbing, arm, arm.with_payload(0.1)],
        "trajectory": [
            rbi.trajectories.cosine(arm, amplitude=0.1 * i, period=0.5) for i in range(1, 5)
        ],
        "environment": [None, rbi.JointTorque(np.ones(arm.nv)), np.ones(6), None],
        "hardware": [COUNTED, slow, COUNTED, None],
        "v0": [0.1 * i * np.ones(arm.nv) for i in range(4)],
    }


@pytest.mark.parametrize("threads", [1, 2])
def test_batch_on_hardware_is_simulate_world_by_world(threads: int) -> None:
    arm = arms.manipulator().with_armature(0.1)
    given: Any = worlds(arm)
    batch = rbi.simulate_batch(
        **given, duration=0.1, channels=CHANNELS, every=3, after=0.02, threads=threads
    )
    for i in range(4):
        alone = rbi.simulate(**{name: each[i] for name, each in given.items()}, duration=0.1)
        for name in CHANNELS:
            expected = getattr(alone, name)[::3]
            assert_allclose(batch[name][i], expected, rtol=1e-12, atol=1e-12, err_msg=name)
        for name, figure in batch.metrics.items():
            wanted = alone.metrics(after=0.02)[name]
            assert_allclose(figure[i], wanted, rtol=1e-9, atol=1e-12, err_msg=name)
        assert_allclose(batch.q[i], alone.q[-1], rtol=1e-12, atol=1e-12)
    assert not batch.diverged.any()


def test_hardware_is_shared_by_all_worlds_where_it_is_one() -> None:
    arm = arms.manipulator().with_armature(0.1)
    plants = [arm.with_payload(0.1 * i) for i in range(3)]
    given: Any = law(arm), plants, rbi.trajectories.cosine(arm, amplitude=0.2, period=0.5)
    batch = rbi.simulate_batch(*given, hardware=COUNTED, duration=0.05, channels=("tau",))
    for i, plant in enumerate(plants):
        alone = rbi.simulate(given[0], plant, given[2], hardware=COUNTED, duration=0.05)
        assert_allclose(batch["tau"][i], alone.tau, rtol=1e-12, atol=1e-12)
    assert np.ptp(batch["tau"], axis=0).max() > 1e-3  # and the worlds differ


def test_world_on_hardware_that_diverges_is_marked_and_the_others_go_on() -> None:
    arm = arms.manipulator().with_armature(0.1)
    pushes = [rbi.JointTorque(np.full(arm.nv, size)) for size in (0.0, 1e9, 0.0)]
    batch = rbi.simulate_batch(
        law(arm), arm, rbi.trajectories.hold(arm), environment=pushes, hardware=COUNTED,
        duration=0.05, channels=("v",),
    )  # fmt: skip
    assert batch.diverged.tolist() == [False, True, False]
    assert batch.divergence_joint[1] in arm.joint_names
    assert np.isnan(batch["v"][1, -1]).all()
    assert np.isfinite(batch["v"][[0, 2]]).all()
    assert np.isnan(batch.metrics["e1_max"][1]).all()


def test_only_what_has_no_compiled_form_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    warn_once.cache_clear()
    arm = arms.manipulator().with_armature(0.1)
    given: Any = arm, rbi.trajectories.hold(arm)
    rbi.simulate_batch(law(arm), *given, hardware=COUNTED, duration=0.01)
    assert "left to Python" not in caplog.text
    rbi.simulate_batch(rbi.ImpedanceController(arm), *given, hardware=COUNTED, duration=0.01)
    assert caplog.text.count("left to Python") == 1


def test_hardware_of_another_number_of_worlds_is_refused() -> None:
    arm = arms.manipulator()
    given: Any = [law(arm)] * 3, arm, rbi.trajectories.hold(arm)
    with pytest.raises(rbi.DimensionError, match="hardware"):
        rbi.simulate_batch(*given, hardware=[COUNTED, COUNTED], duration=0.01)
