"""XML read strictly: one bounded parse without doctype, entities and network, and attributes that are what they say."""

from __future__ import annotations

import re
from collections.abc import Collection

from lxml import etree

from ...exceptions import ModelError
from .wording import shortened
from .xml_faults import MAX_DEPTH, explained

MAX_CHARACTERS = 8 * 1024 * 1024
"""Longest text that is read; the largest robot of example-robot-data has 0.2 million characters."""

MAX_TAGS = 200_000
"""Most tags that are read; the largest robot of example-robot-data has 6 thousand."""

MAX_ATTRIBUTES = 10_000
"""Most equals signs in one tag: libxml2 compares each attribute with all others of its element."""

MAX_NAME = 256
"""Longest name of a robot, link or joint; the longest of example-robot-data has 56 characters."""

LARGEST_NUMBER = 1e30
"""Largest magnitude of a number: products of a few such ones still fit into a float."""

ROBOT_PARTS = ("link", "joint", "material", "rbimpedance")
"""What of a <robot> says how it moves and looks."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""A decimal number as it is read."""

_LONGEST_NUMBERS = 1000  # characters of an attribute that holds numbers
_SPACE = re.compile(r"\s*")
_HTML = re.compile(r"(<!doctype\s+html|<html)\b", re.IGNORECASE)
_XACRO = (
    "This is xacro that has not been expanded: give the .xacro file itself, or expand it with "
    "`xacro file.xacro > robot.urdf`"
)


def read_xml(text: str, origin: str, parts: Collection[str] = ROBOT_PARTS) -> etree._Element:
    """Parse XML text strictly: bounded in size and depth, no doctype, no entities, no network, no xacro.

    Of a <robot>, only the named parts are kept: by default what says how it moves and looks.

    Args:
        text: The XML text.
        origin: Where the text came from, for errors.
        parts: Elements of a <robot> that are kept.

    Returns:
        The root element (lxml), without comments and processing instructions.

    Raises:
        ModelError: Not well formed, beyond the bounds, or something that a URDF does not hold.
    """
    text = text.lstrip("\ufeff \t\r\n")
    if len(text) > MAX_CHARACTERS:
        raise ModelError(f"{origin} has more than {MAX_CHARACTERS} characters: that is no URDF")
    if _HTML.match(text):
        raise ModelError(
            f"{origin} is a web page (HTML), not a URDF: download the raw file, not the page that shows it"
        )
    if has_doctype(text):
        raise ModelError(f"{origin} declares a DOCTYPE; a URDF needs none: remove it")
    _check_size(text, origin)
    root = _parsed(text, origin)
    if root.tag == "robot":
        _drop_others(root, parts)
    _check_elements(root, origin)
    return root


def _parsed(text: str, origin: str) -> etree._Element:
    parser = _parser()
    try:
        content = text.encode()
        return etree.fromstring(content, parser)
    except UnicodeEncodeError as error:
        raise ModelError(f"{origin} is not well-formed XML: it holds half a character") from error
    except etree.XMLSyntaxError as error:
        if _lacks_namespaces_only(parser):  # <gazebo> parts use prefixes that nothing declares
            return etree.fromstring(content, _parser(recover=True))
        raise ModelError(
            f"{origin} is not well-formed XML: {explained(parser.error_log, text)}"
        ) from error


def _parser(*, recover: bool = False) -> etree.XMLParser:
    return etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
        recover=recover,
    )


def _lacks_namespaces_only(parser: etree.XMLParser) -> bool:
    undeclared = etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE
    return len(parser.error_log) > 0 and all(e.type == undeclared for e in parser.error_log)


def _drop_others(root: etree._Element, parts: Collection[str]) -> None:
    """Remove elements that are not used here, such as <gazebo>, <transmission> and <ros2_control>."""
    for element in [child for child in root if child.tag not in parts and not _is_xacro(child)]:
        root.remove(element)


def has_doctype(text: str) -> bool:
    """Return whether an XML text has a document type declaration, the place where entities are declared."""
    position = 0
    while True:
        position = _SPACE.match(text, position).end()  # type: ignore[union-attr]
        for opening, closing in (("<!--", "-->"), ("<?", "?>")):
            if text.startswith(opening, position):
                end = text.find(closing, position + len(opening))
                if end < 0:
                    return False
                position = end + len(closing)
                break
        else:
            return text.startswith("<!DOCTYPE", position)


def _check_size(text: str, origin: str) -> None:
    """Bound what the parser's time and memory grow with, before it starts."""
    if text.count("<") > MAX_TAGS:
        raise ModelError(f"{origin} has more than {MAX_TAGS} tags: that is no URDF")
    if any(tag.count("=") > MAX_ATTRIBUTES for tag in text.split("<")):
        raise ModelError(f"{origin} has more than {MAX_ATTRIBUTES} attributes in one tag")


def _check_elements(root: etree._Element, origin: str) -> None:
    """Refuse nesting beyond the bound and remaining xacro."""
    depth = 0
    for event, element in etree.iterwalk(root, events=("start", "end")):
        depth += 1 if event == "start" else -1
        if depth > MAX_DEPTH:
            raise ModelError(f"{origin} nests elements deeper than {MAX_DEPTH}: that is no URDF")
        strings = (element.text or "", *element.attrib.values())
        if _is_xacro(element) or any("${" in s or "$(" in s for s in strings):
            line = element.sourceline
            tag = shortened(str(element.tag).rpartition("}")[2])
            raise ModelError(f"{origin}, line {line}: <{tag}>. {_XACRO}")


def _is_xacro(element: etree._Element) -> bool:
    return "wiki/xacro" in str(element.tag) or str(element.tag).startswith("xacro:")


def name_of(element: etree._Element) -> str:
    """Return the attribute `name` of a link or joint."""
    return text_of(element, "name", f"<{element.tag}> in line {element.sourceline}")


def text_of(element: etree._Element, attribute: str, where: str) -> str:
    """Return a name that must be there, not empty, printable and of bounded length; `where` is for the error."""
    text = str(element.get(attribute, ""))
    if not text.strip():
        raise ModelError(f"{where}: <{element.tag}> needs the attribute {attribute}")
    return checked_name(text, f"{where}: <{element.tag}> {attribute}")


def checked_name(text: str, what: str) -> str:
    """Return a name if it is printable and of bounded length; `what` says whose it is."""
    if len(text) > MAX_NAME:
        raise ModelError(
            f'{what}="{shortened(text)}" has {len(text)} characters; a name has at most {MAX_NAME}'
        )
    if not text.isprintable():
        raise ModelError(f'{what}="{shortened(text)}" holds control characters; rename it')
    return text


def only_child(element: etree._Element, tag: str, where: str) -> etree._Element | None:
    """Return the child of that tag, None where there is none; two are an error."""
    children = element.findall(tag)
    if len(children) > 1:
        raise ModelError(f"{where} has {len(children)} <{tag}> elements; keep one")
    return children[0] if children else None


def required_child(element: etree._Element, tag: str, where: str) -> etree._Element:
    """Return the one child of that tag."""
    child = only_child(element, tag, where)
    if child is None:
        raise ModelError(f"{where} has no <{tag}>")
    return child


def non_negative_of(element: etree._Element, attribute: str, where: str) -> float:
    """Return a number that is at least 0, and 0 where it is not given."""
    value = number_of(element, attribute, where, 0.0)
    if value < 0.0:
        raise ModelError(f'{where}: {attribute}="{value}" is negative; it must be 0 or more')
    return value


def number_of(
    element: etree._Element, attribute: str, where: str, default: float | None = None
) -> float:
    """Return one finite number; without a default it must be there."""
    fallback = None if default is None else (default,)
    return numbers_of(element, attribute, 1, where, fallback)[0]


def numbers_of(
    element: etree._Element,
    attribute: str,
    count: int,
    where: str,
    default: tuple[float, ...] | None = None,
) -> tuple[float, ...]:
    """Return that many finite numbers, separated by white space.

    Args:
        element: The element.
        attribute: Name of the attribute.
        count: How many numbers.
        where: What the element belongs to, for errors.
        default: What a missing attribute means; without it the attribute must be there.

    Raises:
        ModelError: A word is no decimal number ("1,5", "2kg", "nan") or beyond `LARGEST_NUMBER`, or the count is wrong.
    """
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    words = text.split() if text is not None and len(text) <= _LONGEST_NUMBERS else []
    if len(words) == count and all(NUMBER.fullmatch(word) for word in words):
        numbers = tuple(float(word) + 0.0 for word in words)  # + 0.0: no -0.0
        if all(abs(number) <= LARGEST_NUMBER for number in numbers):
            return numbers
    found = "is missing" if text is None else f'"{shortened(text)}" is wrong'
    wanted = "one finite number" if count == 1 else f"{count} finite numbers"
    raise ModelError(
        f"{where}: <{element.tag}> {attribute} {found}; it takes {wanted} with decimal points "
        'and without units, such as "' + " ".join(["0.5", "0", "-2e-3"][:count]) + '"'
    )
