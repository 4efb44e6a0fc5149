"""Any controller on an observer: quiet where differences are loud, and as good where sensing is perfect."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi

from ..arms import manipulator

TARGET = rbi.Impedance(1.0, 10.0, 20.0)


def test_pid_on_an_observer_is_quieter_than_on_differences() -> None:
    arm = manipulator().with_armature(0.1)
    hardware = rbi.Hardware(encoder_bits=17, torque_lag=2e-3, delay=1)
    law = rbi.baselines.PIDImpedance(arm, TARGET, 20.0, 1e-3)
    motion = rbi.trajectories.cosine(arm, amplitude=0.1, period=4.0)
    rough = []
    for each in (law, rbi.ObservedController(law, hardware, 60.0)):
        result = rbi.simulate(each, arm, motion, hardware=hardware, duration=0.6)
        rough.append(np.abs(np.diff(result.tau[200:], axis=0)).sum())
        assert np.abs(result.v).max() < 3.0
    assert rough[0] > 5.0 * rough[1]


def test_observed_controller_logs_the_reference_of_its_own_tick() -> None:
    arm = manipulator()
    hardware = rbi.Hardware(delay=5)
    law = rbi.ObservedController(
        rbi.baselines.PIDImpedance(arm, TARGET, 20.0, 1e-3), hardware, 100.0
    )
    v = np.full(arm.nv, 0.3)
    output, state = law.step(
        law.init(), arm.neutral, v, rbi.Reference(arm.neutral, v, 0.0 * v), 0.0 * v
    )
    assert output.q_r == pytest.approx(arm.neutral, abs=1e-12)
    assert state.ticks == 1
