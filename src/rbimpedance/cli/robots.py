"""The command `rbimpedance robots`."""

from __future__ import annotations

import re
from typing import Annotated, NamedTuple

import typer

from ..exceptions import ModelError
from ..robot.loading.robot_nicknames import suggest_robot
from ..robot.loading.robot_sources import known_names, names_by_source, read_source
from .options import Json, Quiet
from .terminal import print_json, print_table, stdout, table

DOWNLOADED = "robot_descriptions"
"""The source whose robots are downloaded on demand."""

_JOINT = re.compile(
    r"<joint\b[^>]*?\btype\s*=\s*[\"'](\w+)[\"'](?:[^>]*?/>|.*?</joint>)", re.DOTALL
)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_MOVE = {"revolute", "continuous", "prismatic"}


class Listed(NamedTuple):
    """A robot of the list.

    Attributes:
        name: For `load_robot`.
        source: Where it comes from.
        joints: How many joints can be controlled; None where its file is not here or is no URDF.
        floating: Whether its base is free, which `--lock root_joint` welds to the world.
    """

    name: str
    source: str
    joints: int | None
    floating: bool


def robots(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Only names that contain this.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """List the robots that can be named, with their joints and where they come from."""
    found = [
        _listed(robot, source)
        for source, names in names_by_source().items()
        for robot in names
        if name is None or name.lower() in robot.lower()
    ]
    if not found:
        raise ModelError(
            f"no robot's name contains '{name}'{suggest_robot(name or '', known_names())}"
        )
    if as_json:
        print_json({"robots": [robot._asdict() for robot in found]})
    elif quiet:
        for robot in found:
            print(robot.name)
    else:
        _print(found)


def _print(found: list[Listed]) -> None:
    rows = [
        [
            robot.name,
            "–" if robot.joints is None else str(robot.joints),
            "free" if robot.floating else "fixed",
            robot.source,
        ]
        for robot in found
    ]
    print_table(table("robots by name", ("name", "joints", "base", "source"), rows))
    if not names_by_source()[DOWNLOADED]:
        words = 'More robots, which are downloaded by name: pip install -e ".[descriptions]"'
        stdout.print(words, soft_wrap=True, markup=False)


def _listed(name: str, source: str) -> Listed:
    """Look into the text of a description, without building a model."""
    if source == DOWNLOADED:
        return Listed(name, source, None, False)
    try:
        text = read_source(name)
    except ModelError:
        return Listed(name, source, None, False)
    return Listed(name, source, _count_joints(text.text), text.floating)


def _count_joints(text: str) -> int:
    """Joints that move and follow no other one."""
    joints = _JOINT.finditer(_COMMENT.sub("", text))
    return sum(joint[1] in _MOVE and "<mimic" not in joint[0] for joint in joints)
