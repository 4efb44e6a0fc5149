"""A description for other readers of URDF: the same links, masses and joints, without meshes, friction and mimicry."""

from __future__ import annotations

from collections.abc import Collection

from lxml import etree

DROPPED = ("visual", "collision", "dynamics", "mimic", "safety_controller")
"""Parts of links and joints that inverse dynamics does not need."""


def plain(xml: str, fixed: Collection[str] = (), dropped: Collection[str] = DROPPED) -> str:
    """Return a description stripped to what inverse dynamics needs.

    Args:
        xml: The description.
        fixed: Joints that become fixed, in their zero position.
        dropped: Parts of links and joints that are left out.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    robot = etree.fromstring(xml.encode(), parser)
    for element in [e for e in robot if e.tag not in ("link", "joint")]:
        robot.remove(element)
    for part in robot:
        for element in [e for e in part if e.tag in dropped]:
            part.remove(element)
        if part.get("name") in fixed:
            part.set("type", "fixed")
    return etree.tostring(robot, encoding="unicode")
