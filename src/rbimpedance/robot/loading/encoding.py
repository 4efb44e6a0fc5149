"""The bytes of a file become text: UTF-8, or with `repair=` what the file itself says that they are."""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection

from ...exceptions import ModelError

_MARKS = (  # longest first: that of UTF-16 begins that of UTF-32
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_OTHERS = (  # what downloads leave in place of a description
    (
        b"version https://git-lfs.github.com/",
        "is a Git LFS pointer, not the file itself: run `git lfs pull` in its repository",
    ),
    (b"\x1f\x8b", "is compressed by gzip: unpack it with gunzip"),
    (b"BZh", "is compressed by bzip2: unpack it with bunzip2"),
    (b"\xfd7zXZ", "is compressed by xz: unpack it with unxz"),
    (b"PK\x03\x04", "is a ZIP archive: unpack it"),
)
_DECLARED = re.compile(rb"""<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_TEXT_CODECS = ("utf-16", "utf-32", "iso8859-1", "iso8859-15", "cp1252", "ascii")


def decoded(content: bytes, what: str, repair: Collection[str]) -> tuple[str, tuple[str, ...]]:
    """Decode a file and say what was repaired.

    Args:
        content: Its bytes.
        what: The file, for errors.
        repair: Whether "encoding" is among the requested repairs.

    Raises:
        ModelError: The bytes are those of an archive or a Git LFS pointer, or not UTF-8, and no repair was requested or
            none is obvious.
    """
    for start, fault in _OTHERS:
        if content.startswith(start):
            raise ModelError(f"{what} {fault}")
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        place = error.start
    stated = _stated_encoding(content)
    try:
        text = content.decode(stated)
    except (LookupError, UnicodeDecodeError):
        text, stated = "", ""
    if stated and "encoding" in repair:
        return text, (f"repaired (encoding): {what} is read as {stated}, not UTF-8",)
    offer = f', or read it as {stated} with repair="encoding" (--repair)' if stated else ""
    raise ModelError(f"{what} is not UTF-8 text (byte {place}); save it as UTF-8{offer}")


def _stated_encoding(content: bytes) -> str:
    """The encoding that a byte order mark or the XML declaration states; empty where there is none known."""
    for mark, name in _MARKS:
        if content.startswith(mark):
            return name
    declared = _DECLARED.match(content)
    if declared is None:
        return ""
    try:
        name = codecs.lookup(declared[1].decode()).name
    except LookupError:
        return ""
    return name if name in _TEXT_CODECS else ""
