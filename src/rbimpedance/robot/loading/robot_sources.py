"""Where robot descriptions come from: files, xacro, bundled robots, example-robot-data and robot_descriptions.

`SOURCES` lists where names come from, in the order in which they are looked up. Everything here ends in the text of a
URDF, unchecked; `urdf_document` reads it.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ..._common.suggestions import suggest
from ...exceptions import MissingExtraError, ModelError
from .robot_nicknames import suggest_robot
from .robot_text import SUFFIXES, RobotText, is_file, read_path
from .wording import shortened
from .xacro_expansion import Reading, xacro_arguments

_KINDS_OF_SOURCE = (
    "a source is a path to a .urdf or .xacro file, the XML text itself, the name of a robot that is bundled or comes "
    "with example-robot-data or robot_descriptions, a yourdfpy.URDF, a pinocchio.Model or a RobotWrapper"
)

_MODULE = "_description"
"""How the names of robot_descriptions end."""


def read_source(
    source: object,
    folders: tuple[Path, ...] = (),
    repair: Collection[str] = (),
    xacro_args: Mapping[str, object] | None = None,
) -> RobotText:
    """Find and read the description that a source means.

    Args:
        source: Path, XML text, name, or a `yourdfpy.URDF`.
        folders: Folders in which `package://` addresses and $(find package) are looked up.
        repair: Names of the `REPAIRS` to make; "encoding" is made here.
        xacro_args: Values of a xacro file's arguments.

    Returns:
        The description's text.

    Raises:
        ModelError: There is no such file or name, or it cannot be read.
        MissingExtraError: A robot_descriptions name without that package installed.
    """
    reading = Reading(folders, repair, xacro_arguments(xacro_args))
    if isinstance(source, Path):
        return read_path(source, reading)
    if isinstance(source, str):
        return _read_string(source, reading)
    if hasattr(source, "write_xml_string"):
        return _read_yourdfpy(source, reading)
    raise ModelError(f"cannot load a robot from a {type(source).__name__}; {_KINDS_OF_SOURCE}")


def runs_as_program(source: str) -> bool:
    """Whether reading this source runs what it holds: a xacro file, or a module of robot_descriptions.

    The viewer relies on it before it reads what a stranger's result names.

    Args:
        source: A path or a name.
    """
    return Path(source).suffix.lower() == ".xacro" or source.endswith(_MODULE)


def bundled_names() -> tuple[str, ...]:
    """Names of the robots that come with this library."""
    return tuple(sorted(path.stem for path in _bundled_folder().glob("*.urdf")))


def bundled_urdf(name: str) -> Path:
    """Return the URDF file of a bundled robot.

    Args:
        name: One of `bundled_names()`.

    Raises:
        ModelError: No such robot.
    """
    if name not in bundled_names():
        raise ModelError(f"no bundled robot is called '{name}'{suggest(name, bundled_names())}")
    return _bundled_folder() / f"{name}.urdf"


def names_by_source() -> dict[str, tuple[str, ...]]:
    """Every robot name that `load_robot` knows here, sorted, by where it comes from; nothing is downloaded."""
    return {source.title: source.names() for source in SOURCES}


def known_names() -> tuple[str, ...]:
    """Every robot name that `load_robot` knows here, sorted."""
    return tuple(sorted({name for names in names_by_source().values() for name in names}))


def _bundled_folder() -> Path:
    """The folder of the bundled robots: inside the package in a wheel, else at the top of the checkout."""
    package = Path(__file__).parents[2]
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent.parent / "urdf"


def _read_string(source: str, reading: Reading) -> RobotText:
    if source.lstrip("\ufeff \t\r\n").startswith("<"):
        return RobotText(_plain(source, reading), "the XML text", package_dirs=reading.folders)
    if Path(source).suffix.lower() in SUFFIXES or "/" in source or "\\" in source:
        return read_path(Path(source), reading)
    for place in SOURCES:
        if source in place.names():
            return place.read(source, reading)
    if is_file(Path(source)):
        return read_path(Path(source), reading)
    if source.endswith(_MODULE) and importlib.util.find_spec("robot_descriptions") is None:
        raise MissingExtraError(
            f"the robot_descriptions name '{shortened(source)}'", "descriptions"
        )
    files = [source + suffix for suffix in SUFFIXES if is_file(Path(source + suffix))]
    near = f"; did you mean '{files[0]}'" if files else suggest_robot(source, known_names())
    raise ModelError(f"no robot is called '{source}'{near.removesuffix('?')}; {_KINDS_OF_SOURCE}")


def _read_bundled(name: str, reading: Reading) -> RobotText:
    return replace(read_path(bundled_urdf(name), reading), origin=f"'{name}'", name=name)


def _plain(text: str, reading: Reading) -> str:
    if reading.xacro_args:
        raise ModelError("xacro_args= is for .xacro files: only a file is expanded, not XML text")
    return text


def _read_yourdfpy(urdf: Any, reading: Reading) -> RobotText:
    try:
        text = urdf.write_xml_string()
        text = text.decode() if isinstance(text, bytes) else str(text)
    except Exception as error:
        raise ModelError(f"yourdfpy cannot write this URDF out: {error}") from error
    return RobotText(_plain(text, reading), "the yourdfpy.URDF", package_dirs=reading.folders)


def _example_robots() -> dict[str, Any]:
    """Loader classes of example-robot-data by name; none where it is not usable."""
    try:
        module = importlib.import_module("example_robot_data.robots_loader")
    except ImportError:
        return {}
    return dict(module.ROBOTS)


def _example_names() -> tuple[str, ...]:
    return tuple(sorted(_example_robots()))


def _read_example_robot(name: str, reading: Reading) -> RobotText:
    loader = _example_robots()[name]
    if not loader.urdf_filename:
        raise ModelError(
            f"example-robot-data describes '{name}' as SDF, and only URDF is read; "
            "build a pinocchio.Model of it and pass that"
        )
    data = importlib.import_module("example_robot_data.utils")
    file = Path(loader.path) / loader.urdf_subpath / loader.urdf_filename
    try:
        models = Path(loader.model_path or data.getModelPath(str(file)))
    except OSError as error:
        raise ModelError(
            f"the files of '{name}' are missing ({error}): install example-robot-data together with its loaders"
        ) from error
    text = read_path(models / file, replace(reading, repair=()))
    srdf = models / loader.path / loader.srdf_subpath / (loader.srdf_filename or "none")
    return replace(
        text,
        origin=f"'{name}' of example-robot-data",
        name=name,
        package_dirs=(*reading.folders, models.parent.parent),
        floating=loader.free_flyer,
        srdf=srdf if is_file(srdf) else None,
        posture=loader.ref_posture,
        has_rotors=loader.has_rotor_parameters,
        notes=_changed_in_code(loader, data),
    )


def _changed_in_code(loader: Any, data: Any) -> tuple[str, ...]:
    if loader.__init__ is data.RobotLoader.__init__:
        return ()
    return (
        "example-robot-data changes this robot in code after reading; here its file is used unchanged",
    )


def _description_modules() -> tuple[str, ...]:
    """Names of the modules of robot_descriptions that may hold a URDF; none where it is not installed."""
    spec = importlib.util.find_spec("robot_descriptions")
    if spec is None:
        return ()
    modules = pkgutil.iter_modules(spec.submodule_search_locations)
    return tuple(
        module.name
        for module in modules
        if module.name.endswith(_MODULE) and not module.name.startswith("_")
    )


def _read_robot_description(name: str, reading: Reading) -> RobotText:
    try:
        module = importlib.import_module(f"robot_descriptions.{name}")  # clones a repository
    except Exception as error:
        raise ModelError(
            f"robot_descriptions cannot fetch '{name}': {str(error).strip() or type(error).__name__}"
        ) from error
    path = getattr(module, "URDF_PATH", None) or getattr(module, "XACRO_PATH", None)
    if path is None:
        raise ModelError(f"'{name}' of robot_descriptions holds no URDF")
    roots = [getattr(module, key, None) for key in ("PACKAGE_PATH", "REPOSITORY_PATH")]
    packages = [place for root in roots if root for place in (Path(root).parent, Path(root))]
    text = read_path(
        Path(path),
        replace(
            reading,
            folders=(*reading.folders, *packages),
            xacro_defaults=xacro_arguments(getattr(module, "XACRO_ARGS", None)),
            packages=dict(getattr(module, "XACRO_PACKAGE_PATHS", {})),
        ),
    )
    srdf = getattr(module, "SRDF_PATH", None)
    return replace(
        text,
        origin=f"'{name}' of robot_descriptions",
        name=name,
        srdf=text.srdf if srdf is None else Path(srdf),
    )


class NamedSource(NamedTuple):
    """Where robots have names.

    Attributes:
        title: What `rbimpedance robots` calls it.
        names: Gives all names, sorted; none where it is not installed. Nothing is downloaded.
        read: Reads the description of one of them. It sets `RobotText.name`, by which a saved run finds the robot
            again; where it may run a program, `runs_as_program` has to know the name.
    """

    title: str
    names: Callable[[], tuple[str, ...]]
    read: Callable[[str, Reading], RobotText]


SOURCES = (
    NamedSource("bundled", bundled_names, _read_bundled),
    NamedSource("example-robot-data", _example_names, _read_example_robot),
    NamedSource("robot_descriptions", _description_modules, _read_robot_description),
)
"""A name means the first of these that has it; `load_robot` reads it, `rbimpedance robots` lists it."""
