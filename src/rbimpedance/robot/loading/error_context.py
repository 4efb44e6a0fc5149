"""Errors of the loader name the source, and hold nothing that a terminal would not print."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...exceptions import ModelError, UnsupportedJointError
from .wording import printable


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
