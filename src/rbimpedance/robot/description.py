"""Where an arm came from: what its dynamics do not need, and its pictures do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Description:
    """The text behind an arm, and how to load it again.

    Attributes:
        xml: The URDF.
        folder: Folder that relative mesh files refer to; None for a text without a file.
        package_dirs: Folders in which `package://` addresses of meshes are looked up.
        recipe: Arguments with which `load_robot` finds the same links and joints again, as plain JSON data; None where
            the source has no name and no path.
    """

    xml: str
    folder: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    recipe: Mapping[str, Any] | None = field(default=None, compare=False)
