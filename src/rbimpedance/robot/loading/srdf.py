"""SRDF file next to a description: the configurations that its authors defined."""

from __future__ import annotations

import math
from pathlib import Path

from lxml import etree

from ..postures import ready_name
from .robot_text import read_text
from .strict_xml import read_xml


def ready_positions(srdf: Path, preferred: str | None = None) -> dict[str, float]:
    """Return the positions of the joints in the posture that an SRDF file offers to work from [rad or m].

    Each <group> has postures of its own: of every group that which `postures.ready_name` chooses counts.

    Args:
        srdf: The file.
        preferred: Name of the posture that the source calls its reference.

    Raises:
        ModelError: It cannot be read.
    """
    text, _ = read_text(srdf)
    root = read_xml(text, f"'{srdf.name}'", parts=("group_state",))
    groups: dict[str, dict[str, etree._Element]] = {}
    for state in root.iterfind("group_state"):
        groups.setdefault(state.get("group", ""), {})[state.get("name", "")] = state
    positions: dict[str, float] = {}
    for states in groups.values():
        if (name := ready_name(states, preferred)) is not None:
            positions |= _positions(states[name])
    return positions


def _positions(state: etree._Element) -> dict[str, float]:
    """Positions of a <group_state>; joints with several degrees of freedom, and what is no number, are left out."""
    found = {}
    for joint in state.iterfind("joint"):
        words = joint.get("value", "").split()
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            continue
        if len(numbers) == 2:  # cos and sin
            numbers = [math.atan2(numbers[1], numbers[0])]
        if len(numbers) == 1 and math.isfinite(numbers[0]):
            found[joint.get("name", "")] = numbers[0]
    return found
