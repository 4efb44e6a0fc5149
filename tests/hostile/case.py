"""A hostile source and what is right for it, and short ways to write one down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pinocchio as pin

ARM = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 0.2" rpy="0 0 0"/><mass value="2.5"/>
<inertia ixx="0.04" ixy="0.001" ixz="0" iyy="0.05" iyz="0" izz="0.02"/></inertial></link>
<link name="hand"><inertial><origin xyz="0.1 0 0"/><mass value="1.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.013"/></inertial></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><origin xyz="0 0 0.3" rpy="0 0 0.5"/>
<parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1.5" upper="2" effort="30" velocity="4"/><dynamics damping="0.3" friction="0.1"/></joint>
<joint name="slide" type="prismatic"><origin xyz="0 0 0.4"/>
<parent link="upper"/><child link="hand"/><axis xyz="1 0 0"/>
<limit lower="-0.1" upper="0.4" effort="20" velocity="1"/></joint>
<joint name="mount" type="fixed"><parent link="hand"/><child link="tool"/></joint>
</robot>"""
"""A sound arm of two joints, which the cases spoil."""

Make = Callable[[Path], Any]


@dataclass(frozen=True)
class Case:
    """A source for `load_robot` and what is right for it.

    Attributes:
        name: What is wrong, in words.
        make: Returns the source, and writes the files that it needs into the folder that it is given.
        outcome: "sound", or the class of the error.
        word: What the error's message, or the notes of a sound arm, must hold.
        arguments: Further arguments of `load_robot`.
        text: The source where it is a text, for looking at it.
    """

    name: str
    make: Make
    outcome: str
    word: str
    arguments: dict[str, Any] = field(default_factory=dict)
    text: Callable[[], str] | None = None


def spoiled(*changes: tuple[str, str]) -> str:
    """The arm with parts replaced, each of which stands in it once."""
    text = ARM
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def of_text(
    name: str, text: str | Callable[[], str], outcome: str, word: str, **arguments: Any
) -> Case:
    """A case of XML text; a long one is given as a function, so that the other cases need not carry it."""

    def write() -> str:
        return text if isinstance(text, str) else text()

    return Case(name, lambda _: write(), outcome, word, arguments, write)


def change(
    name: str, old: str, new: str | Callable[[], str], outcome: str, word: str, **arguments: Any
) -> Case:
    if isinstance(new, str):
        return of_text(name, spoiled((old, new)), outcome, word, **arguments)
    write = new
    return of_text(name, lambda: spoiled((old, write())), outcome, word, **arguments)


def of_bytes(name: str, content: bytes, outcome: str, word: str, **arguments: Any) -> Case:
    def make(folder: Path) -> Path:
        (folder / "arm.urdf").write_bytes(content)
        return folder / "arm.urdf"

    return Case(name, make, outcome, word, arguments)


def of_xacro(name: str, body: str, outcome: str, word: str) -> Case:
    def make(folder: Path) -> Path:
        xmlns = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
        (folder / "arm.xacro").write_text(body.replace("<robot", f"<robot {xmlns}", 1))
        return folder / "arm.xacro"

    return Case(name, make, outcome, word)


def of_model(name: str, spoil: Callable[[pin.Model], object], outcome: str, word: str) -> Case:
    def make(_: Path) -> pin.Model:
        model = pin.buildModelFromXML(ARM)
        spoil(model)
        return model

    return Case(name, make, outcome, word)


def chain(joints: int, kind: str = "revolute", *, star: bool = False, more: str = "") -> str:
    """A chain or a star of joints."""
    inertial = ARM.partition("<inertial>")[2].partition("</inertial>")[0]
    parts = ['<robot name="long"><link name="l0"/>']
    for i in range(1, joints + 1):
        parts.append(f'<link name="l{i}"><inertial>{inertial}</inertial></link>')
        parts.append(
            f'<joint name="j{i}" type="{kind}"><origin xyz="0 0 0.1"/><parent link="l{0 if star else i - 1}"/>'
            f'<child link="l{i}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
            f"{more.replace('PREVIOUS', f'j{i - 1}') if i > 1 else ''}</joint>"
        )
    return "".join([*parts, "</robot>"])


def given(source: object) -> Make:
    """The source itself, whatever it is."""
    return lambda _: source


def setting(name: str, value: object) -> Callable[[pin.Model], object]:
    """Set an attribute of a model."""
    return lambda model: setattr(model, name, value)


def entry(name: str, index: int, value: object) -> Callable[[pin.Model], object]:
    """Set an entry of one of a model's lists."""
    return lambda model: getattr(model, name).__setitem__(index, value)
