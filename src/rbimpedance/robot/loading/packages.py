"""Where ROS packages are: in given folders, next to a file, and where AMENT_PREFIX_PATH and ROS_PACKAGE_PATH point.

The standard library alone: the process that expands xacro loads this file without the rest of the library.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

MAX_FOLDERS = 5000
"""Most folders that are entered in the search for packages below one folder."""

_MAX_DEPTH = 5
_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


class Packages:
    """Finds packages by name: as given, below the given folders, next to the file, where the environment points.

    Args:
        folders: Folders that are a package, hold packages, or hold folders that do.
        file: The file whose own package and its neighbours count too.
        known: Folders of packages by name.
    """

    def __init__(
        self,
        folders: Sequence[Path] = (),
        file: Path | None = None,
        known: Mapping[str, str] | None = None,
    ) -> None:
        self._known = dict(known or {})
        self._searched = (*folders, *environment_folders())
        self._above = () if file is None else tuple(file.absolute().parents)
        self._below: dict[Path, dict[str, Path]] = {}

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None where there is none.

        Args:
            name: Name of the package.
        """
        if name in self._known:
            return Path(self._known[name])
        if not name or name in (".", "..") or "/" in name:
            return None
        beside = (folder / name for folder in (*self._searched, *self._above))
        deeper = (self._packages_below(folder).get(name) for folder in self._searched)
        return next((place for place in chain(beside, deeper) if place and place.is_dir()), None)

    def _packages_below(self, folder: Path) -> dict[str, Path]:
        if folder not in self._below:
            self._below[folder] = dict(_packages(folder))
        return self._below[folder]


def environment_folders() -> tuple[Path, ...]:
    """Folders with packages by AMENT_PREFIX_PATH (ROS 2) and ROS_PACKAGE_PATH (ROS 1)."""
    prefixes = [Path(p) / "share" for p in _listed("AMENT_PREFIX_PATH")]
    return (*prefixes, *(Path(p) for p in _listed("ROS_PACKAGE_PATH")))


def _listed(variable: str) -> list[str]:
    return [part for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _packages(top: Path) -> Iterator[tuple[str, Path]]:
    """Names and folders of the packages in a folder and below, the outer ones last: they win."""
    found = []
    for count, (folder, below, files) in enumerate(os.walk(top)):
        depth = len(Path(folder).relative_to(top).parts)
        if "package.xml" in files:
            found.append((_name_of(Path(folder)), Path(folder)))
        if depth >= _MAX_DEPTH or "package.xml" in files or count > MAX_FOLDERS:
            below.clear()
        below[:] = sorted(name for name in below if not name.startswith("."))
    yield from reversed(found)


def _name_of(folder: Path) -> str:
    """The name that a package.xml gives, else that of its folder."""
    try:
        with (folder / "package.xml").open(encoding="utf-8", errors="replace") as file:
            named = _NAME.search(file.read(100_000))
    except OSError:
        named = None
    return named[1] if named else folder.name
