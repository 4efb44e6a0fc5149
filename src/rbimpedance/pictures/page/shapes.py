"""What an arm looks like: a Pinocchio geometry model on the arm's own joints, and the meshes that go with it.

A link shows its <visual> shapes; where none of them can be shown, its <collision> shapes; where neither can, and on a
moving body without any shape, capsules from joint to joint, so that no arm is an empty scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import coal
import numpy as np
import pinocchio as pin

from ..._common.arrays import Array
from ...exceptions import ModelError
from ...robot.arm_model import ArmModel
from ...robot.description import Description
from ...robot.loading.urdf_appearance import RGBA, Shape, find_mesh, read_shapes
from .meshes import GREY, ColoredMesh, Part, capsule, has_colors, read_mesh, thinned

FACES = 40_000
"""Triangles that a whole robot is thinned out to: details below a pixel on a page go first."""

SLENDERNESS = 0.05
"""Radius of a capsule as a share of the arm's reach."""

JOINT_COLOR: RGBA = (0.45, 0.47, 0.51, 1.0)
"""Colour of the drums that mark the joints of a body without shapes."""


@dataclass(frozen=True, eq=False)
class Look:
    """What an arm looks like.

    Attributes:
        geometry: Shapes on the joints of the arm's model; those in `meshes` have an empty geometry here.
        meshes: Meshes by the name of their shape.
        boxes: Opposite corners of every shape in its own axes, shape (2, 3) each [m].
        notes: What could not be shown, and its substitute.
    """

    geometry: pin.GeometryModel = field(default_factory=pin.GeometryModel)
    meshes: dict[str, ColoredMesh] = field(default_factory=dict)
    boxes: list[Array] = field(default_factory=list)
    notes: tuple[str, ...] = ()

    def add(
        self,
        joint: int,
        placement: pin.SE3,
        shape: ColoredMesh | coal.ShapeBase,
        color: RGBA | None = None,
    ) -> None:
        """Add a shape to the body of a joint."""
        name = str(self.geometry.ngeoms)
        if isinstance(shape, ColoredMesh):
            self.meshes[name] = shape
            item = pin.GeometryObject(name, joint, placement, coal.BVHModelOBBRSS())
            box = np.array([shape.vertices.min(axis=0), shape.vertices.max(axis=0)], np.float64)
        else:
            item = pin.GeometryObject(name, joint, placement, shape)
            item.meshColor = np.array(color or GREY)
            shape.computeLocalAABB()
            box = np.array([shape.aabb_local.min_, shape.aabb_local.max_])
        self.geometry.addGeometryObject(item)
        self.boxes.append(box)


def look_of(arm: ArmModel) -> Look:
    """Find out what an arm looks like.

    Args:
        arm: The arm; its `description` says where its shapes and meshes are.
    """
    shapes, notes = _shapes(arm)
    files = _MeshFiles(arm.description or Description(""))
    shown = [shape for shape in shapes if shape.is_visual and files.can_show(shape)]
    seen = {shape.link for shape in shown}
    rest = [shape for shape in shapes if not shape.is_visual and shape.link not in seen]
    shown += [shape for shape in rest if files.can_show(shape)]
    look = Look(notes=notes + files.notes())
    _add_shapes(look, arm, shown, files)
    invisible = {shape.link for shape in shapes} - {shape.link for shape in shown}
    _add_capsules(look, arm, invisible)
    return look


def _shapes(arm: ArmModel) -> tuple[list[Shape], tuple[str, ...]]:
    """All shapes of the arm's links, and a note where they cannot be read."""
    if arm.description is None:
        return [], ()
    try:
        shapes = read_shapes(arm.description.xml)
    except ModelError as error:
        return [], (f"{error}: drawn as capsules",)
    return [shape for shape in shapes if shape.link in arm.raw_dynamics.frame_ids], ()


class _MeshFiles:
    """The meshes of a description, each file read once.

    Args:
        description: Where the files are.
    """

    def __init__(self, description: Description) -> None:
        self._description = description
        self._parts: dict[tuple[str, tuple[float, ...]], list[Part]] = {}
        self._lost: dict[str, str] = {}
        self._meshes: dict[tuple[object, ...], ColoredMesh] = {}

    def can_show(self, shape: Shape) -> bool:
        """Return whether a shape is a primitive, or its mesh can be read."""
        key = shape.mesh_file, shape.size
        if shape.kind == "mesh" and key not in self._parts and shape.mesh_file not in self._lost:
            path = find_mesh(shape.mesh_file, self._description)
            try:
                self._parts[key] = read_mesh(path, shape.size)
            except ValueError as error:
                self._lost[shape.mesh_file] = str(error)
        return shape.kind != "mesh" or key in self._parts

    def mesh(self, shape: Shape) -> ColoredMesh:
        """The mesh of a shape, thinned out to its share of `FACES`; one object however often it is shown."""
        parts = self._parts[shape.mesh_file, shape.size]
        color = GREY if shape.color is None or has_colors(parts) else shape.color
        key = (shape.mesh_file, shape.size, color)
        if key not in self._meshes:
            total = sum(len(part.faces) for parts in self._parts.values() for part in parts)
            self._meshes[key] = ColoredMesh(thinned(parts, min(1.0, FACES / total)), color)
        return self._meshes[key]

    def notes(self) -> tuple[str, ...]:
        """Say which files cannot be shown and why."""
        if not self._lost:
            return ()
        some = [f"'{address}': {reason}" for address, reason in self._lost.items()][:2]
        more = ", ..." if len(self._lost) > 2 else ""
        files = "mesh file" if len(self._lost) == 1 else "mesh files"
        return (
            f"{len(self._lost)} {files} cannot be shown ({', '.join(some)}{more}): collision shapes or capsules "
            "are drawn instead; give their folder with package_dirs=",
        )


def _add_shapes(look: Look, arm: ArmModel, shown: list[Shape], files: _MeshFiles) -> None:
    for shape in shown:
        frame = arm.raw_dynamics.model.frames[arm.raw_dynamics.frame_ids[shape.link]]
        placement = frame.placement * pin.SE3(shape.placement)
        drawn = files.mesh(shape) if shape.kind == "mesh" else _primitive(shape)
        look.add(frame.parentJoint, placement, drawn, shape.color)


def _primitive(shape: Shape) -> coal.ShapeBase:
    kinds = {"box": coal.Box, "cylinder": coal.Cylinder, "sphere": coal.Sphere}
    return kinds[shape.kind](*(abs(x) for x in shape.size))


# --- what has no shape ------------------------------------------------------------------------------------------


def _add_capsules(look: Look, arm: ArmModel, invisible: set[str]) -> None:
    """Draw capsules for the links that have shapes of which none can be shown, and for the bodies that have none."""
    model = arm.raw_dynamics.model
    dressed = {item.parentJoint for item in look.geometry.geometryObjects}
    radius = SLENDERNESS * _reach(model)
    for link in invisible:
        i = arm.raw_dynamics.frame_ids[link]
        if model.frames[i].parentJoint in dressed:
            start = np.array(model.frames[i].placement.translation)
            for end in _link_ends(model, i):
                _add_capsule(look, model.frames[i].parentJoint, start, end, radius)
    for joint in sorted(set(range(model.njoints)) - dressed):
        for end in _body_ends(model, joint):
            _add_capsule(look, joint, np.zeros(3), end, radius)
        if joint and (axis := _axis(model, joint)) is not None:
            drum = coal.Cylinder(1.25 * radius, 2.6 * radius)
            look.add(joint, pin.SE3(_turned_to(axis), np.zeros(3)), drum, JOINT_COLOR)


def _add_capsule(look: Look, joint: int, start: Array, end: Array, radius: float) -> None:
    span = end - start
    length = float(np.linalg.norm(span))
    if length > 0.5 * radius:
        placement = pin.SE3(_turned_to(span), (start + end) / 2.0)
        look.add(joint, placement, capsule(radius, length))


def _link_ends(model: pin.Model, i: int) -> Iterator[Array]:
    """Where joints, fixed ones too, leave the link of frame i, in the axes of the joint that carries it [m]."""
    for frame in model.frames:
        if frame.parentFrame == i and frame.type == pin.FrameType.JOINT:
            yield np.array(model.jointPlacements[frame.parentJoint].translation)
        elif frame.parentFrame == i and frame.type == pin.FrameType.FIXED_JOINT:
            yield np.array(frame.placement.translation)


def _body_ends(model: pin.Model, joint: int) -> Iterator[Array]:
    """Where the next joints sit on a body, or its farthest frame where there is none, in the joint's axes [m]."""
    children = [j for j in range(1, model.njoints) if model.parents[j] == joint]
    if children:
        yield from (np.array(model.jointPlacements[j].translation) for j in children)
        return
    frames = [f.placement.translation for f in model.frames if f.parentJoint == joint]
    if joint and frames:
        yield np.array(max(frames, key=np.linalg.norm))


def _reach(model: pin.Model) -> float:
    """The longest chain from the base to a frame [m]; 1 where everything sits at one place."""
    chain = np.zeros(model.njoints)
    for j in range(1, model.njoints):
        chain[j] = chain[model.parents[j]] + np.linalg.norm(model.jointPlacements[j].translation)
    lengths = [chain[f.parentJoint] + np.linalg.norm(f.placement.translation) for f in model.frames]
    return float(max(lengths)) or 1.0


def _axis(model: pin.Model, joint: int) -> Array | None:
    """The axis that a joint turns about, in its own axes; None for one that slides."""
    data, q = model.createData(), pin.neutral(model)
    v = np.ones(model.nv)
    pin.forwardKinematics(model, data, q, v)
    relative = data.v[joint] - data.liMi[joint].actInv(data.v[model.parents[joint]])
    turning = np.array(relative.angular)
    size = np.linalg.norm(turning)
    return None if size == 0.0 else turning / size


def _turned_to(direction: Array) -> Array:
    """A rotation that takes the z axis to a direction, shape (3, 3)."""
    aim = direction / np.linalg.norm(direction)
    return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), aim).matrix())
