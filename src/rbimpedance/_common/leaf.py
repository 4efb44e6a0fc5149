"""Leaves of the package, which nothing imports: the one way to reach them from below, on demand."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def leaf(name: str) -> ModuleType:
    """Load a leaf of the package.

    Args:
        name: Name of the module inside the package, as "pictures.viewer".
    """
    return import_module(f"rbimpedance.{name}")
