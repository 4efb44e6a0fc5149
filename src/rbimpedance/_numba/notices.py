"""Warnings about compiled code, each logged once."""

from __future__ import annotations

import functools
import logging


@functools.cache
def say_once(sentence: str) -> None:
    """Log a warning, unless the same has been logged before."""
    logging.getLogger("rbimpedance").warning(sentence)
