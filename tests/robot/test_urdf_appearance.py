"""Mesh files, and links and joints as another library reads them."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pytest
import yourdfpy

import rbimpedance as rbi
from rbimpedance.robot.loading.robot_sources import read_source
from rbimpedance.robot.loading.robot_text import RobotText
from rbimpedance.robot.loading.urdf_appearance import find_mesh
from rbimpedance.robot.loading.urdf_reader import parse_urdf

from ..arms import spinner_urdf, urdf

MESH = '<visual><geometry><mesh filename="{}"/></geometry>{}</visual>'


def looking(address: str, material: str = "") -> str:
    return urdf().replace(
        '<link name="base"/>', f'<link name="base">{MESH.format(address, material)}</link>'
    )


def by_yourdfpy(xml: str) -> tuple[set[str], set[str], set[str]]:
    """Names of the links, the joints and the mimicking joints as yourdfpy reads them."""
    robot = yourdfpy.URDF.load(io.BytesIO(xml.encode()), load_meshes=False).robot
    mimics = {joint.name for joint in robot.joints if joint.mimic is not None}
    return {link.name for link in robot.links}, {joint.name for joint in robot.joints}, mimics


@pytest.mark.parametrize("name", ["panda", "talos_arm", "baxter", "tiago"])
def test_yourdfpy_reads_the_same_links_joints_and_mimics(name: str) -> None:
    source = read_source(name)
    document = parse_urdf(source.text, name)
    links, joints, mimics = by_yourdfpy(source.text)
    assert links == {link.name for link in document.links}
    assert joints == {joint.name for joint in document.joints}
    assert mimics.intersection(document.movable()) == set(document.mimics())


def test_mesh_files_of_visuals_and_collisions_are_read_once() -> None:
    text = looking("package://a/b.stl").replace(
        "</visual>", '</visual><collision><geometry><mesh filename="c.stl"/></geometry></collision>'
    )
    assert parse_urdf(text, "text").mesh_files == ("package://a/b.stl", "c.stl")


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
    text = RobotText("", "", folder=mesh.parents[1])
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
    folder = mesh.parents[1] / "urdf"
    folder.mkdir()
    secret = mesh.parents[3] / "secret.stl"
    for path in (
        secret,
        mesh.parents[2] / "secret.stl",
        mesh.parents[3] / "secret",
        folder / "plain",
    ):
        path.touch()
    (folder / "link.stl").symlink_to(mesh.parents[3] / "secret")
    assert find_mesh(address.format(secret=secret), RobotText("", "", folder=folder)) is None


def test_package_begins_at_its_package_xml_or_above_the_folder_of_the_file(mesh: Path) -> None:
    text = RobotText("", "", folder=mesh.parents[1] / "urdf" / "arm")
    address = "../../meshes/hand.stl"
    assert find_mesh(address, text) is None
    assert find_mesh(address, replace(text, package_dirs=(mesh.parents[1],))) == mesh
    (mesh.parents[1] / "package.xml").touch()
    assert find_mesh(address, text) == mesh


def test_colour_that_does_not_parse_does_not_refuse_the_arm() -> None:
    colour = '<material name="red"><color rgba="1,0,0,1"/></material>'
    assert rbi.load_robot(spinner_urdf(colour)).notes == rbi.load_robot(spinner_urdf()).notes


def test_file_address_with_an_empty_host_is_found(mesh: Path) -> None:
    text = RobotText("", "", folder=mesh.parents[1])
    assert find_mesh(f"file:///{mesh}", text) == mesh


def test_mesh_of_a_package_that_the_environment_names_is_found(
    mesh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, text = "package://toy/meshes/hand.stl", RobotText("", "")
    assert find_mesh(address, text) is None
    (mesh.parents[1] / "package.xml").write_text("<package><name>toy</name></package>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(mesh.parents[3]))  # a workspace above it
    assert find_mesh(address, text) == mesh
