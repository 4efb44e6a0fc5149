"""Where robot descriptions come from: files, xacro, bundled robots, example-robot-data and robot_descriptions.

A name means the first of: a bundled robot, a robot of example-robot-data, a module of robot_descriptions. Everything
here ends in the text of a URDF, raw_dynamics; `urdf_document` reads it.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import pkgutil
import stat
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..._common.suggestions import suggest
from ...exceptions import MissingExtraError, ModelError
from .encoding import decoded
from .strict_xml import MAX_CHARACTERS
from .wording import shortened
from .xacro_expansion import expand_xacro

_SUFFIXES = (".urdf", ".xacro", ".xml")
_KINDS_OF_SOURCE = (
    "a source is a path to a .urdf or .xacro file, the XML text itself, the name of a robot that is bundled or comes "
    "with example-robot-data or robot_descriptions, a yourdfpy.URDF, a pinocchio.Model or a RobotWrapper"
)


@dataclass(frozen=True)
class RobotText:
    """The text of a URDF and where it came from.

    Attributes:
        text: The XML text, raw_dynamics.
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


def read_source(
    source: object,
    package_dirs: str | Path | Sequence[str | Path] = (),
    repair: Collection[str] = (),
) -> RobotText:
    """Find and read the description that a source means.

    Args:
        source: Path, XML text, name, or a `yourdfpy.URDF`.
        package_dirs: Folders in which `package://` addresses are looked up.
        repair: Names of the `REPAIRS` to make; "encoding" is made here.

    Returns:
        The description's text.

    Raises:
        ModelError: There is no such file or name, or it cannot be read.
        MissingExtraError: A robot_descriptions name without that package installed.
    """
    folders = folders_of(package_dirs)
    if isinstance(source, Path):
        return _read_path(source, folders, repair)
    if isinstance(source, str):
        return _read_string(source, folders, repair)
    if hasattr(source, "write_xml_string"):
        return _read_yourdfpy(source, folders)
    raise ModelError(f"cannot load a robot from a {type(source).__name__}; {_KINDS_OF_SOURCE}")


def folders_of(package_dirs: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    """Return the folders that `package_dirs=` names.

    Raises:
        ModelError: It names none.
    """
    try:
        named = (package_dirs,) if isinstance(package_dirs, (str, Path)) else package_dirs
        return tuple(Path(folder) for folder in named)
    except TypeError as error:
        raise ModelError(f"package_dirs= takes folders, got {package_dirs!r}") from error


def runs_as_program(source: str) -> bool:
    """Whether reading this source runs what it holds: a xacro file, or a module of robot_descriptions.

    Args:
        source: A path or a name.
    """
    return Path(source).suffix.lower() == ".xacro" or source.endswith("_description")


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
    package = Path(__file__).parents[2]
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent.parent / "urdf"


def _read_string(source: str, folders: tuple[Path, ...], repair: Collection[str]) -> RobotText:
    if source.lstrip("\ufeff \t\r\n").startswith("<"):
        return RobotText(source, "the XML text", package_dirs=folders)
    if Path(source).suffix.lower() in _SUFFIXES or "/" in source or "\\" in source:
        return _read_path(Path(source), folders, repair)
    if source in bundled_names():
        path = bundled_urdf(source)
        return RobotText(_read_text(path)[0], f"'{source}'", source, path.parent, folders)
    if source in _example_robots():
        return _read_example_robot(source, folders)
    if source in _description_modules():
        return _read_robot_description(source, folders)
    if _is_file(Path(source)):
        return _read_path(Path(source), folders, repair)
    if source.endswith("_description") and importlib.util.find_spec("robot_descriptions") is None:
        raise MissingExtraError(
            f"the robot_descriptions name '{shortened(source)}'", "descriptions"
        )
    raise ModelError(
        f"no robot is called '{source}'{suggest(source, known_names())}; {_KINDS_OF_SOURCE}"
    )


def _read_path(path: Path, folders: tuple[Path, ...], repair: Collection[str] = ()) -> RobotText:
    text, notes = _read_text(path, repair)
    if path.suffix.lower() == ".xacro":
        text = expand_xacro(path, text)
    return RobotText(text, f"'{path.name}'", None, path.absolute().parent, folders, notes=notes)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _read_text(path: Path, repair: Collection[str] = ()) -> tuple[str, tuple[str, ...]]:
    """Read a regular file of bounded size, and say what was repaired; devices and pipes are never opened."""
    try:
        _check_regular(path, path.stat())
        content = _read_bytes(path)
    except ModelError:
        raise
    except FileNotFoundError as error:
        raise ModelError(f"there is no file '{path}'{_neighbours(path)}") from error
    except (OSError, ValueError) as error:
        raise ModelError(f"'{path}' cannot be read: {error}") from error
    if len(content) > MAX_CHARACTERS:
        raise ModelError(f"'{path}' has more than {MAX_CHARACTERS} bytes: that is no URDF")
    return decoded(content, f"'{path}'", repair)


def _read_bytes(path: Path) -> bytes:
    """Read a file that may have changed into a pipe or device meanwhile, without waiting for it."""
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        _check_regular(path, os.fstat(file.fileno()))
        return file.read(MAX_CHARACTERS + 1) or b""


def _check_regular(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise ModelError(f"'{path}' is {kind}; give the path of a .urdf or .xacro file")


def _neighbours(path: Path) -> str:
    """Suggest robot files of the same folder."""
    try:
        files = [file.name for file in path.parent.iterdir() if file.suffix.lower() in _SUFFIXES]
    except (OSError, ValueError):
        return f": there is no folder '{path.parent}'"
    return suggest(path.name, files) if files else ""


def _read_yourdfpy(urdf: Any, folders: tuple[Path, ...]) -> RobotText:
    try:
        text = urdf.write_xml_string()
        text = text.decode() if isinstance(text, bytes) else str(text)
    except Exception as error:
        raise ModelError(f"yourdfpy cannot write this URDF out: {error}") from error
    return RobotText(
        text,
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
        text=_read_text(models / file)[0],
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
