"""The text of a robot description, and how it is read from a file."""

from __future__ import annotations

import os
import stat
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from ..._common.suggestions import suggest
from ...exceptions import ModelError
from .encoding import decoded
from .strict_xml import MAX_CHARACTERS
from .xacro_expansion import Reading, expand_xacro

SUFFIXES = (".urdf", ".xacro", ".xml")
"""How robot descriptions end, in lower case."""


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
        srdf: SRDF file that belongs to it, if there is one.
        posture: Name of the posture in it that the source calls the robot's reference; None where it names none.
        has_rotors: The SRDF file holds the rotors' inertias.
        notes: What is worth saying about the source.
    """

    text: str
    origin: str
    name: str | None = None
    folder: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    floating: bool = False
    srdf: Path | None = None
    posture: str | None = None
    has_rotors: bool = False
    notes: tuple[str, ...] = ()


def read_path(path: Path, reading: Reading) -> RobotText:
    """Read a URDF or xacro file.

    Args:
        path: The file.
        reading: What it is read with.

    Raises:
        ModelError: There is no such file, it cannot be read, or xacro cannot expand it.
    """
    text, notes = read_text(path, reading.repair)
    if path.suffix.lower() == ".xacro":
        text = expand_xacro(path, text, reading)
    elif reading.xacro_args:
        raise ModelError(f"xacro_args= is for .xacro files; '{path.name}' is none")
    beside = path.with_suffix(".srdf")
    return RobotText(
        text=text,
        origin=f"'{path.name}'",
        folder=path.absolute().parent,
        package_dirs=reading.folders,
        srdf=beside if is_file(beside) else None,
        notes=notes,
    )


def is_file(path: Path) -> bool:
    """Return whether the file exists; False for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path, repair: Collection[str] = ()) -> tuple[str, tuple[str, ...]]:
    """Read a regular file of bounded size, and say what was repaired; devices and pipes are never opened.

    Args:
        path: The file.
        repair: Names of the `REPAIRS` to make.

    Raises:
        ModelError: There is no such file, it cannot be read, or it is no text.
    """
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
        files = [file.name for file in path.parent.iterdir() if file.suffix.lower() in SUFFIXES]
    except (OSError, ValueError):
        return f": there is no folder '{path.parent}'"
    return suggest(path.name, files) if files else ""
