"""Repairs: refused without, named in the refusal, made and noted with, and nothing else changed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

import rbimpedance as rbi
from rbimpedance.cli.app import app
from rbimpedance.robot.loading.repair import REPAIRS
from rbimpedance.robot.loading.urdf_document import UrdfDocument
from rbimpedance.robot.loading.urdf_reader import parse_urdf

from ..hostile.case import ARM, spoiled

MOMENTS = 'ixx="0.04" ixy="0.001" ixz="0" iyy="0.05" iyz="0" izz="0.02"'

LIMITS = 'lower="-1.5" upper="2"'


def read(text: str, *repair: str) -> UrdfDocument:
    return parse_urdf(text, "arm.urdf", repair)


@pytest.mark.parametrize(
    ("kind", "old", "new", "right", "said"),
    [
        ("comma", 'value="2.5"', 'value="2,5"', 'value="2.5"', '<mass> value "2,5" is taken as "2.5"'),
        ("comma", 'value="2.5"', 'value="0,125"', 'value="0.125"', "link 'upper'"),
        ("comma", 'xyz="0 0 0.3"', 'xyz="0 -,5 1,5e0"', 'xyz="0 -.5 1.5e0"', "joint 'shoulder'"),
        ("comma", 'xyz="0 1 0"', 'xyz="0, 1 ,0"', 'xyz="0 1 0"', 'taken as "0 1 0"'),
        ("comma", 'xyz="0 1 0"', 'xyz="0,0.8,0.6"', 'xyz="0 0.8 0.6"', "<axis> xyz"),
        ("unit", 'value="2.5"', 'value="2.5 kg"', 'value="2.5"', '"2.5 kg" is taken as "2.5"'),
        ("unit", 'value="2.5"', 'value="2500g"', 'value="2.5"', '"2500g" is taken as "2.5"'),
        ("unit", 'lower="-0.1"', 'lower="-100mm"', 'lower="-0.1"', "joint 'slide'"),
        ("unit", 'xyz="0 0 0.4"', 'xyz="0 0m 40cm"', 'xyz="0 0 0.4"', "joint 'slide'"),
        ("unit", 'izz="0.02"', 'izz="0.02 kg*m^2"', 'izz="0.02"', "link 'upper'"),
        ("unit", 'effort="30"', 'effort="30 N·m"', 'effort="30"', "joint 'shoulder'"),
        ("unit", 'velocity="4"', 'velocity="4rad/s"', 'velocity="4"', "joint 'shoulder'"),
        ("limit-order", LIMITS, 'lower="2" upper="-1.5"', LIMITS, "limits 2 and -1.5 are swapped"),
        ("no-limit", 'effort="30"', 'effort="inf"', 'effort="0"', 'effort "inf" is taken as not given'),
        ("no-limit", 'velocity="4"', 'velocity="1.8e308"', 'velocity="0"', "velocity"),
        ("no-limit", 'upper="2"', 'upper="Infinity"', 'upper="1e30"', "upper"),
        ("name", 'parent link="hand"', 'parent link=" hand "', 'parent link="hand"', "without the white space"),
        ("name", 'type="fixed"', 'type="Fixed "', 'type="fixed"', 'is taken as "fixed"'),
    ],
)  # fmt: skip
def test_repaired_file_reads_as_the_right_one(
    kind: str, old: str, new: str, right: str, said: str
) -> None:
    wrong = spoiled((old, new))
    with pytest.raises(rbi.ModelError, match=rf'; repair="{kind}" fixes this'):
        read(wrong)
    document, true = read(wrong, kind), read(spoiled((old, right)))
    assert (document.links, document.joints) == (true.links, true.joints)
    [note] = document.repairs
    assert note.startswith(f"repaired ({kind}) ")
    assert said in note


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('value="2.5"', 'value="2,500"'),  # 2.5, or 2500
        ('value="2.5"', 'value="1.234,5"'),
        ('value="2.5"', 'value="2.5 lb"'),
        ('value="2.5"', 'value="2.5 m"'),
        ('value="2.5"', 'value="nan"'),
        ('value="2.5"', 'value=""'),
        ('value="2.5"', 'value="-2.5"'),
        ('xyz="0 0 0.4"', 'xyz="1 2 40cm"'),  # in which unit are 1 and 2?
        ('xyz="0 0 0.4"', 'xyz="0,1 2"'),
        ('lower="-0.1"', 'lower="-90deg"'),  # of a prismatic joint
        ('xyz="0 1 0"', 'xyz="0 0 0"'),
        ('<limit lower="-0.1" upper="0.4" effort="20" velocity="1"/>', ""),  # of a prismatic joint
        ('upper="2"', 'upper="-inf"'),
        ('name="mount"', 'name="slide"'),
        ('type="fixed"', 'type="weld"'),
        ('ixy="0.001"', 'ixy="1"'),
    ],
)
def test_what_has_no_obvious_mend_is_refused_all_the_same(old: str, new: str) -> None:
    wrong = spoiled((old, new))
    with pytest.raises(rbi.ModelError) as strict:
        read(wrong)
    with pytest.raises(rbi.ModelError) as mended:
        read(wrong, *REPAIRS)
    assert "repair=" not in str(strict.value)
    assert str(mended.value) == str(strict.value)


def test_degrees_become_radians() -> None:
    wrong = spoiled(('lower="-1.5" upper="2"', 'lower="-90deg" upper="180 °"'))
    joint = read(wrong, "unit").joints[0]
    assert (joint.lower, joint.upper) == pytest.approx((-math.pi / 2, math.pi))


def test_revolute_joint_without_limits_is_continuous() -> None:
    wrong = spoiled(('<limit lower="-1.5" upper="2" effort="30" velocity="4"/>', ""))
    with pytest.raises(rbi.ModelError, match='make it type="continuous"; repair="no-limit"'):
        rbi.load_robot(wrong)
    arm = rbi.load_robot(wrong, repair="no-limit")
    assert (arm.nq, arm.nv) == (3, 2)
    assert "joint 'shoulder': revolute without <limit> is taken as continuous" in arm.notes[0]


def test_limit_that_is_infinite_is_none() -> None:
    arm = rbi.load_robot(
        spoiled(('lower="-1.5" upper="2"', 'lower="-inf" upper="inf"')), repair=True
    )
    assert (arm.lower[0], arm.upper[0]) == (-np.inf, np.inf)


def test_moments_become_the_nearest_that_a_body_can_have() -> None:
    # 0.052 > 0.03 + 0.02: the second moment ½(0.03 + 0.02 - 0.052) = -0.001 becomes 0.
    flat = 'ixx="0.03" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.052"'
    inertial = read(spoiled((MOMENTS, flat)), "inertia").links[1].inertial
    assert inertial is not None
    assert_allclose(inertial.inertia, [0.031, 0, 0, 0.021, 0, 0.052], rtol=0, atol=1e-15)
    assert inertial.is_realisable()


def test_small_negative_moment_is_mended_and_only_raised(rng: np.random.Generator) -> None:
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    odd = rotation @ np.diag([-0.001, 0.05, 0.05]) @ rotation.T
    i, j = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    numbers = " ".join(f'{key}="{float(x)!r}"' for key, x in zip(keys, odd[i, j], strict=True))
    wrong = spoiled((MOMENTS, numbers))
    with pytest.raises(rbi.ModelError, match=r'negative principal moment.*; repair="inertia"'):
        read(wrong)
    document = read(wrong, "inertia")
    inertial = document.links[1].inertial
    assert inertial is not None
    assert inertial.is_realisable()
    new = np.zeros((3, 3))
    new[i, j] = new[j, i] = inertial.inertia
    assert np.linalg.eigvalsh(new - odd)[0] >= -1e-15
    assert "raised by up to 0.001 kg·m²" in document.repairs[0]


def test_moments_that_a_body_can_have_stay_bit_for_bit() -> None:
    assert read(ARM, "inertia") == read(ARM)


def test_first_repair_is_offered_though_more_are_needed() -> None:
    wrong = spoiled(
        ('value="2.5"', 'value="2,5"'), ('lower="-1.5" upper="2"', 'lower="2" upper="1"')
    )
    with pytest.raises(rbi.ModelError, match=r'"2,5" is wrong.*; repair="comma" fixes this'):
        rbi.load_robot(wrong)
    with pytest.raises(rbi.ModelError, match=r'above the upper.*; repair="limit-order" fixes this'):
        rbi.load_robot(wrong, repair="comma")
    notes = rbi.load_robot(wrong, repair=["comma", "limit-order"]).notes
    assert [note.partition(" ")[2].partition(" ")[0] for note in notes] == [
        "(comma)",
        "(limit-order)",
    ]
    assert rbi.load_robot(wrong, repair=True).notes == notes


def test_sound_robot_is_the_same_with_repair() -> None:
    strict, mended = rbi.load_robot("ur5"), rbi.load_robot("ur5", repair=True)
    assert (mended.digest, mended.notes) == (strict.digest, strict.notes)


def test_repair_is_part_of_the_recipe(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spoiled(('value="2.5"', 'value="2,5"')))
    description = rbi.load_robot(path, repair="comma").description
    assert description is not None
    assert description.recipe is not None
    assert description.recipe["repair"] == ["comma"]
    assert 'value="2.5"' in description.xml


def test_command_line_repairs_on_request(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spoiled(('value="2.5"', 'value="2,5"')))
    runner = CliRunner()
    refused = runner.invoke(app, ["inspect", str(path)])
    assert isinstance(refused.exception, rbi.ModelError)
    assert "(--repair on the command line)" in str(refused.exception)
    mended = runner.invoke(app, ["inspect", str(path), "--repair"])
    assert mended.exit_code == 0
    assert "note: repaired (comma) link 'upper': <mass> value \"2,5\"" in mended.output
