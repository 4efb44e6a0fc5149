"""A robot with all its joints, and what is to be done with them: what every kind of source becomes first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from ...exceptions import ModelError, UnsupportedJointError
from ..description import Description
from .joint_selection import joints_to_lock, locked_positions
from .model_building import build_model, checked_copy
from .robot_text import RobotText
from .srdf import ready_positions
from .urdf_appearance import mesh_notes
from .urdf_document import UrdfDocument

FLOATING_BASE = "root_joint"
"""Name of the joint of a floating base."""


@dataclass(frozen=True)
class FullRobot:
    """A full model and what is to be done with it.

    Attributes:
        model: The model, in which nothing is frozen yet.
        name: Name of the robot.
        locked: Names of the joints to freeze.
        values: Positions of joints to freeze [rad or m].
        link_order: Names of the links in the order of the document.
        rotors: SRDF file with the rotors' inertias, if there is one.
        posture: Positions by joint of a posture to work from [rad or m].
        notes: What is worth saying about the source.
        description: The URDF behind it.
        is_named: The source is a name, not a path or a text.
        floats: The source sees the robot on a floating base.
        follows: Which joint each mimicking one follows directly.
    """

    model: pin.Model
    name: str
    locked: frozenset[str]
    values: Mapping[str, float]
    link_order: tuple[str, ...] = ()
    rotors: Path | None = None
    posture: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    description: Description | None = None
    is_named: bool = False
    floats: bool = False
    follows: Mapping[str, str] = field(default_factory=dict)


def from_model(
    source: pin.Model,
    joints: Iterable[str] | None,
    lock: Iterable[str],
    values: Mapping[str, float],
) -> FullRobot:
    """Return a user's model, checked, with the joints to freeze.

    Args:
        source: The model; it is copied.
        joints: Names of the joints to keep; None keeps all.
        lock: Names of the joints to freeze.
        values: Positions of joints to freeze [rad or m].

    Raises:
        ModelError: The model is not sound, or a name is unknown.
    """
    model = checked_copy(source)
    names = list(model.names)
    pairs = zip(model.mimicking_joints, model.mimicked_joints, strict=True)
    primaries = {names[mimicking]: names[primary] for mimicking, primary in pairs}
    locked = joints_to_lock(names[1:], primaries, (), joints, lock)
    if following := sorted(values.keys() & primaries.keys()):
        name = following[0]
        raise ModelError(
            f"locked_configuration: '{name}' follows '{primaries[name]}'; give that one's position"
        )
    return FullRobot(model, model.name or "robot", locked, values, follows=primaries)


def from_document(
    document: UrdfDocument,
    text: RobotText,
    joints: Iterable[str] | None,
    lock: Iterable[str],
    values: Mapping[str, float],
) -> FullRobot:
    """Return the model of a description, held against it, with the joints to freeze.

    Args:
        document: The description.
        text: Where it came from.
        joints: Names of the joints to keep; None keeps all.
        lock: Names of the joints to freeze.
        values: Positions of joints to freeze [rad or m].

    Raises:
        ModelError: The description is not sound, or a name is unknown.
        UnsupportedJointError: Its base floats, or joints follow others in a way that Pinocchio cannot model.
    """
    base = (FLOATING_BASE,) if text.floating else ()
    follows = {name: mimic.joint for name, mimic in document.mimics().items()}
    movable = (*base, *document.movable())
    locked = joints_to_lock(movable, follows, document.fixed(), joints, lock)
    if not locked.issuperset(base):
        raise UnsupportedJointError(
            base,
            f'the base of {text.origin} floats; weld it to the world with lock=("{FLOATING_BASE}",)',
        )
    locked -= set(base)
    model = build_model(document.without_mimics(locked), text.origin)
    if document.gravity is not None:
        model.gravity.linear = np.array(document.gravity)
    posture, unread = _posture(text)
    return FullRobot(
        model=model,
        name=text.name or document.name,
        locked=locked,
        values=locked_positions(document, locked, values),
        link_order=tuple(link.name for link in document.links),
        rotors=text.srdf if text.has_rotors else None,
        posture=posture,
        notes=(*text.notes, *document.notes(), *unread, *mesh_notes(document.mesh_files, text)),
        description=Description(document.xml, text.folder, text.package_dirs),
        is_named=text.name is not None,
        floats=text.floating,
        follows=follows,
    )


def _posture(text: RobotText) -> tuple[dict[str, float], tuple[str, ...]]:
    """The posture that the description's SRDF file offers, and a note where that cannot be read."""
    if text.srdf is None:
        return {}, ()
    try:
        return ready_positions(text.srdf, text.posture), ()
    except ModelError as error:
        return {}, (f"{error}: arm.ready is the middle of the limits",)
