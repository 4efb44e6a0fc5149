"""Mesh files as small coloured triangle meshes: read by trimesh, thinned out, with the edges kept sharp."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..._common.arrays import Array
from ...robot.loading.urdf_appearance import RGBA
from ._meshcat import geometry as mg

SHARP = np.deg2rad(35.0)
"""Faces that meet at more than this angle keep an edge between them [rad]."""

FEWEST_FACES = 120
"""A mesh, or a part of one colour, is never thinned out below this."""

GREY: RGBA = (0.72, 0.74, 0.77, 1.0)
"""Colour of what has none."""

Faces: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one colour.

    Attributes:
        vertices: Shape (n, 3) [m].
        faces: Indices of three vertices each, shape (m, 3).
        color: Colour in the file; None where it has none.
    """

    vertices: Array
    faces: Faces
    color: RGBA | None


def read_mesh(path: Path | None, scale: ArrayLike) -> list[Part]:
    """Read a mesh file.

    Args:
        path: File in any format that trimesh reads: stl, dae, obj, ply, glb, ...
        scale: Factor of each axis, shape (3,).

    Raises:
        ValueError: There is no file, it holds no triangles, or it is not what its ending says.
    """
    if path is None:
        raise ValueError("it does not exist")
    import trimesh  # noqa: PLC0415  (takes a second)

    try:
        scene = trimesh.load_scene(path)
        pieces = scene.dump()
        if path.suffix.lower() == ".dae" and scene.units:  # as other readers of URDF do
            scale = np.multiply(scale, trimesh.units.unit_conversion(scene.units, "meters"))
    except Exception as error:  # every format has failures of its own
        raise ValueError(f"{type(error).__name__}: {error}") from error
    parts = [
        _merged(np.multiply(piece.vertices, scale), np.asarray(piece.faces), _color(piece))
        for piece in pieces
        if isinstance(piece, trimesh.Trimesh) and len(piece.faces)
    ]
    parts = [part for part in parts if len(part.faces) and np.isfinite(part.vertices).all()]
    if not parts:
        raise ValueError("it holds no triangles")
    return parts


def thinned(parts: list[Part], share: float) -> list[Part]:
    """Return parts with about a share of the faces, those that matter most to the shape.

    Args:
        parts: What `read_mesh` returned.
        share: From 0 to 1.
    """
    return [_thinned(part, share) for part in parts]


def has_colors(parts: list[Part]) -> bool:
    """Return whether the file of a mesh says anything about colours."""
    return any(part.color is not None for part in parts)


def capsule(radius: float, length: float) -> ColoredMesh:
    """Return a grey capsule about the z axis.

    Args:
        radius: Its radius [m].
        length: Between the centres of its round ends [m].
    """
    import trimesh  # noqa: PLC0415  (takes a second)

    made = trimesh.creation.capsule(length, radius, count=(24, 24))
    centred = made.vertices - made.bounds.mean(axis=0)
    return ColoredMesh([_merged(centred, np.asarray(made.faces), None)])


def _thinned(part: Part, share: float) -> Part:
    target = max(FEWEST_FACES, round(share * len(part.faces)))
    if target >= len(part.faces):
        return part
    import fast_simplification  # noqa: PLC0415  (on demand)

    vertices, faces = fast_simplification.simplify(
        part.vertices.astype(np.float32), part.faces.astype(np.int32), target_count=target, agg=4
    )
    return _merged(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), part.color)


def _merged(vertices: Array, faces: Faces, color: RGBA | None) -> Part:
    """Weld vertices at the same place, and drop triangles without area."""
    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    _, first, index = np.unique(
        np.round(vertices / size, 6), axis=0, return_index=True, return_inverse=True
    )
    welded = index.reshape(-1)[faces]
    a, b, c = welded.T
    return Part(vertices[first], welded[(a != b) & (b != c) & (c != a)], color)


def _color(piece: Any) -> RGBA | None:
    """The colour of a piece's material; None where the file says nothing."""
    if piece.visual.kind == "texture":
        rgba = np.asarray(piece.visual.material.main_color, np.float64) / 255.0
        return (float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3]))
    return None


def _split_at_sharp_edges(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Repeat vertices where faces meet at a sharp angle, so that shading does not smear the edge."""
    import trimesh  # noqa: PLC0415  (takes a second)

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    smooth = mesh.face_adjacency_angles < SHARP
    pairs, ends = mesh.face_adjacency[smooth], mesh.face_adjacency_edges[smooth]
    i, j = (  # corners at both ends of every smooth edge, in the face on either side
        (3 * side[:, None] + (faces[side][:, None] == ends[:, :, None]).argmax(axis=2)).ravel()
        for side in pairs.T
    )
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(faces.size, faces.size))
    count, label = connected_components(graph, directed=False)
    place = np.empty(count, np.int64)
    place[label] = faces.ravel()
    return vertices[place], label.astype(np.int64).reshape(faces.shape)


class ColoredMesh(mg.TriangularMeshGeometry):  # type: ignore[misc]
    """Triangles with a colour at every vertex, as a meshcat geometry.

    Args:
        parts: Triangles by colour.
        color: Colour of the parts that have none.
    """

    def __init__(self, parts: list[Part], color: RGBA = GREY) -> None:
        pieces = [_split_at_sharp_edges(part.vertices, part.faces) for part in parts]
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
        colors = [part.color or color for part in parts]
        self._colors = np.repeat(colors, np.diff(starts), axis=0)
        faces = [faces + start for (_, faces), start in zip(pieces, starts, strict=False)]
        super().__init__(
            np.concatenate([vertices for vertices, _ in pieces]),
            np.concatenate(faces),
            self._colors[:, :3] if len(set(colors)) > 1 else None,
        )

    def material(self) -> mg.Material:
        """What it is painted with."""
        shown = mg.MeshPhongMaterial(shininess=25, specular=0x222222)
        opacity = float(self._colors[:, 3].min())
        if opacity < 1.0:
            shown.transparent, shown.opacity = True, opacity
        if self.color is not None:
            shown.vertexColors = True
        else:
            red, green, blue = (round(255.0 * x) for x in self._colors[0, :3])
            shown.color = red * 65536 + green * 256 + blue
        return shown
