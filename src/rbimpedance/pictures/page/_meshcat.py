"""The one place that imports meshcat, whose server (not used here) warns about the zmq that it was written for."""

from __future__ import annotations

import warnings
from pathlib import Path

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    import meshcat
    from meshcat import geometry
    from meshcat.commands import SetObject, SetTransform
    from meshcat.visualizer import Visualizer

__all__ = ["VIEWER_BUNDLE", "SetObject", "SetTransform", "Visualizer", "geometry"]

VIEWER_BUNDLE = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
"""MeshCat's viewer with three.js, as one script."""
