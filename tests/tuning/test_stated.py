"""What a proposal states of the closed loop, against runs of plants that it has not seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.simulation import simulate_batch
from rbimpedance.trajectories.reference import difference_each

UNKNOWN: dict[str, dict[str, Any]] = {
    "torque constants": {"payload": 0.5, "torque_constant": 0.1},
    "dry friction that reverses": {"payload": 0.5, "coulomb": 0.3, "viscous": 0.5},
    "delay and noise": {"payload": 0.5, "delay": 1, "position_noise": 1e-5, "velocity_noise": 1e-4},
}


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("asr_twodof")


@pytest.mark.parametrize("name", UNKNOWN)
def test_unseen_plants_stay_within_what_is_stated(arm: rbi.ArmModel, name: str) -> None:
    """Corners of the ranges, joint by joint, from both sides of the motion."""
    motion = rbi.trajectories.cosine(arm, center=arm.ready, amplitude=0.1, period=2.0)
    unknown, on_motion = rbi.Uncertainty(**UNKNOWN[name]), np.asarray(motion(0.0).q)
    start: dict[str, Any] = {"q0": on_motion + 0.1, "duration": 2.5}
    proposal = rbi.propose_gains(arm, unknown, motion, 1e-3, remedy_time=0.0, **start)
    assert proposal.feasible
    law, samples = proposal.controller(), unknown.corners(arm, 8, seed=99)
    for q0 in (on_motion + 0.1, on_motion - 0.1):
        runs = simulate_batch(
            [sample.wrap(law) for sample in samples],
            [sample.plant for sample in samples],
            motion,
            q0=q0,
            duration=2.5,
            channels=("q", "q_r", "s", "tau"),
            metrics=False,
        )
        for q, q_r, s, tau in zip(*(runs.channels.values()), strict=True):
            error = np.abs(difference_each(arm, q, q_r))
            assert (error.max(axis=0) <= proposal.peak).all()
            assert (np.abs(tau).max(axis=0) <= proposal.peak_torque).all()
            settled = runs.t[:, None] > proposal.total_time
            assert settled.any()
            assert (error <= proposal.error)[settled].all()
            assert (np.abs(s) <= proposal.s_error)[runs.t[:, None] > proposal.reaching_time].all()
        assert not runs.diverged.any()


def test_stated_error_is_of_the_size_of_the_worst_one(arm: rbi.ArmModel) -> None:
    """Not more than five times: an error that is stated too large refuses nothing but says nothing."""
    motion = rbi.trajectories.cosine(arm, center=arm.ready, amplitude=0.1, period=2.0)
    proposal = rbi.propose_gains(arm, rbi.Uncertainty(payload=0.5), motion, 1e-3, duration=2.5)
    late = np.max([case.error for case in proposal.worst], axis=0)
    assert (late < proposal.error).all()
    assert (proposal.error < 5.0 * late).all()


def test_explanation_says_for_how_long_the_motion_was_checked(arm: rbi.ArmModel) -> None:
    motion = rbi.trajectories.cosine(arm, center=arm.ready, amplitude=0.1, period=2.0)
    proposal = rbi.propose_gains(arm, rbi.Uncertainty(payload=0.5), motion, 1e-3, duration=2.5)
    assert proposal.duration == 2.5
    assert "over the first 2.5 s of the motion" in proposal.explain()


def test_plants_at_and_near_a_point_of_the_ranges_are_within_them(arm: rbi.ArmModel) -> None:
    corners = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.2]]
    unknown = rbi.Uncertainty(
        (0.2, 1.0), 1.2, coulomb=0.3, payload_com=corners, torque_constant=0.1, gravity_tilt=0.1
    )
    size = unknown.dimension(arm)
    low, high = unknown.at(arm, np.zeros(size)), unknown.at(arm, np.ones(size))
    assert (low.payload, high.payload) == (0.2, 1.0)
    np.testing.assert_allclose(low.torque_constant, 0.9)
    np.testing.assert_allclose(high.com, corners[1])
    np.testing.assert_allclose(high.coulomb, 0.3)
    near = unknown.near(arm, high, 30, seed=1)
    assert all(unknown.outside(sample) == () for sample in (low, high, *near))
    changed = [sample.payload != high.payload for sample in near]
    assert any(changed)
    assert not all(changed)
