"""Pictures: the viewer and its page, and figures by matplotlib.

Offers `view`, `animate`, `Viewer` and `figures`, each loaded on first use. May use every room but `cli`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import figures as figures
    from .viewer import Viewer as Viewer
    from .viewer import animate as animate
    from .viewer import view as view

__all__ = ["Viewer", "animate", "figures", "view"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    if name == "figures":
        return import_module(f"{__name__}.figures")
    return getattr(import_module(f"{__name__}.viewer"), name)
