"""The document as plain data, and what Pinocchio gets to read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from example_robot_data.robots_loader import ROBOTS
from example_robot_data.utils import getModelPath

from rbimpedance.robot.loading.urdf_document import Inertial, Mimic
from rbimpedance.robot.loading.urdf_reader import parse_urdf
from rbimpedance.robot.loading.wording import listed

from ..arms import mimic_urdf, spinner_urdf


def example_urdfs() -> list[Path]:
    files = [
        Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
        for loader in ROBOTS.values()
        if loader.urdf_filename
    ]
    return sorted({Path(getModelPath(str(file)), file) for file in files})


@pytest.mark.parametrize("path", example_urdfs(), ids=lambda path: path.stem)
def test_pinocchio_builds_from_the_document_what_it_builds_from_the_file(path: Path) -> None:
    document = parse_urdf(path.read_text(encoding="utf-8"), path.name)
    mine, its = pin.buildModelFromXML(document.to_xml()), pin.buildModelFromUrdf(str(path))
    assert list(mine.names) == list(its.names)
    assert [frame.name for frame in mine.frames] == [frame.name for frame in its.frames]
    for mine_frame, its_frame in zip(mine.frames, its.frames, strict=True):
        assert mine_frame.placement == its_frame.placement
    for quantity in ("inertias", "jointPlacements"):
        pairs = zip(getattr(mine, quantity), getattr(its, quantity), strict=True)
        assert all(one == other for one, other in pairs)
    for limit in ("lowerPositionLimit", "upperPositionLimit", "damping", "friction"):
        np.testing.assert_array_equal(getattr(mine, limit), getattr(its, limit))
    for limit in ("effortLimit", "velocityLimit"):  # no limit: infinite there, 0 here
        known = np.isfinite(getattr(its, limit))
        np.testing.assert_array_equal(
            getattr(mine, limit), np.where(known, getattr(its, limit), 0.0)
        )


@pytest.mark.parametrize("text", [spinner_urdf(), mimic_urdf()])
def test_written_document_reads_as_the_same(text: str) -> None:
    document = parse_urdf(text, "the text")
    again = parse_urdf(document.to_xml(), "the text")
    assert replace(again, xml="") == replace(document, xml="")


def test_carrier_is_the_movable_joint_above_a_link() -> None:
    carriers = parse_urdf(spinner_urdf(), "the text").carriers()
    assert carriers == {
        "base": None, "hub": "spin", "carriage": "slide", "hand": "tilt", "tool": "tilt"
    }  # fmt: skip


def test_joints_are_told_by_whether_they_move() -> None:
    document = parse_urdf(spinner_urdf(), "the text")
    assert document.movable() == ("spin", "slide", "tilt")
    assert document.fixed() == ("tool_joint",)


def test_mimics_can_be_taken_off() -> None:
    document = parse_urdf(mimic_urdf(-0.5), "the text")
    assert document.mimics() == {"follow": Mimic("lead", -0.5, 0.2)}
    assert document.without_mimics(["follow"]).mimics() == {}
    assert document.without_mimics(["lead"]).mimics() == document.mimics()


def test_moments_of_a_body_obey_the_triangle_inequality() -> None:
    rod = Inertial(1.0, (0.0,) * 3, (0.0,) * 3, (0.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    assert rod.is_realisable()
    assert not replace(rod, inertia=(0.0, 0.0, 0.0, 1.0, 0.0, 1.1)).is_realisable()
    turned = replace(rod, inertia=(0.5, 0.5, 0.0, 0.5, 0.0, 1.0))
    assert turned.principal() == pytest.approx((0.0, 1.0, 1.0))


def test_odd_moments_of_moving_links_are_noted() -> None:
    odd = spinner_urdf().replace('izz="0.025"', 'izz="0.25"')
    [note] = parse_urdf(odd, "the text").notes()
    assert "'hub', 'carriage', 'hand'" in note
    assert parse_urdf(spinner_urdf(), "the text").notes() == ()


def test_long_lists_are_cut() -> None:
    assert listed(["a", "b", "c"], most=2) == "'a', 'b' and 1 more"
    assert listed(["a", "b"], most=2) == "'a', 'b'"
