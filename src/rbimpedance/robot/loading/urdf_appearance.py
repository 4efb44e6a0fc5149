"""What a URDF contains besides dynamics: shapes and colours, read by yourdfpy for pictures only, and mesh files."""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..._common.arrays import Array
from ...exceptions import ModelError
from .packages import Packages
from .robot_text import RobotText, is_file
from .wording import listed, shortened

MAX_MESHES = 1000
"""Most mesh files that are looked for when a robot is loaded."""

MESH_SUFFIXES = frozenset(
    (
        *(".stl", ".stlb", ".dae", ".obj", ".ply", ".off"),
        *(".glb", ".gltf", ".3mf", ".3ds", ".mesh", ".wrl"),
    )
)
"""How mesh files end, in lower case."""

RGBA = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""


class Origin(Protocol):
    """Where a description came from, as far as its mesh files matter: a `RobotText` or a `Description`."""

    @property
    def folder(self) -> Path | None:
        """Folder that relative mesh files refer to."""

    @property
    def package_dirs(self) -> tuple[Path, ...]:
        """Folders in which `package://` addresses are looked up."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One <visual> or <collision> of a link.

    Attributes:
        link: Name of the link.
        is_visual: False for a <collision>.
        placement: Pose in the link's frame, shape (4, 4).
        kind: "box", "cylinder", "sphere" or "mesh".
        size: Edges of a box, (radius, length) of a cylinder, (radius,) of a sphere, scale of a mesh.
        mesh_file: Address of the mesh file as written; empty for the others.
        color: What its material says; None where it says nothing.
    """

    link: str
    is_visual: bool
    placement: Array
    kind: str
    size: tuple[float, ...]
    mesh_file: str
    color: RGBA | None


def read_shapes(xml: str) -> tuple[Shape, ...]:
    """Read the visual and collision shapes of all links, in the order of the document.

    Args:
        xml: The document as `read_xml` accepted it.

    Raises:
        ModelError: yourdfpy cannot read it.
    """
    robot = _read(xml)
    colors = {m.name: m.color.rgba for m in robot.materials if m.color is not None}
    return tuple(
        shape
        for link in robot.links
        for is_visual, elements in ((True, link.visuals), (False, link.collisions))
        for element in elements
        if (shape := _shape(link.name, is_visual, element, colors)) is not None
    )


def find_mesh(address: str, text: Origin, packages: Packages | None = None) -> Path | None:
    """Return the file that a mesh address means, or None where there is none.

    Only files that are called like meshes are found, and only inside `package_dirs`, the document's package (the
    folders below the nearest package.xml, else below the folder above the document's), or the package that a
    `package://` address names: a description from elsewhere reaches no other file.

    Args:
        address: As written: `package://name/...`, `file://...`, or a path relative to the document.
        text: Where the document came from.
        packages: Where packages are; kept from call to call, it searches each folder once.
    """
    scheme, _, rest = address.rpartition("://")
    if scheme == "package":
        places = _in_package(rest, text, packages or Packages(text.package_dirs))
    elif scheme in ("", "file"):
        file = "/" + rest.lstrip("/") if rest.startswith("/") else rest
        allowed = (*text.package_dirs, *_own_package(text.folder))
        folders = (*(() if text.folder is None else (text.folder,)), *text.package_dirs)
        places = iter([(folder / file, allowed) for folder in folders])
    else:
        return None
    plain = ((Path(os.path.normpath(place)), inside) for place, inside in places)
    return next((place for place, inside in plain if _is_mesh(place, inside)), None)


def mesh_notes(files: Sequence[str], text: RobotText) -> tuple[str, ...]:
    """Say which meshes are not there.

    Args:
        files: Addresses of the mesh files as written.
        text: Where the document came from.
    """
    if len(files) > MAX_MESHES:
        return (f"{len(files)} mesh files are named; more than {MAX_MESHES} are not looked for",)
    packages = Packages(text.package_dirs)
    missing = [address for address in files if find_mesh(address, text, packages) is None]
    if not missing:
        return ()
    return (
        f"{len(missing)} of {len(files)} mesh files are missing, or outside the robot's package "
        f"({listed([shortened(address, 200) for address in missing], 2)}): this matters for pictures only; name their "
        "folder with package_dirs=",
    )


def _in_package(
    rest: str, text: Origin, packages: Packages
) -> Iterator[tuple[Path, tuple[Path, ...]]]:
    """Places that `package://rest` may mean, each with the folder that it must be in."""
    name, _, path = rest.partition("/")
    if not name or not path:
        return
    above = () if text.folder is None else (text.folder, *text.folder.parents)
    for folder in (*text.package_dirs, *above):
        yield folder / rest, (folder / name,)
        yield folder / path, (folder,)
    if (package := packages.find(name)) is not None:
        yield package / path, (package,)


def _read(xml: str) -> Any:
    """A document as read by yourdfpy, without loading meshes."""
    import yourdfpy  # noqa: PLC0415  (takes a second)

    logger = logging.getLogger("yourdfpy.urdf")
    is_disabled, logger.disabled = logger.disabled, True
    try:
        return yourdfpy.URDF.load(
            io.BytesIO(xml.encode()), load_meshes=False, build_scene_graph=False
        ).robot
    except Exception as error:
        raise ModelError(f"visuals cannot be read ({error})") from error
    finally:
        logger.disabled = is_disabled


def _shape(link: str, is_visual: bool, element: Any, colors: dict[str, Any]) -> Shape | None:
    """Read a <visual> or <collision>; None where it has no finite, positive size."""
    geometry, color = element.geometry, None
    if geometry is None:
        return None
    kind, mesh_file = "", ""
    size: Any = ()
    if geometry.box is not None:
        kind, size = "box", geometry.box.size
    elif geometry.cylinder is not None:
        kind, size = "cylinder", (geometry.cylinder.radius, geometry.cylinder.length)
    elif geometry.sphere is not None:
        kind, size = "sphere", (geometry.sphere.radius,)
    elif geometry.mesh is not None:
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        kind, size = "mesh", np.broadcast_to(scale, 3)
        mesh_file = str(geometry.mesh.filename)
    extent: tuple[float, ...] = tuple(float(x) for x in size)
    placement = np.eye(4) if element.origin is None else np.array(element.origin)
    if not extent or not np.isfinite([*extent, *placement.ravel()]).all() or not all(extent):
        return None
    if is_visual and element.material is not None:
        own = element.material.color
        color = colors.get(element.material.name) if own is None else own.rgba
    rgba = None if color is None else tuple(float(x) for x in np.clip(color, 0.0, 1.0))
    return Shape(link, is_visual, placement, kind, extent, mesh_file, rgba)  # type: ignore[arg-type]


def _own_package(folder: Path | None) -> tuple[Path, ...]:
    """The folder of the package that a document in this folder belongs to."""
    if folder is None:
        return ()
    marked = (above for above in (folder, *folder.parents) if is_file(above / "package.xml"))
    return (next(marked, folder.parent),)


def _is_mesh(path: Path, inside: Sequence[Path]) -> bool:
    """Return whether a path without `..`, or its link target, is a mesh file in one of the folders."""
    return (
        any(path.is_relative_to(os.path.normpath(folder)) for folder in inside)
        and path.suffix.lower() in MESH_SUFFIXES
        and is_file(path)
        and path.resolve().suffix.lower() in MESH_SUFFIXES
    )
