"""Strict reading of a URDF into checked data.

Pinocchio never sees the file itself. It is given `UrdfDocument.to_xml()`: the links, joints and numbers that were
read and checked here and nothing else, because its own reader leaves out what it cannot parse (a mass of "1,5", a
ring of links, a second parent) and continues.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from copy import deepcopy
from dataclasses import replace
from itertools import chain

from lxml import etree

from ..._common.suggestions import suggest
from ...exceptions import ModelError
from .repair import REPAIRS, repaired
from .strict_xml import (
    MAX_NAME,
    checked_name,
    name_of,
    non_negative_of,
    number_of,
    numbers_of,
    only_child,
    read_xml,
    required_child,
    text_of,
)
from .urdf_document import MOMENTS, MOVABLE, Inertial, Joint, Link, Mimic, UrdfDocument
from .urdf_tree import check_links
from .wording import listed, shortened

MAX_LINKS = 1000
"""Most links, and most joints, that are read: readers of URDF recurse over them."""

LARGEST_ANGLE = 1e6
"""Largest roll, pitch or yaw [rad]: a larger one has no digits left that mean a direction."""

FARTHEST_LIMIT = 1e4
"""Largest position limit that is one [rad or m]; larger ones (1e16 means "none" in SDF) are taken as not given."""

_KINDS = (*MOVABLE, "fixed")
_X = (1.0, 0.0, 0.0)  # the axis where none is given


def parse_urdf(text: str, origin: str, repair: Collection[str] = ()) -> UrdfDocument:
    """Read a URDF from text.

    Args:
        text: The XML text.
        origin: Where the text came from, for errors.
        repair: Names of the `REPAIRS` that may be made.

    Returns:
        The document; every number in it is finite, names are unique and the links form one tree.

    Raises:
        ModelError: What is wrong, in which element, what would be right, and which repair would fix it.
    """
    root = read_xml(text, origin)
    if root.tag != "robot":
        raise ModelError(
            f"{origin} is no URDF: its root element is <{shortened(str(root.tag))}>, not <robot>"
        )
    _check_count(root, origin)
    given = _skeleton(root) if repair else None
    made = repaired(root, repair)
    try:
        document = _document(root)
    except ModelError as error:
        offer = _offered_repair(_skeleton(root) if given is None else given, repair, str(error))
        raise ModelError(f"{origin}: {error}{offer}") from None
    return replace(
        document,
        xml=str(etree.tostring(root, encoding="unicode")),
        mesh_files=_mesh_files(root),
        repairs=tuple(said for _, said in made),
    )


def _skeleton(root: etree._Element) -> etree._Element:
    """A copy without shapes, on which repairs can be tried at little cost."""
    bare = etree.Element(root.tag, _attributes(root))
    for child in root.iterchildren("link", "joint", "rbimpedance"):
        copy = etree.SubElement(bare, child.tag, _attributes(child))
        copy.extend([deepcopy(part) for part in child if part.tag not in ("visual", "collision")])
    return bare


def _attributes(element: etree._Element) -> dict[str, str]:
    return {str(key): str(value) for key, value in element.attrib.items()}


def _check_count(root: etree._Element, origin: str) -> None:
    """Bound the document's size, before anything is read or repaired."""
    for tag in ("link", "joint"):
        if (count := len(root.findall(tag))) > MAX_LINKS:
            raise ModelError(f"{origin}: {count} {tag}s; at most {MAX_LINKS} are read")


def _mesh_files(root: etree._Element) -> tuple[str, ...]:
    """Addresses of the meshes of all links, each once."""
    meshes = (root.iterfind(f"link/{kind}/geometry/mesh") for kind in ("visual", "collision"))
    found = [mesh.get("filename") for mesh in chain(*meshes)]
    return tuple(dict.fromkeys(str(address) for address in found if address is not None))


def _document(root: etree._Element) -> UrdfDocument:
    """Read the links, joints and gravity of a <robot>, and check that they belong together."""
    gravity = root.find("rbimpedance/gravity")
    document = UrdfDocument(
        name=checked_name(root.get("name") or "robot", "<robot> name"),
        links=tuple(_read_link(element) for element in root.iterfind("link")),
        joints=tuple(_read_joint(element) for element in root.iterfind("joint")),
        gravity=None if gravity is None else numbers_of(gravity, "xyz", 3, "<rbimpedance>"),
    )
    check_links(document)
    return document


def _offered_repair(root: etree._Element, made: Collection[str], fault: str) -> str:
    """Name the repair after which a fault is gone; empty where there is none."""
    for kind in REPAIRS:
        trial = deepcopy(root)
        if kind in made or not repaired(trial, (*made, kind)):
            continue
        try:
            _document(trial)
        except ModelError as error:
            if str(error) == fault:
                continue
        return f'; repair="{kind}" fixes this (--repair on the command line)'
    return ""


def _read_link(element: etree._Element) -> Link:
    name = name_of(element)
    where = f"link '{name}'"
    inertial = only_child(element, "inertial", where)
    has_shape = any(element.find(tag) is not None for tag in ("visual", "collision"))
    return Link(name, None if inertial is None else _read_inertial(inertial, where), has_shape)


def _read_inertial(element: etree._Element, where: str) -> Inertial:
    where = f"<inertial> of {where}"
    mass = required_child(element, "mass", where)
    inertia = required_child(element, "inertia", where)
    kilograms = number_of(mass, "value", where)
    if kilograms < 0.0:
        raise ModelError(f"{where}: the mass {kilograms} is negative; it must be 0 or more")
    return Inertial(
        kilograms, *_pose(element, where), tuple(number_of(inertia, key, where) for key in MOMENTS)
    )


def _read_joint(element: etree._Element) -> Joint:
    name = name_of(element)
    where = f"joint '{name}'"
    kind = element.get("type", "")
    if not kind:
        raise ModelError(f"{where} needs the attribute type, one of {listed(_KINDS)}")
    if kind not in _KINDS:
        raise ModelError(
            f"{where} has the unknown type '{shortened(kind)}'{suggest(kind[:MAX_NAME], _KINDS)}"
        )
    parent, child = (
        text_of(required_child(element, tag, where), "link", where) for tag in ("parent", "child")
    )
    if kind == "fixed":
        return Joint(name, kind, parent, child, *_pose(element, where), axis=_X)
    axis = _read_axis(element, where)
    limit = _read_limit(element, kind, where)
    friction, mimic = _read_friction(element, where), _read_mimic(element, where)
    pose = _pose(element, where)
    return Joint(name, kind, parent, child, *pose, axis, *limit, *friction, mimic)


def _read_axis(element: etree._Element, where: str) -> tuple[float, ...]:
    axis = only_child(element, "axis", where)
    if axis is None:
        return _X
    xyz = numbers_of(axis, "xyz", 3, where)
    if not 1e-6 < math.hypot(*xyz) < 1e6:
        raise ModelError(f"{where}: the axis {xyz} has no direction; give a unit vector")
    return xyz


def _read_limit(
    element: etree._Element, kind: str, where: str
) -> tuple[float, float, float, float]:
    limit = only_child(element, "limit", where)
    if limit is None:
        if kind in ("revolute", "prismatic"):
            raise ModelError(
                f"{where} is {kind} and has no <limit>; add "
                '<limit lower="..." upper="..." effort="..." velocity="..."/>'
                + (' or make it type="continuous"' if kind == "revolute" else "")
            )
        return 0.0, 0.0, 0.0, 0.0
    effort, velocity = (non_negative_of(limit, key, where) for key in ("effort", "velocity"))
    if kind not in ("revolute", "prismatic"):
        return 0.0, 0.0, effort, velocity
    lower, upper = (number_of(limit, key, where, 0.0) for key in ("lower", "upper"))
    if lower > upper:
        raise ModelError(f"{where}: the lower limit {lower} is above the upper limit {upper}")
    if lower > FARTHEST_LIMIT or upper < -FARTHEST_LIMIT:
        raise ModelError(
            f"{where}: no joint moves between the limits {lower} and {upper}; give them in rad or m"
        )
    return (
        -math.inf if lower < -FARTHEST_LIMIT else lower,
        math.inf if upper > FARTHEST_LIMIT else upper,
        effort,
        velocity,
    )


def _read_friction(element: etree._Element, where: str) -> tuple[float, float]:
    dynamics = only_child(element, "dynamics", where)
    if dynamics is None:
        return 0.0, 0.0
    return non_negative_of(dynamics, "damping", where), non_negative_of(dynamics, "friction", where)


def _read_mimic(element: etree._Element, where: str) -> Mimic | None:
    mimic = only_child(element, "mimic", where)
    if mimic is None:
        return None
    multiplier = number_of(mimic, "multiplier", where, 1.0)
    offset = number_of(mimic, "offset", where, 0.0)
    return Mimic(text_of(mimic, "joint", where), multiplier, offset)


def _pose(element: etree._Element, where: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    origin = only_child(element, "origin", where)
    zero = (0.0, 0.0, 0.0)
    if origin is None:
        return zero, zero
    rpy = numbers_of(origin, "rpy", 3, where, zero)
    if max(map(abs, rpy)) > LARGEST_ANGLE:
        raise ModelError(f"{where}: <origin> rpy {rpy} are too large for angles; give them in rad")
    return numbers_of(origin, "xyz", 3, where, zero), rpy
