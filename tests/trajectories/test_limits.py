"""Default trajectories stay inside the limits of every arm; others are refused, or allowed in so many words."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import rbimpedance as rbi
from rbimpedance import trajectories
from rbimpedance.exceptions import JointLimitError, VelocityLimitWarning

NAMES = ("panda", "ur5", "two_link", "kinova", "talos_arm")


@pytest.fixture(scope="module")
def panda() -> rbi.ArmModel:
    return rbi.load_robot("panda", armature=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_default_cosine_stays_inside_position_and_velocity_limits(name: str) -> None:
    arm = rbi.load_robot(name, armature=0.1)
    lower, upper = arm.joint_limits()
    motion = trajectories.cosine(arm)
    for t in np.linspace(0.0, 6.0, 61):
        q, v, _ = motion(t)
        x = arm.difference(arm.zero, q)
        assert (lower <= x).all()
        assert (x <= upper).all()
        assert (np.abs(v) <= arm.velocity_limit).all()
    assert np.abs(motion(0.0).q - motion(3.0).q).max() > 0.1  # it does move


@pytest.mark.parametrize("name", NAMES)
def test_default_hold_is_inside_the_limits(name: str) -> None:
    arm = rbi.load_robot(name, armature=0.1)
    lower, upper = arm.joint_limits()
    x = arm.difference(arm.zero, trajectories.hold(arm)(0.0).q)
    assert ((lower <= x) & (x <= upper)).all()


def test_motion_beyond_a_limit_is_refused_with_joint_value_and_limit(panda: rbi.ArmModel) -> None:
    with pytest.raises(JointLimitError) as caught:
        trajectories.cosine(panda, center=panda.neutral, amplitude=0.2 * (np.arange(8) == 3))
    error = caught.value
    assert error.joint == "panda_joint4"
    assert error.value == pytest.approx(0.2 - 0.0698)
    assert error.limits == pytest.approx((-3.0718, -0.0698))
    for words in ("panda_joint4", "0.1302", "-0.0698", "check_limits=False"):
        assert words in str(error)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_posture_and_waypoint_beyond_a_limit_are_refused(panda: rbi.ArmModel) -> None:
    zero = np.zeros(8)  # joint 4 is 0.07 rad beyond its limit
    with pytest.raises(JointLimitError, match=r"^q puts joint 'panda_joint4' at 0,"):
        trajectories.hold(panda, zero)
    with pytest.raises(JointLimitError, match=r"^configurations\[1\] puts joint 'panda_joint4'"):
        trajectories.waypoints(panda, [panda.ready, zero], [0.0, 9.0])
    with pytest.raises(JointLimitError, match=r"^the motion through the samples puts joint"):
        trajectories.samples(panda, [0.0, 9.0], [panda.ready, zero])


def test_what_lies_beyond_a_limit_can_be_allowed(panda: rbi.ArmModel) -> None:
    zero = np.zeros(8)
    assert_array_equal(trajectories.hold(panda, zero, check_limits=False)(0.0).q, zero)
    trajectories.cosine(panda, center=zero, amplitude=1.0, check_limits=False)
    trajectories.waypoints(panda, [panda.ready, zero], [0.0, 0.1], check_limits=False)
    trajectories.samples(panda, [0.0, 0.1], [panda.ready, zero], check_limits=False)


def test_overshoot_between_samples_is_refused(panda: rbi.ArmModel) -> None:
    """Every sample is inside; the cubic through them swings out before the third."""
    _, upper = panda.joint_limits()
    q = np.tile(panda.ready, (4, 1))
    q[:, 0] = upper[0] - np.array([1.0, 0.001, 0.001, 1.0])
    with pytest.raises(JointLimitError, match="panda_joint1"):
        trajectories.samples(panda, [0.0, 1.0, 2.0, 3.0], q)


def test_motion_faster_than_a_velocity_limit_is_said(panda: rbi.ArmModel) -> None:
    amplitude = 0.2 * (np.arange(8) == 4)
    words = r"cosine asks joint 'panda_joint5' for 4.189 .* limit is 2.61"
    with pytest.warns(VelocityLimitWarning, match=words):
        trajectories.cosine(panda, amplitude=amplitude, period=0.3)
    far = panda.integrate(panda.ready, amplitude)
    with pytest.warns(VelocityLimitWarning, match="waypoints asks joint 'panda_joint5'"):
        trajectories.waypoints(panda, [panda.ready, far], [0.0, 0.1])
    with pytest.warns(VelocityLimitWarning, match="samples asks joint 'panda_joint5'"):
        trajectories.samples(panda, [0.0, 0.1], [panda.ready, far])


def test_position_at_a_limit_is_inside(panda: rbi.ArmModel) -> None:
    _, upper = panda.joint_limits()
    trajectories.hold(panda, upper)
