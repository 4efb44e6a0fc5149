"""Errors of a text that is not valid XML, explained without the parser's terms."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lxml import etree

from .wording import shortened

MAX_DEPTH = 64
"""Deepest nesting of elements that is read."""

_KINDS = etree.ErrorTypes
_WORDS = {
    _KINDS.ERR_DOCUMENT_EMPTY: "there is no element in it",
    _KINDS.ERR_DOCUMENT_END: "there is content after the end of the root element",
    _KINDS.ERR_ATTRIBUTE_REDEFINED: "an attribute is given twice",
    _KINDS.ERR_ATTRIBUTE_WITHOUT_VALUE: 'an attribute has no value: write name="value"',
    _KINDS.ERR_ATTRIBUTE_NOT_STARTED: 'the value of an attribute is not in quotes: write name="value"',
    _KINDS.ERR_ATTRIBUTE_NOT_FINISHED: "the quotes of an attribute are not closed",
    _KINDS.ERR_LT_IN_ATTRIBUTE: "there is a < inside an attribute: is a quote missing before it?",
    _KINDS.ERR_SPACE_REQUIRED: "a space or a quote is missing between two attributes",
    _KINDS.ERR_GT_REQUIRED: "a > is missing at the end of a tag",
    _KINDS.ERR_TAG_NOT_FINISHED: "the file ends before every tag is closed",
    _KINDS.ERR_LTSLASH_REQUIRED: "the file ends before every tag is closed",
    _KINDS.ERR_COMMENT_NOT_FINISHED: "a comment is not closed by -->",
    _KINDS.ERR_CDATA_NOT_FINISHED: "a CDATA section is not closed by ]]>",
    _KINDS.ERR_UNDECLARED_ENTITY: "only the entities &lt; &gt; &amp; &quot; &apos; exist in a URDF",
    _KINDS.ERR_NAME_REQUIRED: "a name must follow < or & (write &lt; and &amp; for the characters themselves)",
    _KINDS.ERR_ENTITYREF_SEMICOL_MISSING: "write &amp; for the character &",
    _KINDS.ERR_INVALID_CHAR: "it contains a control character",
    _KINDS.ERR_HYPHEN_IN_COMMENT: "-- is not allowed inside a comment",
    _KINDS.ERR_RESERVED_XML_NAME: "<?xml ...?> is only allowed at the very beginning",
}
_MISMATCH = re.compile(r"tag mismatch: (\S{1,200}) line (\d+) and (\S{1,200})")


def explained(log: Iterable[etree._LogEntry], text: str) -> str:
    """Return where a text is no XML, and what is wrong there.

    Args:
        log: What the parser said; the first fault counts, the others follow from it.
        text: The text.
    """
    first = next(iter(log), None)
    if first is None:
        return "nothing in it can be read"
    where = f"line {first.line}, column {first.column}"
    if "depth" in first.message.lower():
        return f"it nests elements deeper than {MAX_DEPTH}: that is no URDF"
    if mismatch := _MISMATCH.search(first.message):
        opened, line, closed = (shortened(word) for word in mismatch.groups())
        return f"{where}: </{closed}> closes <{opened}> of line {line}"
    words = _WORDS.get(first.type, "a tag or a character is not as XML has it")
    return f"{where}: {words}{_quoted(text, first.line, first.column)}"


def _quoted(text: str, line: int, column: int) -> str:
    """Text before and at the position of the error; empty if there is none."""
    lines = text.split("\n", line)
    found = lines[line - 1] if 0 < line <= len(lines) else ""
    near = found[max(0, column - 50) : column + 20].strip()
    return f", near: {shortened(near)}" if near else ""
