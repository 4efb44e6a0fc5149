"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

_PART = ".part"


@contextmanager
def whole_file(target: Path) -> Iterator[BinaryIO]:
    """Open a new file that takes its name when all of it is on the disk; until then what was there before stays.

    Args:
        target: Where to.
    """
    part = target.with_name(f"{target.name}.{uuid4().hex}{_PART}")
    try:
        with part.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        part.replace(target)
        _sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


def remove_parts(target: Path) -> None:
    """Remove what killed processes left of a file while they wrote it.

    Args:
        target: The file.
    """
    for part in target.parent.glob(f"{target.name}.*{_PART}"):
        part.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Bring the new name to the disk; where folders cannot be synchronised, it is there a little later."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
