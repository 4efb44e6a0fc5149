"""An arm as Pinocchio's `MeshcatVisualizer` draws it, taken down instead of sent to a server."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack

from ..._common.arrays import Array
from ...robot.arm_model import ArmModel
from ._meshcat import SetObject, SetTransform, Visualizer
from ._meshcat import geometry as mg
from .shapes import Look, look_of

# isort: split
from pinocchio.visualize import MeshcatVisualizer  # after _meshcat, which imports meshcat quietly


class _Notebook:
    """Replaces meshcat's connection to a server: keeps the objects and their latest poses by path."""

    def __init__(self) -> None:
        self.objects: dict[str, mg.Object] = {}
        self.matrices: dict[str, Array] = {}

    def send(self, command: object) -> None:
        if isinstance(command, SetObject):
            self.objects[command.path.lower()] = command.object
        elif isinstance(command, SetTransform):
            self.matrices[command.path.lower()] = command.matrix


class _ArmVisualizer(MeshcatVisualizer):  # type: ignore[misc]
    """Pinocchio's visualizer with coloured meshes."""

    def __init__(self, model: pin.Model, look: Look) -> None:
        super().__init__(model, None, look.geometry)
        self._meshes = look.meshes

    def loadViewerGeometryObject(  # noqa: N802  (Pinocchio's name)
        self, geometry_object: pin.GeometryObject, geometry_type: Any, color: Any = None
    ) -> None:
        mesh = self._meshes.get(geometry_object.name)
        if mesh is None:
            super().loadViewerGeometryObject(geometry_object, geometry_type, color)
            return
        node = self.viewer[self.getViewerNodeName(geometry_object, geometry_type)]
        node.set_object(mg.Mesh(mesh, mesh.material()))


class Drawing:
    """The shapes of an arm, and where they are in a configuration.

    Args:
        arm: The arm.

    Attributes:
        notes: What could not be shown, and its substitute.
    """

    def __init__(self, arm: ArmModel) -> None:
        self._arm = arm
        look = look_of(arm)
        self._boxes = np.array([_corners(box) for box in look.boxes])
        self.notes = tuple(look.notes)
        self._notebook = _Notebook()
        self._visualizer = _ArmVisualizer(arm.model, look)
        self._visualizer.initViewer(viewer=Visualizer(window=self._notebook))
        self._visualizer.loadViewerModel("links")
        self._paths = list(self._notebook.objects)

    def nodes(self) -> list[dict[str, Any]]:
        """What there is to draw: meshcat's messages; a shape that occurs twice refers to the first."""
        nodes: list[dict[str, Any]] = []
        first: dict[int, int] = {}
        for i, path in enumerate(self._paths):
            shown = self._notebook.objects[path]
            if id(shown.geometry) in first:
                nodes.append({"like": first[id(shown.geometry)]})
                continue
            first[id(shown.geometry)] = i
            for part, name in ((shown, "o"), (shown.geometry, "g"), (shown.material, "m")):
                part.uuid = f"{name}{i}"  # not meshcat's random ones: equal scenes make equal files
            message = {"type": "set_object", "path": f"/links/{i}", "object": shown.lower()}
            nodes.append({"command": umsgpack.packb(message)})
        return nodes

    def poses(self, q: Array) -> Array:
        """Poses of all shapes in the world, x, y, z [m] and the quaternion x, y, z, w, shape (n, 7)."""
        self._visualizer.display(q)
        matrices = [self._notebook.matrices[path] for path in self._paths]
        return np.array([pin.SE3ToXYZQUAT(pin.SE3(matrix)) for matrix in matrices])

    def corners(self, poses: Array) -> Array:
        """The corners of the shapes' boxes in the world at given poses, shape (8·n, 3) [m]."""
        placed = [
            box @ np.array(pin.XYZQUATToSE3(pose).rotation).T + pose[:3]
            for box, pose in zip(self._boxes, poses, strict=True)
        ]
        return np.concatenate(placed)

    def shadow(self, poses: Array, direction: Array) -> float:
        """Area that the shapes' boxes cover, each for itself, seen along a unit vector [m²]."""
        x, y, z = np.ptp(self._boxes, axis=1).T
        turns = np.array([pin.XYZQUATToSE3(pose).rotation for pose in poses])
        faces = np.stack([y * z, z * x, x * y], axis=1)
        return float((abs(np.einsum("nij,i->nj", turns, direction)) * faces).sum())


def _corners(box: Array) -> Array:
    """The eight corners of a box given by two opposite ones, shape (8, 3)."""
    choice = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return np.take_along_axis(box, choice, axis=0)
