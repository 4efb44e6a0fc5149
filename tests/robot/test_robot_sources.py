"""Files, names and what they mean."""

from __future__ import annotations

import gzip
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner

import rbimpedance as rbi
from rbimpedance.cli.app import app
from rbimpedance.robot.loading import robot_sources
from rbimpedance.robot.loading.robot_sources import bundled_names, bundled_urdf, read_source

from ..arms import spinner_urdf


def test_name_of_a_file_without_its_ending_leads_to_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.urdf").write_text("<robot name='mine'/>", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        rbi.ModelError, match=r"no robot is called 'mine'; did you mean 'mine\.urdf'"
    ):
        rbi.load_robot("mine")


def test_missing_file_is_named_with_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "spinner.urdf").write_text(spinner_urdf())
    with pytest.raises(
        rbi.ModelError, match=r"no file '.*spiner\.urdf'; did you mean 'spinner\.urdf'"
    ):
        rbi.load_robot(tmp_path / "spiner.urdf")
    with pytest.raises(rbi.ModelError, match=r"there is no folder '.*nowhere'"):
        rbi.load_robot(str(tmp_path / "nowhere" / "spinner.urdf"))


def test_folder_and_pipe_are_refused_without_being_opened(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.urdf"
    os.mkfifo(pipe)
    with pytest.raises(rbi.ModelError, match="is a folder; give the path"):
        rbi.load_robot(tmp_path)
    with pytest.raises(rbi.ModelError, match="is not a regular file"):
        rbi.load_robot(pipe)
    with pytest.raises(rbi.ModelError, match="is not a regular file"):
        rbi.load_robot("/dev/zero")


@pytest.mark.parametrize("path", ["a\0b.urdf", "x" * 5000 + ".urdf", "a\0b", "x" * 5000, ""])
def test_impossible_path_is_a_model_error(path: str) -> None:
    with pytest.raises(rbi.ModelError):
        rbi.load_robot(path)


def test_file_that_is_not_utf8_is_refused_with_the_place(tmp_path: Path) -> None:
    path = tmp_path / "latin.urdf"
    path.write_bytes(b'<robot name="\xe4"/>')
    with pytest.raises(rbi.ModelError, match=r"is not UTF-8 text \(byte 13\)"):
        rbi.load_robot(path)


def test_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "marked.urdf"
    path.write_bytes(b"\xef\xbb\xbf" + spinner_urdf().encode())
    assert rbi.load_robot(path).nv == 3


def test_size_of_a_file_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "long.urdf"
    path.write_text(spinner_urdf())
    monkeypatch.setattr("rbimpedance.robot.loading.robot_text.MAX_CHARACTERS", 100)
    with pytest.raises(rbi.ModelError, match="more than 100 bytes"):
        rbi.load_robot(path)


def test_error_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "half.urdf"
    path.write_text(spinner_urdf()[:200])
    with pytest.raises(rbi.ModelError, match=r"'half\.urdf' is not well-formed XML"):
        rbi.load_robot(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="${x}"/>', "xacro cannot expand"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:inc/></robot>',
            "cannot expand",
        ),
        ("<robot", "xacro cannot expand"),
        ("<!DOCTYPE robot><robot/>", "declares a DOCTYPE"),
    ],
)
def test_xacro_that_fails_says_why(
    text: str, message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.xacro"
    path.write_text(text)
    with pytest.raises(rbi.ModelError, match=message):
        rbi.load_robot(path)
    assert capfd.readouterr() == ("", "")


ARM_OF_ARGUMENTS = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1"/><xacro:include filename="$(find {})/links.xacro"/>
<xacro:links mass="$(arg mass)"/>
<joint name="$(arg joint)" type="continuous"><parent link="base"/><child link="tool"/></joint></robot>"""
LINKS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="links" params="mass">
<link name="base"/><link name="tool"><inertial><origin xyz="1 0 0"/><mass value="${mass}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></xacro:macro></robot>"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder with the package `parts` two levels down, and a file elsewhere that needs it."""
    parts = tmp_path / "work" / "src" / "a_repository" / "folder_of_parts"
    parts.mkdir(parents=True)
    (parts / "package.xml").write_text("<package><name>parts</name></package>")
    (parts / "links.xacro").write_text(LINKS)
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "arm.urdf.xacro").write_text(ARM_OF_ARGUMENTS.format("parts"))
    return tmp_path


def test_arguments_and_package_folders_reach_xacro(workspace: Path) -> None:
    arm = rbi.load_robot(
        workspace / "alone" / "arm.urdf.xacro",
        xacro_args={"joint": "shoulder", "mass": 2.5},
        package_dirs=workspace / "work",
    )
    assert arm.joint_names == ("shoulder",)
    assert arm.model.inertias[1].mass == 2.5


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_packages_of_the_ros_environment_are_found(
    variable: str, workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, place = workspace / "alone" / "arm.urdf.xacro", workspace / "work"
    with pytest.raises(rbi.ModelError, match=r"'parts' is not found; .*package_dirs="):
        rbi.load_robot(path, xacro_args={"joint": "a"})
    if variable == "AMENT_PREFIX_PATH":
        installed = workspace / "install" / "share" / "parts"
        installed.mkdir(parents=True)
        (installed / "links.xacro").write_text(LINKS)
        place = workspace / "install"
    monkeypatch.setenv(variable, str(place))
    assert rbi.load_robot(path, xacro_args={"joint": "a"}).joint_names == ("a",)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {},
            r"argument 'joint' has no default; give it with xacro_args=.*--xacro-arg joint:=VALUE",
        ),
        (
            {"joint": "a", "mas": 2},
            r"has no argument 'mas' \(it has: (joint, )?mass",
        ),
        ({"joint": ["a"]}, "'joint' takes a text, a number or a truth value"),
        ([1, 2], "xacro_args= takes values by name"),
    ],
)
def test_wrong_arguments_of_xacro_are_named(
    arguments: dict[str, object], words: str, workspace: Path
) -> None:
    path = workspace / "alone" / "arm.urdf.xacro"
    with pytest.raises(rbi.ModelError, match=words):
        rbi.load_robot(path, xacro_args=arguments, package_dirs=workspace / "work")


def test_arguments_for_what_is_no_xacro_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spinner_urdf())
    for source in (path, spinner_urdf(), "two_link"):
        with pytest.raises(rbi.ModelError, match=r"xacro_args= is for \.xacro files"):
            rbi.load_robot(source, xacro_args={"a": 1})


def test_file_that_only_defines_macros_is_told_so(tmp_path: Path) -> None:
    path = tmp_path / "links.xacro"
    path.write_text(LINKS)
    with pytest.raises(rbi.ModelError, match=r"only defines macros \('links'\).*file that calls"):
        rbi.load_robot(path)


def test_module_of_robot_descriptions_brings_its_arguments_and_packages(
    workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = ModuleType("robot_descriptions.toy_description")
    module.__dict__.update(
        XACRO_PATH=str(workspace / "alone" / "arm.urdf.xacro"),
        XACRO_ARGS={"joint": "elbow", "not_asked_for": "x"},
        XACRO_PACKAGE_PATHS={"parts": str(workspace / "work/src/a_repository/folder_of_parts")},
        PACKAGE_PATH=str(workspace / "alone"),
        REPOSITORY_PATH=str(workspace / "alone"),
    )
    monkeypatch.setitem(sys.modules, module.__name__, module)
    modules = robot_sources.SOURCES[-1]._replace(names=lambda: ("toy_description",))
    monkeypatch.setattr(robot_sources, "SOURCES", (*robot_sources.SOURCES[:-1], modules))
    assert rbi.load_robot("toy_description").joint_names == ("elbow",)
    arm = rbi.load_robot("toy_description", xacro_args={"joint": "knee"})
    assert arm.joint_names == ("knee",)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "Git LFS.*git lfs pull"),
        (gzip.compress(b"<robot/>", mtime=0), "compressed by gzip: unpack it with gunzip"),
        (b"PK\x03\x04rest", "is a ZIP archive"),
    ],
)
def test_what_a_download_leaves_in_place_of_a_description_is_named(
    content: bytes, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(content)
    with pytest.raises(rbi.ModelError, match=words):
        rbi.load_robot(path)


def test_xacro_that_takes_too_long_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rbimpedance.robot.loading.xacro_expansion.MAX_SECONDS", 0.01)
    path = tmp_path / "arm.xacro"
    path.write_text(spinner_urdf())
    with pytest.raises(
        rbi.ModelError, match=r"cannot expand 'arm\.xacro': it takes more than 0\.01 s"
    ):
        rbi.load_robot(path)


def test_standard_input_that_is_no_text_is_refused() -> None:
    result = CliRunner().invoke(app, ["inspect", "-"], input=b"<robot \xff")
    assert isinstance(result.exception, rbi.ModelError)
    assert str(result.exception).startswith("standard input is not UTF-8 text (byte 7)")


def test_bundled_robots_are_files() -> None:
    assert "two_link" in bundled_names()
    assert bundled_urdf("two_link").is_file()
    with pytest.raises(rbi.ModelError, match="no bundled robot is called 'two_lnk'; did you mean"):
        bundled_urdf("two_lnk")


def test_name_means_the_robot_even_beside_a_file_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "two_link").write_text(spinner_urdf())
    (tmp_path / "mine").write_text(spinner_urdf())
    monkeypatch.chdir(tmp_path)
    assert rbi.load_robot("two_link").nv == 2
    assert rbi.load_robot("mine").nv == 3


def test_example_robots_that_cannot_be_imported_leave_the_other_sources(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "example_robot_data.robots_loader", None)
    assert rbi.load_robot("two_link").nv == 2
    with pytest.raises(rbi.ModelError, match=r"no robot is called 'panda'.*example-robot-data"):
        rbi.load_robot("panda")


def test_loader_that_changes_the_robot_in_code_is_noted() -> None:
    assert any("in code" in note for note in read_source("talos_legs").notes)
    assert read_source("panda").notes == ()


@pytest.fixture
def descriptions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot_descriptions package with one good, one broken and one MuJoCo module."""
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (tmp_path / "toy.urdf").write_text(spinner_urdf())
    modules = {
        "__init__": "",
        "toy_description": f"URDF_PATH = {str(tmp_path / 'toy.urdf')!r}\nPACKAGE_PATH = {str(tmp_path)!r}",
        "far_description": "raise OSError('no network')",
        "toy_mj_description": "MJCF_PATH = 'toy.xml'",
    }
    for name, content in modules.items():
        (package / f"{name}.py").write_text(content)
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("descriptions")
def test_robot_descriptions_name_loads_what_its_module_points_to() -> None:
    arm = rbi.load_robot("toy_description")
    assert (arm.name, arm.nv) == ("toy_description", 3)


@pytest.mark.usefixtures("descriptions")
def test_robot_descriptions_that_fail_say_why() -> None:
    with pytest.raises(rbi.ModelError, match="cannot fetch 'far_description': no network"):
        rbi.load_robot("far_description")
    with pytest.raises(
        rbi.ModelError, match="'toy_mj_description' of robot_descriptions holds no URDF"
    ):
        rbi.load_robot("toy_mj_description")


def test_robot_descriptions_name_without_the_package_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    find_spec = importlib.util.find_spec

    def without(name: str, *package: Any) -> Any:
        return None if name == "robot_descriptions" else find_spec(name, *package)

    monkeypatch.setattr(importlib.util, "find_spec", without)
    with pytest.raises(rbi.MissingExtraError, match=r'pip install -e "\.\[descriptions\]"'):
        rbi.load_robot("iiwa7_description")
