"""Which reader and writer a file gets: by its ending, or by what a folder holds."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from ..exceptions import LogError, MissingExtraError
from .findings import LogFinding
from .samples import Samples

Read = tuple[Samples, tuple[LogFinding, ...]]
"""What a reader returns."""

READERS = {
    ".mcap": "ros_bags",
    ".db3": "ros_bags",
    ".bag": "ros_bags",
    ".csv": "tables",
    ".parquet": "tables",
    ".npz": "archives",
}
"""The module of this room that reads files with an ending."""

WRITERS = {".mcap": "mcap_writer", ".csv": "tables", ".parquet": "tables", ".npz": "archives"}
"""The module that writes them."""


class Wanted(NamedTuple):
    """What a reader is to look for.

    Attributes:
        joints: Names of the joints, or None for all.
        topics: Topics by "joints", "external" and "wrench".
        episode: Which episode of a data set, or None.
    """

    joints: tuple[str, ...] | None
    topics: Mapping[str, str]
    episode: int | None


def read(path: Path, wanted: Wanted) -> Read:
    """Return the samples of a file or folder, and what was found while reading.

    Args:
        path: The file or folder.
        wanted: What to look for.

    Raises:
        LogError: It is missing, of an unknown kind, or damaged.
        MissingExtraError: The library that reads it is not installed.
    """
    if not path.exists():
        raise LogError(str(path), "no such file or folder", "give the path of a log")
    found: Read = _module(_kind(path), path).read(path, wanted)
    return found


def write(path: Path, samples: Samples) -> Path:
    """Write samples, and return the path.

    Args:
        path: Where to.
        samples: What to write.

    Raises:
        LogError: An ending that no writer has.
        MissingExtraError: The library that writes it is not installed.
    """
    name = WRITERS.get(path.suffix)
    if name is None:
        raise LogError(
            str(path), f"cannot write '{path.suffix}'", f"the ending is one of {', '.join(WRITERS)}"
        )
    _module(name, path).write(path, samples)
    return path


def _kind(path: Path) -> str:
    if path.is_dir():
        if (path / "meta" / "info.json").exists():
            return "lerobot"
        if (path / "metadata.yaml").exists():
            return "ros_bags"
        remedy = "a folder is a rosbag2 (metadata.yaml) or a LeRobot data set (meta/info.json)"
        raise LogError(str(path), "a folder of an unknown kind", remedy)
    if path.suffix not in READERS:
        raise LogError(
            str(path), f"cannot read '{path.suffix}'", f"the ending is one of {', '.join(READERS)}"
        )
    return READERS[path.suffix]


def _module(name: str, path: Path) -> ModuleType:
    try:
        return importlib.import_module(f"{__package__}.{name}")
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("rbimpedance"):
            raise
        raise MissingExtraError(f"'{path.suffix or path.name}' as a log", "logs") from error
