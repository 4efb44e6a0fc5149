"""What a page shows, as plain data: an arm at rest, or frames of its motion with reference, forces and surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import Array
from .camera import best_view
from .drawing import Drawing

LEGEND = {
    "ghost": "reference q_r",
    "force": "force on the arm",
    "moment": "moment on the arm",
    "trace": "path of the tool",
    "surface": "surface",
    "frames": "tool and its reference",
    "compliance": "compliance of the tool",
}
"""What the page calls its parts."""

ARROW = 0.3
"""Length of the longest force's arrow as a share of the scene's radius."""

CURL = 0.16
"""Radius of the largest moment's round arrow as a share of the scene's radius."""


TRIAD, ELLIPSOID = 0.14, 0.16
"""Length of a frame's axes, and the longest half axis of the compliance, as shares of the scene's radius."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A flat surface.

    Attributes:
        point: A point of it, shape (3,) [m].
        normal: Unit normal, shape (3,).
    """

    point: Array
    normal: Array

    def nearest(self, place: Array) -> Array:
        """The point of the surface that is nearest to a place, shape (3,) [m]."""
        nearest: Array = place + self.normal * (self.normal @ (self.point - place))
        return nearest


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture.

    Attributes:
        q: Configuration of the arm, shape (nq,).
        q_r: Configuration of its reference, drawn as a ghost; None for no ghost.
        wrenches: Point of attack [m], force [N] and moment [N·m] of every wrench, shape (n, 9).
        travel: Displacements of the surfaces along their normals [m].
        tool: Where the tool is, shape (3,) [m]; None for no trace.
        at_tool: Poses of the tool, its reference and its compliance, shape (3, 7); None where they are not shown.
    """

    q: Array
    q_r: Array | None = None
    wrenches: Array | None = None
    travel: tuple[float, ...] = ()
    tool: Array | None = None
    at_tool: Array | None = None


def scene(
    drawing: Drawing,
    frames: Sequence[Frame],
    *,
    title: str,
    period: float = 0.0,
    surfaces: Sequence[Surface] = (),
    compliance: Array | None = None,
    live: int = 0,
) -> dict[str, Any]:
    """Return a scene as player.js describes it.

    Args:
        drawing: The arm.
        frames: One picture, or those of a motion; all with a ghost or none, and with the same number of wrenches.
        title: Title of the page.
        period: Time between frames [s].
        surfaces: Flat surfaces.
        compliance: Sizes along the principal axes, shape (3,); None where it is not shown.
        live: Number of the latest news that the page knows of, if it listens to its server; 0 if it does not.
    """
    arm = np.array([drawing.poses(frame.q) for frame in frames])
    ghosts = [drawing.poses(frame.q_r) for frame in frames if frame.q_r is not None]
    wrenches = np.array([_wrenches(frame) for frame in frames])
    outline = outline_of(drawing, [*arm, *ghosts], frames)
    center, radius = _ball(outline)
    arrows = _arrows(wrenches, radius)
    outline = _with_tool(_with_arrows(outline, wrenches, arrows), frames, radius)
    moving = _moving(frames, arm, ghosts, wrenches)
    tools = [frame.tool for frame in frames if frame.tool is not None]
    middle = np.mean(tools, axis=0) if tools else center
    return {
        "title": title,
        "legend": LEGEND,
        "nodes": drawing.nodes(),
        "now": {name: None if x is None else x[0] for name, x in moving.items()},
        "frames": {"count": len(frames), "period": period, **moving} if len(frames) > 1 else None,
        "trace": np.array(tools) if len(tools) > 1 else None,
        "surfaces": [{"point": [*s.nearest(middle)], "normal": [*s.normal]} for s in surfaces],
        "outline": outline,
        "center": [*center],
        "radius": radius,
        "ground": float(outline[:, 2].min()),
        "from": [*best_view(drawing, list(arm[:: 1 + len(arm) // 5]), outline)],
        "arrows": arrows,
        "live": live,
    } | _sizes_at_tool(radius, compliance)


def _moving(
    frames: Sequence[Frame], arm: Array, ghosts: Sequence[Array], wrenches: Array
) -> dict[str, Array | None]:
    """What changes from frame to frame; the first axis is the frame's number."""
    at_tool = [frame.at_tool for frame in frames if frame.at_tool is not None]
    return {
        "arm": arm,
        "ghost": np.array(ghosts) if ghosts else None,
        "wrenches": wrenches,
        "surfaces": np.array([frame.travel for frame in frames]),
        "tool": np.array(at_tool) if at_tool else None,
    }


def _sizes_at_tool(radius: float, compliance: Array | None) -> dict[str, Any]:
    """Length of a frame's axes, and half axes of the compliance, in a scene of a radius [m]."""
    shares = None if compliance is None else compliance / compliance.max()
    return {
        "triad": TRIAD * radius,
        "compliance": None if shares is None else ELLIPSOID * radius * shares,
    }


def outline_of(drawing: Drawing, poses: Sequence[Array], frames: Sequence[Frame]) -> Array:
    """Return the outermost points of all that moves, shape (n, 3) [m]."""
    corners = [drawing.corners(pose) for pose in poses[:: 1 + len(poses) // 400]]
    traced = [frame.tool[np.newaxis] for frame in frames if frame.tool is not None]
    return spread(np.concatenate([*corners, *traced]))


def spread(points: Array, directions: int = 300) -> Array:
    """Return those of the points that lie farthest out in one of many evenly spread directions."""
    k = np.arange(directions) + 0.5
    polar, azimuth = np.arccos(1.0 - 2.0 * k / directions), np.pi * (1.0 + np.sqrt(5.0)) * k
    sphere = np.stack(
        [np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)]
    )
    farthest: Array = points[np.unique(np.argmax(points @ sphere, axis=0))]
    return farthest


def _ball(outline: Array) -> tuple[Array, float]:
    """Centre and radius of a ball around the outline [m]."""
    center = (outline.min(axis=0) + outline.max(axis=0)) / 2.0
    return center, float(np.linalg.norm(outline - center, axis=1).max()) or 1.0


def _arrows(wrenches: Array, radius: float) -> dict[str, dict[str, float]]:
    """The largest force and moment, and the size of their arrows in a scene of a radius."""
    return {
        "force": {"size": ARROW * radius, "largest": _largest(wrenches[:, :, 3:6])},
        "moment": {"size": CURL * radius, "largest": _largest(wrenches[:, :, 6:9])},
    }


def _with_arrows(outline: Array, wrenches: Array, arrows: dict[str, dict[str, float]]) -> Array:
    """The outline with the tips of all arrows."""
    if not wrenches.size:
        return outline
    tips = wrenches[:, :, :3] + _scaled(wrenches[:, :, 3:6], **arrows["force"])
    turns = wrenches[:, :, :3] + _scaled(wrenches[:, :, 6:9], **arrows["moment"])
    return spread(np.concatenate([outline, tips.reshape(-1, 3), turns.reshape(-1, 3)]))


def _with_tool(outline: Array, frames: Sequence[Frame], radius: float) -> Array:
    """The outline with a cube around every frame at the tool."""
    places = [frame.at_tool[:, :3] for frame in frames if frame.at_tool is not None]
    if not places:
        return outline
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    reach = max(TRIAD, ELLIPSOID) * radius / np.sqrt(3.0)
    around = [place + reach * corner for place in places for corner in corners]
    return spread(np.concatenate([outline, *around]))


def _wrenches(frame: Frame) -> Array:
    return np.zeros((0, 9)) if frame.wrenches is None else frame.wrenches


def _largest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))


def _scaled(vectors: Array, size: float, largest: float) -> Array:
    """Vectors whose longest has a given length."""
    return vectors * (size / largest if largest > 0.0 else 0.0)
