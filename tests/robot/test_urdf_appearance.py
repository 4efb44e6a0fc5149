"""Meshes and materials as yourdfpy reads them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import rbimpedance as rbi
from rbimpedance.robot.loading import urdf_appearance
from rbimpedance.robot.loading.robot_sources import RobotText
from rbimpedance.robot.loading.urdf_appearance import Appearance, find_mesh, read_appearance

from ..arms import mimic_urdf, spinner_urdf, urdf

MESH = '<visual><geometry><mesh filename="{}"/></geometry>{}</visual>'


def looking(address: str, material: str = "") -> str:
    return urdf().replace(
        '<link name="base"/>', f'<link name="base">{MESH.format(address, material)}</link>'
    )


def test_names_and_mimics_are_read() -> None:
    appearance = read_appearance(mimic_urdf())
    assert appearance.links == ("base", "first", "second", "tool")
    assert appearance.joints == ("lead", "follow", "spin")
    assert appearance.mimicking == ("follow",)


def test_meshes_and_materials_are_read() -> None:
    text = looking("package://a/b.stl")
    text = text.replace(
        "</robot>", '<material name="red"><color rgba="1 0 0 1"/></material></robot>'
    )
    appearance = read_appearance(text)
    assert (appearance.mesh_files, appearance.materials) == (("package://a/b.stl",), ("red",))


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "work" / "toy" / "meshes" / "hand.stl"
    path.parent.mkdir(parents=True)
    path.touch()
    return path


@pytest.mark.parametrize("above", [1, 2])
@pytest.mark.parametrize("named", [True, False])
def test_package_address_is_found_by_folder_or_above_the_file(
    mesh: Path, above: int, named: bool
) -> None:
    folder = mesh.parents[above]
    text = RobotText(
        "",
        "",
        folder=None if named else folder / "urdf",
        package_dirs=(folder,) if named else (),
    )
    assert find_mesh("package://toy/meshes/hand.stl", text) == mesh
    assert find_mesh("package://toy/meshes/foot.stl", text) is None


def test_relative_and_file_addresses_are_found(mesh: Path) -> None:
    text = RobotText("", "", folder=mesh.parents[2])
    assert find_mesh("meshes/hand.stl", text) == mesh
    assert find_mesh(f"file://{mesh}", text) == mesh
    assert find_mesh("https://host/meshes/hand.stl", text) is None


@pytest.mark.parametrize(
    "address",
    [
        "../../../secret.stl",
        "meshes/../../../../secret.stl",
        "file://{secret}",
        "{secret}",
        "package://toy/../../secret.stl",
        "package://{secret}",
        "package://toy/../secret.stl",
        "link.stl",
        "plain",
        "a\0b.stl",
        "x" * 5000 + ".stl",
    ],
)
def test_file_outside_the_package_is_not_found(mesh: Path, address: str) -> None:
    folder = mesh.parents[2] / "urdf"
    folder.mkdir()
    secret = mesh.parents[3] / "secret.stl"
    for path in (
        secret,
        mesh.parents[3] / "secret.stl",
        mesh.parents[3] / "secret",
        folder / "plain",
    ):
        path.touch()
    (folder / "link.stl").symlink_to(mesh.parents[3] / "secret")
    assert find_mesh(address.format(secret=secret), RobotText("", "", folder=folder)) is None


def test_package_begins_at_its_package_xml_or_above_the_folder_of_the_file(mesh: Path) -> None:
    text = RobotText("", "", folder=mesh.parents[2] / "urdf" / "arm")
    address = "../../meshes/hand.stl"
    assert find_mesh(address, text) is None
    assert find_mesh(address, replace(text, package_dirs=(mesh.parents[2],))) == mesh
    (mesh.parents[2] / "package.xml").touch()
    assert find_mesh(address, text) == mesh


def test_colour_that_does_not_parse_matters_for_pictures_only() -> None:
    colour = '<material name="red"><color rgba="1,0,0,1"/></material>'
    notes = rbi.load_robot(spinner_urdf(colour)).notes
    assert [note for note in notes if "matters for pictures only" in note]


@pytest.mark.parametrize("lost", ["links", "joints", "mimicking"])
def test_two_readers_must_agree(lost: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def forgetful(xml: str) -> Appearance:
        appearance = read_appearance(xml)
        return replace(appearance, **{lost: getattr(appearance, lost)[:-1]})

    monkeypatch.setattr(urdf_appearance, "read_appearance", forgetful)
    with pytest.raises(rbi.ModelError, match="read in one way and not in another"):
        rbi.load_robot(mimic_urdf())
