"""Words from a file as an error may show them: short, and without control characters."""

from __future__ import annotations

_SPACES = str.maketrans("\t\n\r", "   ")


def printable(text: str) -> str:
    r"""Return the text with everything that a terminal would not print as it is (ESC, NUL, ...) written as \x1b."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii")
        for c in text.translate(_SPACES)
    )


def shortened(text: str, most: int = 80) -> str:
    """Return the beginning of a text, printable."""
    return printable(text[:most]) + ("..." if len(text) > most else "")
