"""Which mass matrices can be used."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.robot.loading.soundness import check_inertia, weak_directions

from .. import arms


def test_joint_without_inertia_is_weak() -> None:
    assert weak_directions(np.diag([1.0, 1e-12, 1e-3])).tolist() == [False, True, False]


def test_joints_that_share_one_inertia_are_weak() -> None:
    M = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    assert weak_directions(M).tolist() == [True, False, True]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e8])
def test_light_and_heavy_joints_side_by_side_are_not_weak(scale: float) -> None:
    assert not weak_directions(np.array([[1.0, 0.1], [0.1, 0.02]]) * scale).any()


def test_matrix_that_is_not_finite_is_weak_everywhere() -> None:
    assert weak_directions(np.array([[1.0, np.nan], [np.nan, 1.0]])).all()


def test_inertias_too_far_apart_for_floating_point_are_refused() -> None:
    arm = arms.spinner()
    check_inertia(arm.with_armature([1e9, 0.0, 0.0]))
    with pytest.raises(
        rbi.ModelError, match=r"what '(slide|tilt)' moves has less than 1/1e\+12 of"
    ):
        check_inertia(arm.with_armature([9e11, 0.0, 0.0]))
    with pytest.raises(
        rbi.ModelError, match=r"what 'spin' moves has the inertia 1e\+13: give masses in"
    ):
        check_inertia(arm.with_armature([1e13, 0.0, 0.0]))


def test_sound_arm_passes_and_the_same_without_mass_does_not() -> None:
    arm = arms.spinner().with_armature(0.0)
    check_inertia(arm)
    with pytest.raises(rbi.UnsupportedJointError, match="no usable inertia") as caught:
        check_inertia(arm.with_scaled_inertia(1e-12))
    assert caught.value.joints == arm.joint_names
    assert "lock=" not in str(caught.value)  # nothing would be left to move
    check_inertia(arm.with_scaled_inertia(1e-12).with_armature(0.1))
