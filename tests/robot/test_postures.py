"""`ArmModel.ready` lies well inside the limits, and is the posture that the description offers."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from example_robot_data import load
from numpy.testing import assert_allclose

import rbimpedance as rbi

from ..arms import LIMIT, mimic_urdf, spinner_urdf, urdf, urdf_joint, urdf_link

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
SRDF = """<robot name="arm"><group_state name="{}" group="arm"><joint name="spin" value="0.5"/>
<joint name="slide" value="{}"/><joint name="tilt" value="0.4"/></group_state>{}</robot>"""


def room(arm: rbi.ArmModel) -> float:
    """Distance of `ready` from the nearest limit as a part of its range; 1 where no joint has a range."""
    span = arm.upper - arm.lower
    bounded = np.isfinite(span) & (span > 0.0)
    near = np.minimum(arm.ready - arm.lower, arm.upper - arm.ready)[bounded] / span[bounded]
    return float(near.min(initial=1.0))


@pytest.mark.parametrize(
    "name", ["panda", "ur5", "kinova", "xarm7", "z1", "talos_arm", "baxter", "tiago", "two_link"]
)
def test_ready_is_a_tenth_of_the_range_away_from_every_limit(name: str) -> None:
    arm = rbi.load_robot(name)
    assert room(arm) >= 0.1 - 1e-9
    arm.check_configuration("ready", arm.ready)


@pytest.mark.slow
def test_ready_of_the_panda_is_the_one_of_its_description() -> None:
    arm = rbi.load_robot("panda", lock=FINGERS)
    assert_allclose(arm.ready, load("panda").q0[:7], atol=1e-12)
    assert_allclose(arm.ready, [0, -0.785398, 0, -2.35619, 0, 1.5707, 0.785398])


def test_ready_follows_the_joints_that_are_kept() -> None:
    arm = rbi.load_robot("panda", joints=("panda_joint4", "panda_joint6"))
    assert_allclose(arm.ready, [-2.35619, 1.5707])


def test_ready_stays_in_every_copy() -> None:
    arm = rbi.load_robot("panda", lock=FINGERS)
    copies = (
        arm.with_payload(1.0),
        arm.with_scaled_inertia(1.1),
        arm.with_friction(0.1, 0.2),
        arm.with_armature(0.1),
        arm.with_gravity((0, 0, 0)),
        arm.copy(),
        copy.deepcopy(arm),
        pickle.loads(pickle.dumps(arm)),
        rbi.load_robot(arm.model),
    )
    for other in copies:
        assert_allclose(other.ready, arm.ready)


def test_ready_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        rbi.load_robot("two_link").ready[0] = 1.0


@pytest.mark.parametrize("name", ["ready", "Home", "some_only_one"])
def test_reference_configuration_of_a_model_is_its_ready(name: str) -> None:
    model = pin.buildModelFromXML(spinner_urdf())
    model.referenceConfigurations[name] = np.array([0.6, 0.8, 0.25, -0.5])
    assert_allclose(rbi.load_robot(model).ready, [0.6, 0.8, 0.25, -0.5])
    assert_allclose(rbi.load_robot(model, lock=("slide",)).ready, [0.6, 0.8, -0.5])


def test_reference_at_a_limit_is_moved_away_from_it() -> None:
    model = pin.buildModelFromXML(spinner_urdf())  # limits -1.5 and 2
    model.referenceConfigurations["ready"] = np.array([1.0, 0.0, 5.0, -1.5])
    assert_allclose(rbi.load_robot(model).ready, [1.0, 0.0, 2.0 - 0.35, -1.5 + 0.35])


def test_reference_configuration_that_does_not_fit_is_refused() -> None:
    model = pin.buildModelFromXML(spinner_urdf())
    model.referenceConfigurations["ready"] = np.zeros(2)
    with pytest.raises(rbi.ModelError, match="reference configuration 'ready' is not 4 finite"):
        rbi.load_robot(model)


def test_without_a_reference_ready_is_the_middle_and_0_without_limits() -> None:
    assert_allclose(rbi.load_robot(spinner_urdf()).ready, [1.0, 0.0, 0.25, 0.25])
    one_sided = LIMIT.replace('upper="2"', 'upper="1e16"').replace("-1.5", "0")
    text = urdf(urdf_joint("lift", "prismatic", "base", "a", "0 0 1", one_sided), urdf_link("a", 1))
    assert_allclose(rbi.load_robot(text).ready, [0.05])


@pytest.mark.parametrize(("value", "ready"), [("0.3", 0.3), ("-1.5", -1.15), ("much", 0.25)])
def test_srdf_file_beside_the_description_gives_the_posture(
    value: str, ready: float, tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spinner_urdf())
    hand = '<group_state name="open" group="hand"><joint name="tilt" value="0.9"/></group_state>'
    other = '<group_state name="tucked" group="arm"><joint name="tilt" value="1"/></group_state>'
    path.with_suffix(".srdf").write_text(SRDF.format("home", value, other + hand))
    arm = rbi.load_robot(path)
    assert_allclose(arm.ready, [np.cos(0.5), np.sin(0.5), ready, 0.9], atol=1e-12)


def test_srdf_file_that_cannot_be_read_is_noted_and_refuses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spinner_urdf())
    path.with_suffix(".srdf").write_text("<robot><group_state")
    [note] = [note for note in rbi.load_robot(path).notes if "arm.ready" in note]
    assert "'arm.srdf' is not well-formed XML" in note


def test_arm_whose_joints_follow_others_is_ready_too() -> None:
    arm = rbi.load_robot(mimic_urdf())
    assert room(arm) >= 0.1
