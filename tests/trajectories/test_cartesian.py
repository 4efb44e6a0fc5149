"""Motions of a frame: their rates by finite differences, where they pass and where they rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.trajectories import cartesian

from ..arms import manipulator

Array = NDArray[np.float64]
TIMES = [0.5, 1.0, 2.2, 3.0]
START = rbi.Pose(Rotation.from_rotvec([0.2, 0.4, -1.0]).as_matrix(), np.array([0.4, -0.1, 0.5]))


def poses(rng: np.random.Generator) -> list[rbi.Pose]:
    turns = Rotation.from_rotvec(0.5 * rng.normal(size=(len(TIMES), 3))).as_matrix()
    return [rbi.Pose(R, p) for R, p in zip(turns, rng.normal(size=(len(TIMES), 3)), strict=True)]


def motions(rng: np.random.Generator) -> dict[str, cartesian.CartesianTrajectory]:
    knots = poses(rng)
    quaternions = [Rotation.from_matrix(pose.rotation).as_quat() for pose in knots]
    return {
        "hold": cartesian.hold(START),
        "line": cartesian.line(START, [0.1, 0.2, -0.1], 1.5, rotation=[1.0, 0.2, 0.4], begin=0.3),
        "circle": cartesian.circle(
            START, 0.1, 4.0, normal=[1.0, 0.0, 1.0], towards=[0.0, 0.0, 1.0]
        ),
        "waypoints": cartesian.waypoints(knots, TIMES),
        "samples": cartesian.samples(TIMES, [pose.translation for pose in knots], quaternions),
    }


@pytest.mark.parametrize("name", ["hold", "line", "circle", "waypoints", "samples"])
def test_velocity_and_acceleration_are_derivatives_of_the_pose(
    name: str, rng: np.random.Generator
) -> None:
    motion, h = motions(rng)[name], 1e-5
    for t in np.linspace(-0.2, 3.4, 41) + 0.0123:
        before, now, after = motion(t - h), motion(t), motion(t + h)
        turn = Rotation.from_matrix(after.pose.rotation @ before.pose.rotation.T).as_rotvec()
        moved = after.pose.translation - before.pose.translation
        assert_allclose(now.v, np.r_[moved, turn] / (2.0 * h), atol=1e-7)
        assert_allclose(now.a, (after.v - before.v) / (2.0 * h), atol=1e-6)


@pytest.mark.parametrize("name", ["line", "circle", "waypoints", "samples"])
def test_velocity_and_acceleration_do_not_jump(name: str, rng: np.random.Generator) -> None:
    motion = motions(rng)[name]
    for t in (0.0, 0.3, 0.5, 1.0, 1.8, 2.0, 2.2, 3.0):
        before, after = motion(t - 1e-9), motion(t + 1e-9)
        assert_allclose(before.v, after.v, atol=1e-6)
        assert_allclose(before.a, after.a, atol=1e-5)


@pytest.mark.parametrize("name", ["waypoints", "samples"])
def test_spline_passes_through_its_poses_without_a_stop(
    name: str, rng: np.random.Generator
) -> None:
    seed = int(rng.integers(1000))
    knots = poses(np.random.default_rng(seed))
    motion = motions(np.random.default_rng(seed))[name]
    for t, pose in zip(TIMES, knots, strict=True):
        assert_allclose(motion(t).pose.rotation, pose.rotation, atol=1e-9)
        assert_allclose(motion(t).pose.translation, pose.translation, atol=1e-12)
    speeds = [np.abs(motion(t).v).min() for t in TIMES]
    assert speeds[0] == speeds[-1] == 0.0
    assert min(speeds[1:-1]) > 1e-3
    for t in (-1.0, 4.0):
        assert not motion(t).v.any()
        assert not motion(t).a.any()


def test_line_is_straight_and_turns_about_one_axis() -> None:
    turn = np.array([1.0, 0.2, 0.4])
    motion = cartesian.line(START, [0.1, 0.2, -0.1], 2.0, rotation=turn)
    way = motion(1.0).pose.translation - START.translation
    assert_allclose(way, [0.05, 0.1, -0.05], atol=1e-12)
    half = Rotation.from_rotvec(turn / 2.0).as_matrix() @ START.rotation
    assert_allclose(motion(1.0).pose.rotation, half, atol=1e-9)
    assert_allclose(motion(1.0).v[:3], 15.0 / 8.0 * np.array([0.1, 0.2, -0.1]) / 2.0, rtol=1e-9)


def test_circle_keeps_its_distance_from_the_centre_and_its_period() -> None:
    motion = cartesian.circle(START, 0.1, 4.0, normal=[0.0, 1.0, 1.0], towards=[1.0, 0.0, 0.0])
    centre = START.translation + np.array([0.1, 0.0, 0.0])
    for t in np.linspace(0.0, 8.0, 30):
        assert_allclose(np.linalg.norm(motion(t).pose.translation - centre), 0.1, rtol=1e-12)
    assert_allclose(motion(0.0).pose.translation, START.translation, atol=1e-15)
    assert_allclose(motion(3.0).pose.translation, motion(7.0).pose.translation, atol=1e-12)


def test_hold_takes_an_arm_or_a_pose() -> None:
    arm = manipulator()
    assert_allclose(
        cartesian.hold(arm)(3.0).pose.translation, arm.frame_placement(arm.ready)[1], atol=1e-15
    )
    assert_allclose(cartesian.hold(START)(3.0).pose.rotation, START.rotation)


BAD: list[tuple[Any, str]] = [
    (lambda: cartesian.waypoints([START], [0.0]), "two poses"),
    (lambda: cartesian.waypoints([START, START], [1.0, 1.0]), "increasing"),
    (lambda: cartesian.line(START, [1.0, 0.0, 0.0], 0.0), "positive"),
    (lambda: cartesian.line(START, [1.0, 0.0, 0.0], 1.0, rotation=[4.0, 0.0, 0.0]), "shorter"),
    (lambda: cartesian.circle(START, 0.1, 4.0, towards=[0.0, 0.0, 1.0]), "not along the normal"),
    (lambda: cartesian.samples([0.0, 1.0], np.zeros((2, 3)), np.zeros((2, 4))), "unit length"),
    (lambda: cartesian.hold(rbi.Pose(np.zeros((3, 3)), np.zeros(3))), "rotation matrix"),
    (lambda: cartesian.hold(rbi.Pose(np.eye(3), np.full(3, np.nan))), "translation"),
]


@pytest.mark.parametrize(("make", "words"), BAD, ids=[words for _, words in BAD])
def test_refusals_say_what_would_be_right(make: Any, words: str) -> None:
    with pytest.raises(rbi.RBImpedanceError, match=words):
        make()
