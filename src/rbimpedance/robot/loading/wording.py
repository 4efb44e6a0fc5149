"""How errors of the loader are worded: with their source, short, and without control characters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from ...exceptions import ModelError, UnsupportedJointError

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


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return the names in quotes, the first ones where there are many."""
    shown = ", ".join(f"'{name}'" for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")


@contextmanager
def error_context(origin: str) -> Iterator[None]:
    """Let every error of the model name its origin, and hold nothing that a terminal would not print."""
    try:
        yield
    except UnsupportedJointError as error:
        reason = error.reason if origin in error.reason else f"in {origin}: {error.reason}"
        raise UnsupportedJointError(
            [printable(joint) for joint in error.joints], printable(reason)
        ) from error.__cause__
    except ModelError as error:
        message = str(error) if origin in str(error) else f"{origin}: {error}"
        raise ModelError(printable(message)) from error.__cause__
    except MemoryError as error:
        raise ModelError(f"{origin or 'the source'}: there is not enough memory for it") from error


def by_name(option: str, given: Mapping[str, Any] | None, what: str) -> dict[str, Any]:
    """Return what an option gives by name.

    Raises:
        ModelError: It is no mapping.
    """
    try:
        return dict(given or {})
    except (TypeError, ValueError) as error:
        raise ModelError(f"{option}= takes {what} by name, got {given!r}") from error
