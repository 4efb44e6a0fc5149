"""From where a scene is looked at: the side from which the arm fills most of the page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ..._common.arrays import Array
from .drawing import Drawing

PAGE = 1.5
"""Width over height of the page that a view is chosen for; the player frames the arm in any."""

AZIMUTHS = np.deg2rad([0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0, 60.0])
"""Candidates, about the world's z axis; 0 looks along y [rad]."""

ELEVATIONS = np.deg2rad([20.0, 28.0, 36.0])
"""Candidates, above the horizon [rad]."""


def best_view(drawing: Drawing, poses: Sequence[Array], outline: Array) -> Array:
    """Return the unit vector from the scene to the camera by which the arm's shapes are largest on the page.

    The page is taken to be as large as the scene is deep, at least, so that nobody has to look along an arm.

    Args:
        drawing: The arm.
        poses: Poses of its shapes in some moments, shape (n, 7) each.
        outline: Outermost points of all that has to be on the page, shape (m, 3) [m].
    """

    def share_of_page(out: Array) -> float:
        right = np.cross([0.0, 0.0, 1.0], out)
        right /= np.linalg.norm(right)
        axes = np.transpose([right, np.cross(out, right), out])
        width, height, depth = np.ptp(outline @ axes, axis=0)
        shown = np.mean([drawing.shadow(moment, out) for moment in poses])
        return float(shown / max(width / PAGE, height, depth, 1e-9) ** 2)

    views = [
        np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
        for a, e in product(AZIMUTHS, ELEVATIONS)
    ]
    return max(views, key=share_of_page)
