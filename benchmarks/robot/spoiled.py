"""Robot descriptions spoiled at random: numbers, attributes, elements, structure and bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree

NUMBERS = (
    *(
        "0",
        "-0",
        "1",
        "-1",
        "1e-3",
        "1e-9",
        "1e-12",
        "1e-30",
        "4e-324",
        "1e3",
        "1e6",
        "1e9",
        "1e12",
        "1e16",
        "1e30",
    ),
    *(
        "-1e30",
        "1e31",
        "1e308",
        "1e999",
        "nan",
        "-inf",
        "inf",
        "NaN",
        "0x1p3",
        "1,5",
        "1.5kg",
        "90deg",
        "",
        " ",
        ".",
    ),
    *(
        "3.141592653589793",
        "2.220446049250313e-16",
        "1_0",
        "1d0",
        "\u0661",
        "1e",
        "--1",
        "+.5",
        "5.",
        "1 2",
        "999999999999",
    ),
)
WORDS = (
    *(
        "",
        " ",
        "universe",
        "root_joint",
        "world",
        "base_link",
        "\u202ename",
        "\x9b31m",
        "name\nname",
        "x" * 300,
        "é☃",
    ),
    *(
        "revolute",
        "continuous",
        "prismatic",
        "fixed",
        "floating",
        "planar",
        "Revolute",
        "${x}",
        "$(arg x)",
        "../..",
        "&",
    ),
)
TAGS = (
    *(
        "link",
        "joint",
        "inertial",
        "mass",
        "inertia",
        "origin",
        "axis",
        "limit",
        "dynamics",
        "mimic",
        "parent",
        "child",
    ),
    *(
        "robot",
        "visual",
        "collision",
        "geometry",
        "mesh",
        "transmission",
        "gazebo",
        "rbimpedance",
        "gravity",
    ),
)
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "screw")
BYTES = (
    b"<",
    b">",
    b'"',
    b"\0",
    b"\xff",
    b"&amp;",
    b"&#0;",
    b"]]>",
    b"<!--",
    b"<!DOCTYPE a>",
    b"\xef\xbb\xbf",
    b"/>",
)

Rng = np.random.Generator
Spoil = Callable[[Rng, etree._Element], object]


@dataclass(frozen=True)
class Case:
    """A spoiled description and how it is loaded."""

    number: int
    seed_name: str
    content: bytes
    repair: bool


def pick(rng: Rng, things: Any) -> Any:
    """One of several things."""
    return things[int(rng.integers(len(things)))]


# --- ways to spoil ----------------------------------------------------------------------------------------------


def elements(root: etree._Element, *tags: str) -> list[etree._Element]:
    """All elements, or those of some tags."""
    return [e for e in root.iter(*tags) if isinstance(e.tag, str)]


def spoil_number(rng: Rng, root: etree._Element) -> None:
    """Another number in one place of an attribute that holds numbers."""
    tags = ("mass", "inertia", "origin", "axis", "limit", "dynamics", "mimic", "mesh", "gravity")
    if found := [e for e in elements(root, *tags) if e.attrib]:
        element = pick(rng, found)
        key = pick(rng, sorted(element.attrib))
        words = element.get(key, "").split() or [""]
        i = int(rng.integers(len(words)))
        words[i] = pick(rng, NUMBERS) if rng.random() < 0.7 else scaled(rng, words[i])
        set_text(element, key, " ".join(words))


def scaled(rng: Rng, word: str) -> str:
    """A number times a power of ten, or its negative."""
    try:
        return repr(
            float(word) * float(rng.choice([-1.0, 1.0])) * 10.0 ** float(rng.uniform(-20, 20))
        )
    except ValueError:
        return word + "1"


def set_text(element: etree._Element, key: str, text: str) -> None:
    """Set an attribute to what lxml can hold of a text."""
    element.set(key, "".join(c for c in text if c in "\t\n" or ord(c) >= 32))


def spoil_attribute(rng: Rng, root: etree._Element) -> None:
    """An attribute goes, changes its name, or holds a word from elsewhere."""
    found = [e for e in elements(root) if e.attrib]
    element = pick(rng, found)
    key = pick(rng, sorted(element.attrib))
    choice = rng.integers(4)
    if choice == 0:
        del element.attrib[key]
    elif choice == 1:
        set_text(
            element,
            pick(rng, ("name", "link", "xyz", "value", "type", "joint")),
            element.get(key, ""),
        )
    elif choice == 2:
        set_text(element, key, pick(rng, WORDS))
    else:
        other = pick(rng, found)
        set_text(element, key, other.get(pick(rng, sorted(other.attrib)), ""))


def spoil_element(rng: Rng, root: etree._Element) -> None:
    """An element goes, comes twice, moves elsewhere or changes its tag."""
    found = elements(root)[1:]
    if not found:
        return
    element, choice = pick(rng, found), rng.integers(5)
    parent = element.getparent()
    if parent is None:
        return
    if choice == 0:
        parent.remove(element)
    elif choice == 1:
        parent.insert(int(rng.integers(len(parent) + 1)), copy(element))
    elif choice == 2:
        pick(rng, elements(root)).append(copy(element))
    elif choice == 3:
        element.tag = pick(rng, TAGS)
    else:
        etree.SubElement(element, pick(rng, TAGS), {"xyz": pick(rng, NUMBERS), "name": "new"})


def copy(element: etree._Element) -> etree._Element:
    """A copy of an element with all below it."""
    return etree.fromstring(etree.tostring(element, with_tail=False))


def spoil_structure(rng: Rng, root: etree._Element) -> None:
    """A joint changes its type or hangs elsewhere; links and joints change names; a joint follows another one."""
    joints, links = root.findall("joint"), root.findall("link")
    if not joints or not links:
        return
    joint, choice = pick(rng, joints), rng.integers(6)
    if choice == 0:
        joint.set("type", pick(rng, JOINT_TYPES))
    elif choice in (1, 2):
        for end in joint.findall(("parent", "child")[int(choice) - 1]):
            end.set("link", pick(rng, links).get("name", ""))
    elif choice == 3:
        pick(rng, [*joints, *links]).set("name", pick(rng, [*joints, *links]).get("name", ""))
    elif choice == 4:
        rule = {"joint": pick(rng, joints).get("name", ""), "multiplier": pick(rng, NUMBERS[:16])}
        etree.SubElement(joint, "mimic", rule)
    else:
        for limit in joint.findall("limit"):
            limit.set("lower", limit.get("upper", "0"))


def spoil_bytes(rng: Rng, content: bytes) -> bytes:
    """Bytes change, go, come twice or come from elsewhere."""
    i, j = sorted(int(k) for k in rng.integers(len(content) + 1, size=2))
    j = min(j, i + 200)
    choice = rng.integers(6)
    if choice == 0:
        return content[:i]
    if choice == 1:
        return content[:i] + content[j:]
    if choice == 2:
        return content[:j] + content[i:j] * int(rng.integers(1, 20)) + content[j:]
    if choice == 3:
        return content[:i] + bytes(pick(rng, BYTES)) + content[i:]
    if choice == 4:
        return content[:i] + bytes(rng.bytes(4)) + content[i:]
    return (
        content[:i]
        + bytes(b ^ 1 << int(rng.integers(8)) for b in content[i : i + 3])
        + content[i + 3 :]
    )


SPOILS: tuple[Spoil, ...] = (
    spoil_number,
    spoil_number,
    spoil_attribute,
    spoil_element,
    spoil_structure,
)


def case(seed: int, number: int, seeds: list[tuple[str, bytes]]) -> Case:
    """The case of that number."""
    rng = np.random.default_rng([seed, number])
    name, content = pick(rng, seeds)
    root = etree.fromstring(content)
    for _ in range(int(rng.integers(1, 5))):
        pick(rng, SPOILS)(rng, root)
    content = etree.tostring(root)
    if rng.random() < 0.15:
        content = spoil_bytes(rng, content)
    return Case(number, name, content, bool(rng.random() < 0.25))
