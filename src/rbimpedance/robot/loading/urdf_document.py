"""A URDF as plain data: what it says about dynamics, and how to write that out again."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from lxml import etree

from ..._common.arrays import Array
from .wording import listed

MOVABLE = ("revolute", "continuous", "prismatic", "floating", "planar")
"""Types of joints that move."""

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of <inertia>, in the order of `Inertial.inertia`."""


_NO_LIMIT = float(np.finfo(np.float64).max)  # Pinocchio's; urdfdom reads no "inf"


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], pose of the centre of mass [m, rad] and rotational inertia about it [kg·m²] of a link.

    Attributes:
        mass: Non-negative mass.
        xyz: Centre of mass in the link's axes.
        rpy: Roll, pitch and yaw of the inertia's axes.
        inertia: ixx, ixy, ixz, iyy, iyz, izz.
    """

    mass: float
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    inertia: tuple[float, ...]

    def matrix(self) -> Array:
        """The rotational inertia about the centre of mass in its own axes, shape (3, 3)."""
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def principal(self) -> tuple[float, ...]:
        """The three principal moments of inertia, ascending."""
        return tuple(float(moment) for moment in np.linalg.eigvalsh(self.matrix()))

    def is_realisable(self) -> bool:
        """Return whether the largest principal moment is at most the sum of the others, as in any rigid body."""
        small, middle, large = self.principal()
        return large <= (small + middle) * (1.0 + 1e-6)


@dataclass(frozen=True)
class Link:
    """A link and its inertia, if it has one.

    Attributes:
        name: Name of the link.
        inertial: Its inertia; None where the document gives none.
        has_shape: It has a <visual> or <collision>: it is a body, not a frame.
    """

    name: str
    inertial: Inertial | None
    has_shape: bool = False


@dataclass(frozen=True)
class Mimic:
    """position = multiplier · position of `joint` + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint as the document has it.

    Attributes:
        name: Name of the joint.
        kind: revolute, continuous, prismatic, fixed, floating or planar.
        parent: Name of the parent link.
        child: Name of the child link.
        xyz: Origin in the parent link [m].
        rpy: Roll, pitch and yaw of the joint's axes [rad].
        axis: Axis of motion, of any length but 0.
        lower: Lower position limit [rad or m]; 0 on a continuous joint, -inf where there is none.
        upper: Upper position limit [rad or m]; 0 on a continuous joint, +inf where there is none.
        effort: Largest torque or force; 0 where it is not given.
        velocity: Largest speed; 0 where it is not given.
        damping: Viscous friction [N·m·s/rad or N·s/m].
        friction: Coulomb friction [N·m or N].
        mimic: What the joint follows, if it is not independent.
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    axis: tuple[float, ...]
    lower: float = 0.0
    upper: float = 0.0
    effort: float = 0.0
    velocity: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None


@dataclass(frozen=True)
class UrdfDocument:
    """What a URDF says about dynamics.

    Attributes:
        name: Name of the robot.
        links: Links, in the order of the document.
        joints: Joints, in the order of the document.
        gravity: Gravity that the document itself states, in the extension element
            `<rbimpedance><gravity xyz="0 0 -9.8"/></rbimpedance>`, [m/s²].
        xml: Its links, joints and materials as they were parsed, with the <rbimpedance> element.
        mesh_files: Addresses of the mesh files as written.
        repairs: What was repaired on request while reading.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    gravity: tuple[float, ...] | None
    xml: str = ""
    mesh_files: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()

    def movable(self) -> tuple[str, ...]:
        """Names of the joints that are not fixed."""
        return tuple(joint.name for joint in self.joints if joint.kind in MOVABLE)

    def fixed(self) -> tuple[str, ...]:
        """Names of the fixed joints."""
        return tuple(joint.name for joint in self.joints if joint.kind == "fixed")

    def mimics(self) -> dict[str, Mimic]:
        """What each movable mimicking joint follows; chains are not resolved."""
        return {
            joint.name: joint.mimic
            for joint in self.joints
            if joint.mimic is not None and joint.kind in MOVABLE
        }

    def with_mimics(self, mimics: Mapping[str, Mimic]) -> UrdfDocument:
        """Return a copy in which exactly the given joints mimic."""
        joints = tuple(replace(joint, mimic=mimics.get(joint.name)) for joint in self.joints)
        return replace(self, joints=joints)

    def without_mimics(self, names: Collection[str]) -> UrdfDocument:
        """Return a copy in which the named joints mimic nothing."""
        mimics = self.mimics()
        return self.with_mimics({name: mimics[name] for name in mimics if name not in names})

    def carriers(self) -> dict[str, str | None]:
        """For each link the movable joint that carries it; None where the link cannot move."""
        above = {joint.child: joint for joint in self.joints}
        carriers: dict[str, str | None] = {}
        for link in self.links:
            name = link.name
            while name in above and above[name].kind == "fixed":
                name = above[name].parent
            carriers[link.name] = above[name].name if name in above else None
        return carriers

    def notes(self) -> tuple[str, ...]:
        """What was repaired, and what is odd about joints and moving links and yet bearable."""
        carriers = self.carriers()
        heavy = {carriers[x.name] for x in self.links if x.inertial and x.inertial.mass > 0.0}
        shown = {carriers[x.name]: x.name for x in reversed(self.links) if x.has_shape}
        weightless = [name for joint, name in shown.items() if joint and joint not in heavy]
        limitless = [j.name for j in self.joints if np.isinf([j.lower, j.upper]).any()]
        moving = [x for x in self.links if carriers[x.name] is not None and x.inertial is not None]
        odd = [link.name for link in moving if link.inertial and not link.inertial.is_realisable()]
        found = (
            (
                weightless[::-1],
                "links that a joint moves have a shape and no mass: {}; their weight is not in the model, also where "
                "that joint is frozen",
            ),
            (limitless, "a position limit beyond every joint is taken as not given at {}"),
            (odd, "no rigid body has such moments of inertia (largest > sum of the others): {}"),
        )
        return (*self.repairs, *(words.format(listed(names)) for names, words in found if names))

    def to_xml(self) -> str:
        """Return the links and joints as a URDF that holds nothing but dynamics."""
        robot = etree.Element("robot", name=self.name)
        for link in self.links:
            _write_link(robot, link)
        for joint in self.joints:
            _write_joint(robot, joint)
        return str(etree.tostring(robot, encoding="unicode"))


def _write_link(robot: etree._Element, link: Link) -> None:
    element = etree.SubElement(robot, "link", name=link.name)
    if link.inertial is not None:
        inertial = etree.SubElement(element, "inertial")
        _add(inertial, "origin", xyz=link.inertial.xyz, rpy=link.inertial.rpy)
        _add(inertial, "mass", value=link.inertial.mass)
        _add(inertial, "inertia", **dict(zip(MOMENTS, link.inertial.inertia, strict=True)))


def _write_joint(robot: etree._Element, joint: Joint) -> None:
    element = etree.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    _add(element, "parent", link=joint.parent)
    _add(element, "child", link=joint.child)
    _add(element, "origin", xyz=joint.xyz, rpy=joint.rpy)
    if joint.kind == "fixed":
        return
    _add(element, "axis", xyz=joint.axis)
    keys = ("lower", "upper", "effort", "velocity")
    limits = {key: np.clip(getattr(joint, key), -_NO_LIMIT, _NO_LIMIT) for key in keys}
    _add(element, "limit", **{key: float(x) for key, x in limits.items()})
    _add(element, "dynamics", damping=joint.damping, friction=joint.friction)
    if joint.mimic is not None:
        _add(element, "mimic", **vars(joint.mimic))


def _add(parent: etree._Element, tag: str, **values: str | float | tuple[float, ...]) -> None:
    """Add an element whose attributes are names, numbers, or several numbers."""
    texts = {
        key: x if isinstance(x, str) else " ".join(map(repr, x if isinstance(x, tuple) else (x,)))
        for key, x in values.items()
    }
    etree.SubElement(parent, tag, texts)
