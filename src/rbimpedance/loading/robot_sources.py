"""Where robot descriptions come from: files, xacro, bundled robots, example-robot-data and robot_descriptions.

A name means the first of: a bundled robot, a robot of example-robot-data, a module of robot_descriptions. Everything
here ends in the text of a URDF, unchecked; `urdf_document` reads it.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._suggestions import suggest
from ..exceptions import MissingExtraError, ModelError
from .strict_xml import MAX_CHARACTERS, has_doctype

_SUFFIXES = (".urdf", ".xacro", ".xml")
_KINDS_OF_SOURCE = (
    "a source is a path to a .urdf or .xacro file, the XML text itself, the name of a robot that is bundled or comes "
    "with example-robot-data or robot_descriptions, a yourdfpy.URDF, a pinocchio.Model or a RobotWrapper"
)


@dataclass(frozen=True)
class RobotText:
    """The text of a URDF and where it came from.

    Attributes:
        text: The XML text, unchecked.
        origin: Where it came from, for errors.
        name: Name of the robot where the source gives one; else the document's own is used.
        folder: Folder that relative mesh files refer to; None for text.
        package_dirs: Folders in which `package://` addresses are looked up.
        floating: The source sees the robot on a floating base.
        rotors: SRDF file with the rotors' inertias, if there is one.
        notes: What is worth saying about the source.
    """

    text: str
    origin: str
    name: str | None = None
    folder: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    floating: bool = False
    rotors: Path | None = None
    notes: tuple[str, ...] = ()


def read_source(source: object, package_dirs: str | Path | Sequence[str | Path] = ()) -> RobotText:
    """Find and read the description that a source means.

    Args:
        source: Path, XML text, name, or a `yourdfpy.URDF`.
        package_dirs: Folders in which `package://` addresses are looked up.

    Returns:
        The description's text.

    Raises:
        ModelError: There is no such file or name, or it cannot be read.
        MissingExtraError: A robot_descriptions name without that package installed.
    """
    named = (package_dirs,) if isinstance(package_dirs, (str, Path)) else package_dirs
    folders = tuple(Path(folder) for folder in named)
    if isinstance(source, Path):
        return _read_path(source, folders)
    if isinstance(source, str):
        return _read_string(source, folders)
    if hasattr(source, "write_xml_string"):
        return _read_yourdfpy(source, folders)
    raise ModelError(f"cannot load a robot from a {type(source).__name__}; {_KINDS_OF_SOURCE}")


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


def known_names() -> tuple[str, ...]:
    """Every robot name that `load_robot` knows here, sorted, without downloading anything."""
    return tuple(sorted({*bundled_names(), *_example_robots(), *_description_modules()}))


def _bundled_folder() -> Path:
    """The folder of the bundled robots: inside the package in a wheel, else at the top of the checkout."""
    package = Path(__file__).parents[1]
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent.parent / "urdf"


def _read_string(source: str, folders: tuple[Path, ...]) -> RobotText:
    if source.lstrip("\ufeff \t\r\n").startswith("<"):
        return RobotText(source, "the XML text", package_dirs=folders)
    if Path(source).suffix.lower() in _SUFFIXES or "/" in source or "\\" in source:
        return _read_path(Path(source), folders)
    if source in bundled_names():
        path = bundled_urdf(source)
        return RobotText(_read_text(path), f"'{source}'", source, path.parent, folders)
    if source in _example_robots():
        return _read_example_robot(source, folders)
    if source in _description_modules():
        return _read_robot_description(source, folders)
    if _is_file(Path(source)):
        return _read_path(Path(source), folders)
    if source.endswith("_description") and importlib.util.find_spec("robot_descriptions") is None:
        raise MissingExtraError(f"the robot_descriptions name '{source}'", "descriptions")
    raise ModelError(
        f"no robot is called '{source}'{suggest(source, known_names())}; {_KINDS_OF_SOURCE}"
    )


def _read_path(path: Path, folders: tuple[Path, ...]) -> RobotText:
    text = _read_text(path)
    if path.suffix.lower() == ".xacro":
        text = _expand_xacro(path, text)
    return RobotText(text, f"'{path.name}'", None, path.absolute().parent, folders)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _read_text(path: Path) -> str:
    """Read a regular file of bounded size as UTF-8; devices and pipes are never opened."""
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
            raise ModelError(f"'{path}' is {kind}; give the path of a .urdf or .xacro file")
        with path.open("rb") as file:
            content = file.read(MAX_CHARACTERS + 1)
    except FileNotFoundError as error:
        raise ModelError(f"there is no file '{path}'{_neighbours(path)}") from error
    except (OSError, ValueError) as error:
        raise ModelError(f"'{path}' cannot be read: {error}") from error
    if len(content) > MAX_CHARACTERS:
        raise ModelError(f"'{path}' has more than {MAX_CHARACTERS} bytes: that is no URDF")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ModelError(
            f"'{path}' is not UTF-8 text (byte {error.start}); save it as UTF-8"
        ) from error


def _neighbours(path: Path) -> str:
    """Suggest robot files of the same folder."""
    try:
        files = [file.name for file in path.parent.iterdir() if file.suffix.lower() in _SUFFIXES]
    except (OSError, ValueError):
        return f": there is no folder '{path.parent}'"
    return suggest(path.name, files) if files else ""


def _expand_xacro(path: Path, text: str) -> str:
    import xacro  # noqa: PLC0415  (on demand)

    if has_doctype(text):
        raise ModelError(f"'{path.name}' declares a DOCTYPE; a xacro file needs none: remove it")
    try:
        return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # xacro evaluates expressions, so anything can come out of it
        raise ModelError(
            f"xacro cannot expand '{path.name}': {type(error).__name__}: {error}. Where it needs ROS packages or "
            f"arguments, expand it there with `xacro {path.name} > robot.urdf`"
        ) from error


def _read_yourdfpy(urdf: Any, folders: tuple[Path, ...]) -> RobotText:
    try:
        text = urdf.write_xml_string()
    except Exception as error:
        raise ModelError(f"yourdfpy cannot write this URDF out: {error}") from error
    return RobotText(
        text.decode() if isinstance(text, bytes) else str(text),
        "the yourdfpy.URDF",
        package_dirs=folders,
    )


def _example_robots() -> dict[str, Any]:
    """Loader classes of example-robot-data by name; none where it is not usable."""
    try:
        module = importlib.import_module("example_robot_data.robots_loader")
    except ImportError:
        return {}
    return dict(module.ROBOTS)


def _read_example_robot(name: str, folders: tuple[Path, ...]) -> RobotText:
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
            f"the files of '{name}' are not there ({error}): install example-robot-data beside its loaders"
        ) from error
    notes: tuple[str, ...] = ()
    if loader.__init__ is not data.RobotLoader.__init__:
        notes = (
            "example-robot-data changes this robot in code after reading; here its file stands as it is",
        )
    rotors = models / loader.path / loader.srdf_subpath / loader.srdf_filename
    return RobotText(
        text=_read_text(models / file),
        origin=f"'{name}' of example-robot-data",
        name=name,
        folder=(models / file).parent,
        package_dirs=(*folders, models.parent.parent),
        floating=loader.free_flyer,
        rotors=rotors if loader.has_rotor_parameters else None,
        notes=notes,
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
        if module.name.endswith("_description") and not module.name.startswith("_")
    )


def _read_robot_description(name: str, folders: tuple[Path, ...]) -> RobotText:
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
    text = _read_path(Path(path), (*folders, *packages))
    return RobotText(
        text.text, f"'{name}' of robot_descriptions", name, text.folder, text.package_dirs
    )
