"""What a URDF says beside dynamics, read by yourdfpy: mesh files and materials. Nothing here decides about dynamics."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..exceptions import ModelError
from .robot_sources import RobotText
from .urdf_document import UrdfDocument, listed


@dataclass(frozen=True)
class Appearance:
    """What yourdfpy finds in a document.

    Attributes:
        links: Names of the links.
        joints: Names of the joints.
        mimicking: Names of the joints with a <mimic> element.
        materials: Names of the materials.
        mesh_files: Addresses of the mesh files as written.
    """

    links: tuple[str, ...]
    joints: tuple[str, ...]
    mimicking: tuple[str, ...]
    materials: tuple[str, ...]
    mesh_files: tuple[str, ...]


def read_appearance(xml: str) -> Appearance:
    """Read a document with yourdfpy, without loading meshes.

    Args:
        xml: The document as `read_xml` accepted it.

    Raises:
        ModelError: yourdfpy cannot read it.
    """
    import yourdfpy  # noqa: PLC0415  (takes a second)

    logger = logging.getLogger("yourdfpy.urdf")
    is_disabled, logger.disabled = logger.disabled, True
    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(xml.encode()), load_meshes=False, build_scene_graph=False
        ).robot
    except Exception as error:
        raise ModelError(f"visuals cannot be read ({error})") from error
    finally:
        logger.disabled = is_disabled
    return Appearance(
        links=tuple(link.name for link in robot.links),
        joints=tuple(joint.name for joint in robot.joints),
        mimicking=tuple(joint.name for joint in robot.joints if joint.mimic is not None),
        materials=tuple(material.name for material in robot.materials),
        mesh_files=tuple(dict.fromkeys(_mesh_files(robot))),
    )


def find_mesh(address: str, text: RobotText) -> Path | None:
    """Return the file that a mesh address means, or None where there is none.

    Args:
        address: As written: `package://name/...`, `file://...`, or a path relative to the document.
        text: Where the document came from.
    """
    scheme, _, rest = address.rpartition("://")
    above = () if text.folder is None else (text.folder, *text.folder.parents)
    if scheme == "package":
        places = [
            folder / part
            for folder in (*text.package_dirs, *above)
            for part in _package_paths(rest)
        ]
    elif scheme in ("", "file"):
        places = [folder / rest for folder in (*above[:1], *text.package_dirs)]
    else:
        return None
    return next((place for place in places if place.is_file()), None)


def appearance_notes(document: UrdfDocument, text: RobotText) -> tuple[str, ...]:
    """Hold the document against yourdfpy's reading and say which meshes are not there.

    Raises:
        ModelError: yourdfpy finds other links, joints or mimicking joints than `parse_urdf`.
    """
    try:
        appearance = read_appearance(document.xml)
    except ModelError as error:
        return (f"{error}: this matters for pictures only",)
    movable = set(document.movable())
    for kind, found, read in (
        ("links", set(appearance.links), {link.name for link in document.links}),
        ("joints", set(appearance.joints), {joint.name for joint in document.joints}),
        ("mimicking joints", movable.intersection(appearance.mimicking), set(document.mimics())),
    ):
        if found != read:
            names = listed(sorted(found ^ read))
            raise ModelError(
                f"{text.origin}: the {kind} {names} are read in one way and not in another"
            )
    missing = [address for address in appearance.mesh_files if find_mesh(address, text) is None]
    if not missing:
        return ()
    return (
        f"{len(missing)} of {len(appearance.mesh_files)} mesh files are not there ({listed(missing, 2)}): this matters "
        "for pictures only; name their folder with package_dirs=",
    )


def _mesh_files(robot: Any) -> Iterator[str]:
    for link in robot.links:
        for shape in (*link.visuals, *link.collisions):
            if shape.geometry is not None and shape.geometry.mesh is not None:
                yield str(shape.geometry.mesh.filename)


def _package_paths(rest: str) -> tuple[str, ...]:
    """`name/path` as it stands, and `path` alone where the folder given is the package itself."""
    name, _, path = rest.partition("/")
    return (rest, path) if path and name else (rest,)
