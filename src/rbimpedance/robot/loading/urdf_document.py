"""A URDF as plain data: what it says about dynamics, and how to write that out again."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from lxml import etree

from ..._common.arrays import Array

MOVABLE = ("revolute", "continuous", "prismatic", "floating", "planar")
"""Types of joints that move."""

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of <inertia>, in the order of `Inertial.inertia`."""


_NO_LIMIT = float(np.finfo(np.float64).max)  # Pinocchio's; urdfdom reads no "inf"


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return the names in quotes, the first ones where there are many."""
    shown = ", ".join(f"'{name}'" for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")


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
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    friction: float
    mimic: Mimic | None


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
        return (*self.repairs, *self._mass_notes(), *self._limit_notes(), *self._inertia_notes())

    def _mass_notes(self) -> tuple[str, ...]:
        carriers = self.carriers()
        heavy = {carriers[x.name] for x in self.links if x.inertial and x.inertial.mass > 0.0}
        shown = {carriers[x.name]: x.name for x in reversed(self.links) if x.has_shape}
        weightless = [name for joint, name in shown.items() if joint and joint not in heavy]
        if not weightless:
            return ()
        return (
            f"links that a joint moves have a shape and no mass: {listed(weightless[::-1])}; their weight is not in "
            "the model, also where that joint is frozen",
        )

    def _limit_notes(self) -> tuple[str, ...]:
        limitless = [j.name for j in self.joints if np.isinf([j.lower, j.upper]).any()]
        if not limitless:
            return ()
        return (
            f"a position limit beyond every joint is taken as not given at {listed(limitless)}",
        )

    def _inertia_notes(self) -> tuple[str, ...]:
        carriers = self.carriers()
        odd = [
            link.name
            for link in self.links
            if carriers[link.name] is not None
            and link.inertial is not None
            and not link.inertial.is_realisable()
        ]
        if not odd:
            return ()
        return (
            f"no rigid body has such moments of inertia (largest > sum of the others): {listed(odd)}",
        )

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
        etree.SubElement(
            inertial, "origin", xyz=_join(link.inertial.xyz), rpy=_join(link.inertial.rpy)
        )
        etree.SubElement(inertial, "mass", value=repr(link.inertial.mass))
        moments = zip(MOMENTS, link.inertial.inertia, strict=True)
        etree.SubElement(inertial, "inertia", {key: repr(value) for key, value in moments})


def _write_joint(robot: etree._Element, joint: Joint) -> None:
    element = etree.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    etree.SubElement(element, "origin", xyz=_join(joint.xyz), rpy=_join(joint.rpy))
    if joint.kind == "fixed":
        return
    etree.SubElement(element, "axis", xyz=_join(joint.axis))
    keys = ("lower", "upper", "effort", "velocity")
    limits = {key: np.clip(getattr(joint, key), -_NO_LIMIT, _NO_LIMIT) for key in keys}
    etree.SubElement(element, "limit", {key: repr(float(x)) for key, x in limits.items()})
    etree.SubElement(
        element, "dynamics", damping=repr(joint.damping), friction=repr(joint.friction)
    )
    if joint.mimic is not None:
        etree.SubElement(
            element,
            "mimic",
            joint=joint.mimic.joint,
            multiplier=repr(joint.mimic.multiplier),
            offset=repr(joint.mimic.offset),
        )


def _join(numbers: tuple[float, ...]) -> str:
    return " ".join(repr(number) for number in numbers)
