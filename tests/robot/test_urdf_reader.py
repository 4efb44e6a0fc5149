"""Reading a URDF: every number and name is checked, and the error says which element and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

import rbimpedance as rbi
from rbimpedance.robot.loading import urdf_reader
from rbimpedance.robot.loading.urdf_document import Mimic
from rbimpedance.robot.loading.urdf_reader import parse_urdf

from ..hostile import documents
from ..hostile.case import Case

LINK = """<link name="a"><inertial><origin xyz="0.1 0 0" rpy="0 0 0"/><mass value="1.5"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>"""
JOINT = """<joint name="j" type="revolute"><parent link="base"/><child link="a"/>
<origin xyz="0 0 0.5" rpy="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="3" velocity="4"/><dynamics damping="0.3" friction="0.1"/></joint>"""
URDF = f'<robot name="r"><link name="base"/>{LINK}{JOINT}</robot>'


def changed(old: str, new: str) -> str:
    assert URDF.count(old) == 1
    return URDF.replace(old, new)


def test_everything_about_dynamics_is_read() -> None:
    document = parse_urdf(URDF, "the text")
    [joint] = document.joints
    assert (document.name, [link.name for link in document.links]) == ("r", ["base", "a"])
    inertial = document.links[1].inertial
    assert inertial is not None
    assert (inertial.mass, inertial.xyz, inertial.rpy) == (1.5, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert inertial.inertia == (0.1, 0.0, 0.0, 0.2, 0.0, 0.2)
    assert (joint.name, joint.kind, joint.parent, joint.child) == ("j", "revolute", "base", "a")
    assert (joint.xyz, joint.rpy, joint.axis) == ((0.0, 0.0, 0.5), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    assert (joint.lower, joint.upper, joint.effort, joint.velocity) == (-1.0, 2.0, 3.0, 4.0)
    assert (joint.damping, joint.friction, joint.mimic) == (0.3, 0.1, None)


def test_what_may_be_left_out_has_the_default_of_the_format() -> None:
    text = changed('<origin xyz="0 0 0.5" rpy="0 0 1"/><axis xyz="0 1 0"/>', "")
    text = text.replace('lower="-1" upper="2" effort="3" velocity="4"', "")
    text = text.replace('<dynamics damping="0.3" friction="0.1"/>', '<mimic joint="k"/>')
    [joint] = parse_urdf(text, "the text").joints
    assert (joint.xyz, joint.rpy, joint.axis) == ((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0))
    assert (joint.lower, joint.upper, joint.effort, joint.velocity) == (0.0, 0.0, 0.0, 0.0)
    assert (joint.damping, joint.friction, joint.mimic) == (0.0, 0.0, Mimic("k", 1.0, 0.0))


@pytest.mark.parametrize("number", ["2", " 2 ", "+2", "2.", "2e0", "0.2E+1", "\n2\t"])
def test_number_is_read_in_every_decimal_form(number: str) -> None:
    inertial = parse_urdf(changed('"1.5"', f'"{number}"'), "the text").links[1].inertial
    assert inertial is not None
    assert inertial.mass == 2.0


@pytest.mark.parametrize(
    "number",
    [
        "1,5",
        "1.5kg",
        "",
        "nan",
        "inf",
        "1e31",
        "1e999",
        "0x10",
        "1d3",
        "1_0",
        "1 2",
        "\u0661",
        "--1",
        ".",
    ],
)
def test_number_that_does_not_parse_names_file_element_and_value(number: str) -> None:
    with pytest.raises(rbi.ModelError) as caught:
        parse_urdf(changed('"1.5"', f'"{number}"'), "arm.urdf")
    message = str(caught.value)
    assert message.startswith(
        f"arm.urdf: <inertial> of link 'a': <mass> value \"{number}\" is wrong"
    )
    assert "it takes one finite number with decimal points and without units" in message


@pytest.mark.parametrize(
    "case",
    [case for case in documents.rows() if case.outcome == "ModelError"],
    ids=lambda case: case.name,
)
def test_fault_is_named_with_its_element(case: Case, tmp_path: Path) -> None:
    with pytest.raises(rbi.ModelError, match=case.word):
        rbi.load_robot(case.make(tmp_path))


def test_movable_joint_without_limits_is_told_what_to_add() -> None:
    text = changed('<limit lower="-1" upper="2" effort="3" velocity="4"/>', "")
    with pytest.raises(rbi.ModelError, match=r'add <limit lower=.* or make it type="continuous"'):
        parse_urdf(text, "arm.urdf")
    assert parse_urdf(text.replace("revolute", "continuous"), "arm.urdf").joints[0].effort == 0.0


def test_ring_beside_the_tree_is_refused() -> None:
    ring = "".join(
        f'<link name="{a}"/><joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
        for a, b in ("xy", "yx")
    )
    with pytest.raises(rbi.ModelError, match="the links 'x', 'y' run in a circle"):
        parse_urdf(changed("</joint>", f"</joint>{ring}"), "arm.urdf")


def test_links_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(urdf_reader, "MAX_LINKS", 1)
    with pytest.raises(rbi.ModelError, match="2 links; at most 1 are read"):
        parse_urdf(URDF, "arm.urdf")


@pytest.mark.parametrize("text", ["<sdf/>", "<mujoco/>", "<svg/>"])
def test_other_formats_are_told_apart(text: str) -> None:
    with pytest.raises(rbi.ModelError, match="is no URDF: its root element is"):
        parse_urdf(text, "arm.urdf")


def test_robot_without_links_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="there is no <link>"):
        parse_urdf("<robot/>", "arm.urdf")


def test_moments_of_a_link_that_cannot_move_do_not_matter() -> None:
    parse_urdf(changed('ixy="0"', 'ixy="1"').replace("revolute", "fixed"), "arm.urdf")


def test_rounding_below_zero_is_no_negative_moment() -> None:
    text = changed('ixx="0.1"', 'ixx="-1e-18"').replace('iyy="0.2"', 'iyy="1e-18"')
    parse_urdf(text.replace('izz="0.2"', 'izz="0"'), "arm.urdf")
