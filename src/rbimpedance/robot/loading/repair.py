"""Unambiguous URDF errors: each fix is made on request only, and reported.

Ambiguous errors are left to the user: an axis without direction, two links of one name, a text that is not a number,
a mass that is negative or missing, a prismatic joint without limits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator

import numpy as np
from lxml import etree

from ..._common.arrays import Array
from .strict_xml import LARGEST_NUMBER, NUMBER
from .urdf_document import MOMENTS, MOVABLE
from .wording import shortened

_OF_JOINT = "position"  # an angle or a length, as the joint is
_NUMBERS = {
    ("origin", "xyz"): ("length", 3),
    ("origin", "rpy"): ("angle", 3),
    ("axis", "xyz"): ("", 3),
    ("mass", "value"): ("mass", 1),
    **{("inertia", key): ("inertia", 1) for key in MOMENTS},
    ("limit", "lower"): (_OF_JOINT, 1),
    ("limit", "upper"): (_OF_JOINT, 1),
    ("limit", "effort"): ("effort", 1),
    ("limit", "velocity"): (f"{_OF_JOINT} speed", 1),
    ("dynamics", "damping"): ("damping", 1),
    ("dynamics", "friction"): ("effort", 1),
    ("mimic", "multiplier"): ("", 1),
    ("mimic", "offset"): (_OF_JOINT, 1),
    ("box", "size"): ("length", 3),
    ("cylinder", "radius"): ("length", 1),
    ("cylinder", "length"): ("length", 1),
    ("sphere", "radius"): ("length", 1),
    ("mesh", "scale"): ("", 3),
    ("color", "rgba"): ("", 4),
}  # what the numbers of an attribute are, and how many
_DEGREE = math.pi / 180.0
_UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"rad": 1.0, "deg": _DEGREE, "°": _DEGREE},
    "mass": {"kg": 1.0, "g": 1e-3},
    "inertia": {"kgm2": 1.0},
    "effort": {"N": 1.0, "Nm": 1.0},
    "length speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "angle speed": {"rad/s": 1.0, "deg/s": _DEGREE, "°/s": _DEGREE},
    "damping": {"Nms/rad": 1.0, "Nms": 1.0, "Ns/m": 1.0},
}
_WITH_UNIT = re.compile(rf"({NUMBER.pattern})\s*([A-Za-z°][A-Za-z°²·*./^2 ]*)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+", re.ASCII)
_INFINITE = frozenset({"inf", "+inf", "infinity", "+infinity"})
_LARGEST_REPAIR = 0.1  # of the largest moment of inertia


def repaired(root: etree._Element, kinds: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Repair a document in place.

    Args:
        root: The <robot> element.
        kinds: Names of the `REPAIRS` to make.

    Returns:
        The name of each repair that was made with what was changed.
    """
    return tuple(
        (kind, f"repaired ({kind}) {said}")
        for kind, repair in REPAIRS.items()
        if kind in kinds and repair is not None
        for said in repair(root)
    )


def _fix_commas(root: etree._Element) -> Iterator[str]:
    """Read "1,5" as 1.5 and "0,0,1" as "0 0 1"; "1,500" could be either number and is left alone."""
    return _fix_numbers(root, _without_commas)


def _fix_units(root: etree._Element) -> Iterator[str]:
    """Read "1.5 kg" as 1.5 and "90deg" as π/2."""
    return _fix_numbers(root, _without_units)


def _fix_numbers(root: etree._Element, fix: Callable[[str, str, int], str | None]) -> Iterator[str]:
    for element in root.iter():
        for attribute, text in element.attrib.items():
            quantity, count = _NUMBERS.get((str(element.tag), str(attribute)), ("", 0))
            quantity = quantity.replace(_OF_JOINT, _position_of(element))
            new = fix(str(text), quantity, count) if count and len(text) < 200 else None
            if new is not None:
                element.set(attribute, new)
                what = f'<{element.tag}> {attribute!s} "{shortened(str(text))}" is taken as "{new}"'
                yield f"{_owner(element)}: {what}"


def _without_commas(text: str, _quantity: str, count: int) -> str | None:
    words = text.split()
    if "," not in text or any(_THOUSANDS.fullmatch(word) for word in words):
        return None
    if len(words) == count:
        points = [w.replace(",", ".") if _DECIMAL_COMMA.fullmatch(w) else w for w in words]
        if all(NUMBER.fullmatch(word) for word in points):
            return " ".join(points)
    parts = [part.strip() for part in text.split(",")]
    if count > 1 and len(parts) == count and all(NUMBER.fullmatch(part) for part in parts):
        return " ".join(parts)
    return None


def _without_units(text: str, quantity: str, count: int) -> str | None:
    words = [text.strip()] if count == 1 else text.split()
    found = [_WITH_UNIT.fullmatch(word) for word in words]
    if len(words) != count or not all(found) or not any(m and m[4] for m in found):
        return None
    numbers = []
    for match in found:
        unit = re.sub(r"[*·. ^]", "", (match[4] or "").replace("²", "2")) if match else ""
        factor = _UNITS.get(quantity, {}).get(unit) if unit else 1.0
        if match is None or factor is None or (not unit and float(match[1]) != 0.0):
            return None
        numbers.append(match[1] if factor == 1.0 else repr(float(match[1]) * factor))
    return " ".join(numbers)


def _position_of(element: etree._Element) -> str:
    joint = element.getparent()
    return "length" if joint is not None and joint.get("type") == "prismatic" else "angle"


def _fix_limits(root: etree._Element) -> Iterator[str]:
    """Limits in the wrong order are swapped."""
    for limit in root.iterfind("joint/limit"):
        lower, upper = (_number(limit.get(key, "0")) for key in ("lower", "upper"))
        if lower is not None and upper is not None and lower > upper:
            old = limit.get("lower", "0"), limit.get("upper", "0")
            limit.set("lower", old[1])
            limit.set("upper", old[0])
            yield f"{_owner(limit)}: the limits {old[0]} and {old[1]} are swapped"


def _fix_unlimited(root: etree._Element) -> Iterator[str]:
    """A revolute joint without <limit> is a continuous one; a limit that is infinite is not given."""
    for joint in root.iterfind("joint"):
        if joint.get("type") == "revolute" and joint.find("limit") is None:
            joint.set("type", "continuous")
            yield f"{_owner(joint)}: revolute without <limit> is taken as continuous"
        for limit in joint.iterfind("limit"):
            for key, text in limit.attrib.items():
                none = _not_given(str(key), str(text).strip())
                if none is not None:
                    limit.set(key, none)
                    yield f'{_owner(joint)}: <limit> {key!s} "{shortened(str(text))}" is taken as not given'


def _not_given(key: str, text: str) -> str | None:
    """Substitute for a missing limit, if the text says that it is infinite."""
    size = text.removeprefix("-") if key in ("lower", "upper") else text
    huge = NUMBER.fullmatch(size) is not None and float(size) > LARGEST_NUMBER
    if not huge and size.lower() not in _INFINITE:
        return None
    if key in ("effort", "velocity"):
        return "0"
    wanted = {"lower": "-", "upper": ""}.get(key)
    is_negative = "-" if text.startswith("-") else ""
    return f"{is_negative}{LARGEST_NUMBER:g}" if wanted == is_negative else None


def _fix_inertias(root: etree._Element) -> Iterator[str]:
    """Moments of inertia that no body has become the nearest that one can have, if those are near.

    A rigid body's Σ = ½ tr(I)·1 − I, the second moment of its mass about the centre, is positive semi-definite; that is
    the same as moments that are positive and obey the triangle inequality. The nearest such Σ has the negative
    eigenvalues at zero. That raises moments and lowers none.
    """
    for inertia in root.iterfind("link/inertial/inertia"):
        numbers = [_number(inertia.get(key, "")) for key in MOMENTS]
        if None in numbers:
            continue
        xx, xy, xz, yy, yz, zz = (number or 0.0 for number in numbers)
        old = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        second, axes = np.linalg.eigh(np.trace(old) / 2.0 * np.eye(3) - old)
        new = _inertia(np.clip(second, 0.0, None), axes)
        change = float(np.linalg.norm(new - old, 2))
        largest = float(np.linalg.norm(old, 2))
        if not 1e-6 * largest < change <= _LARGEST_REPAIR * largest:
            continue
        for key, i, j in zip(MOMENTS, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2), strict=True):
            inertia.set(key, repr(float(new[i, j])))
        yield f"{_owner(inertia)}: moments of inertia that no body has are raised by up to {change:.3g} kg·m²"


def _inertia(second: Array, axes: Array) -> Array:
    """I = tr(Σ)·1 − Σ."""
    moments = axes @ np.diag(second) @ axes.T
    return np.asarray(np.trace(moments) * np.eye(3) - moments)


def _fix_names(root: etree._Element) -> Iterator[str]:
    """White space around names, and around and in capitals of types, means nothing."""
    keys = {"link": "name", "joint": "name", "parent": "link", "child": "link", "mimic": "joint"}
    for element in root.iter(*keys):
        name = element.get(keys[str(element.tag)], "")
        if name != name.strip():
            element.set(keys[str(element.tag)], name.strip())
            yield f'<{element.tag}> "{shortened(name)}" is taken without the white space around it'
    for joint in root.iterfind("joint"):
        kind = joint.get("type", "")
        plain = kind.strip().lower()
        if kind != plain and plain in (*MOVABLE, "fixed"):
            joint.set("type", plain)
            yield f'{_owner(joint)}: the type "{shortened(kind)}" is taken as "{plain}"'


def _number(text: str) -> float | None:
    """The number that a text is; None where it is none or too large."""
    text = text.strip()
    if len(text) > 200 or not NUMBER.fullmatch(text) or abs(float(text)) > LARGEST_NUMBER:
        return None
    return float(text)


def _owner(element: etree._Element | None) -> str:
    """The link or joint that an element belongs to."""
    while element is not None and element.tag not in ("link", "joint"):
        element = element.getparent()
    return (
        "the robot" if element is None else f"{element.tag} '{shortened(element.get('name', ''))}'"
    )


REPAIRS: dict[str, Callable[[etree._Element], Iterator[str]] | None] = {
    "encoding": None,  # made where the bytes are read
    "name": _fix_names,
    "comma": _fix_commas,
    "unit": _fix_units,
    "no-limit": _fix_unlimited,
    "limit-order": _fix_limits,
    "inertia": _fix_inertias,
}
"""The repairs by name, in the order in which they are made."""
