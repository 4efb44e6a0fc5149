"""The description that every peer reads: the same links, masses and joints, without meshes, friction and fingers."""

from __future__ import annotations

from collections.abc import Collection

from lxml import etree

_DROPPED = ("visual", "collision", "dynamics", "mimic", "safety_controller")


def plain(xml: str, fixed: Collection[str] = ()) -> str:
    """Return a description stripped to what inverse dynamics needs.

    Args:
        xml: The description.
        fixed: Joints that become fixed, in their zero position.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    robot = etree.fromstring(xml.encode(), parser)
    for element in [e for e in robot if e.tag not in ("link", "joint")]:
        robot.remove(element)
    for part in robot:
        for element in [e for e in part if e.tag in _DROPPED]:
            part.remove(element)
        if part.get("name") in fixed:
            part.set("type", "fixed")
    return etree.tostring(robot, encoding="unicode")
