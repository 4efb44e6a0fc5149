"""Configurations for poses, and the kinematics of a frame against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.robot.tool_kinematics import ToolKinematics, rotation_error
from rbimpedance.trajectories.limits import joint_positions

from ..arms import follower, manipulator, spinner


@pytest.fixture(scope="module")
def ur5() -> rbi.ArmModel:
    return rbi.load_robot("ur5")


def test_configuration_has_the_pose_and_is_within_the_limits(
    ur5: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(3):
        pose = rbi.Pose(*ur5.frame_placement(ur5.random_configuration(rng)))
        q = rbi.inverse_kinematics(ur5, pose)
        rotation, translation = ur5.frame_placement(q)
        assert_allclose(rotation, pose.rotation, atol=1e-7)
        assert_allclose(translation, pose.translation, atol=1e-7)
        lower, upper = ur5.joint_limits()
        assert ((lower <= joint_positions(ur5, q)) & (joint_positions(ur5, q) <= upper)).all()


def test_continuous_joints_are_found_too(rng: np.random.Generator) -> None:
    arm = spinner()
    q = arm.random_configuration(rng)
    pose = rbi.Pose(*arm.frame_placement(q))
    found = rbi.inverse_kinematics(arm, pose, arm.integrate(q, [0.3, -0.05, 0.2]))
    assert_allclose(arm.frame_placement(found)[1], pose.translation, atol=1e-7)


def test_a_pose_out_of_reach_is_refused_with_its_distance(ur5: rbi.ArmModel) -> None:
    with pytest.raises(
        rbi.ParameterError, match=r"within reach of 'ur5', whose nearest posture is"
    ):
        rbi.inverse_kinematics(ur5, rbi.Pose(np.eye(3), np.array([2.0, 0.0, 0.0])))


@pytest.mark.parametrize("make", [manipulator, spinner])
def test_motion_of_the_tool_is_that_of_finite_differences(
    make: object, rng: np.random.Generator
) -> None:
    arm: rbi.ArmModel = make()  # type: ignore[operator]
    kinematics, h = ToolKinematics(arm), 1e-6
    q, v = arm.random_configuration(rng), rng.normal(size=arm.nv)
    before, now, after = (kinematics.motion(arm.integrate(q, step * v), v) for step in (-h, 0.0, h))
    assert_allclose(now.v[:3], (after.translation - before.translation) / (2.0 * h), atol=1e-8)
    turned = rotation_error(after.rotation, before.rotation)
    assert_allclose(now.v[3:], turned / (2.0 * h), atol=1e-8)
    assert_allclose(now.drift, (after.v - before.v) / (2.0 * h), atol=1e-7)
    rate = (after.jacobian - before.jacobian) / (2.0 * h)
    assert_allclose(kinematics.jacobian_rate(q, v), rate, atol=1e-8)
    assert_allclose(now.jacobian, arm.jacobian(q), atol=1e-14)


def test_rotation_error_is_exact_near_half_a_turn() -> None:
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 (the oracle)

    axis = np.array([0.36, -0.48, 0.8])
    for angle in (1e-9, 1e-4, 3.0, np.pi - 1e-4, np.pi - 1e-7):
        target = Rotation.from_rotvec(angle * axis).as_matrix()
        assert_allclose(rotation_error(target, np.eye(3)), angle * axis, atol=2e-7)


def test_arms_with_mimicking_joints_and_unknown_frames_are_refused() -> None:
    with pytest.raises(rbi.UnsupportedJointError, match="lock"):
        ToolKinematics(follower())
    with pytest.raises(rbi.ModelError, match="no frame 'tol'"):
        ToolKinematics(spinner(), "tol")
