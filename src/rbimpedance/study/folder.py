"""The folder of a study: what it has so far, what it is of, and its table when all is there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._common.files import remove_parts, whole_file
from ..exceptions import RBImpedanceError
from .definition import Study
from .identity import differences, identity
from .measures import Figures
from .table import as_table, file_name, read_rows, write

if TYPE_CHECKING:
    import pyarrow as pa

FORMAT = "rbimpedance study 1"
"""What a manifest begins with."""

MANIFEST = "manifest.json"
"""Its name: what the folder is of."""

Chunk = tuple[str, str]
"""Robot and disturbance."""


class StudyError(RBImpedanceError, ValueError):
    """A folder that holds something else, or a study that cannot be found; the message says what."""


class StudyFolder:
    """Parts of a study that are done, each a file, and the manifest that says of which study.

    Args:
        study: The study.
        path: The folder; it is made where it is not there.

    Raises:
        StudyError: The folder is of another study.
    """

    def __init__(self, study: Study, path: Path) -> None:
        self.study, self.path = study, path
        self._identity = json.loads(json.dumps(identity(study)))
        self._check()
        (path / "parts").mkdir(parents=True, exist_ok=True)
        remove_parts(path / MANIFEST)
        data = {"format": FORMAT, "study": self._identity}
        with whole_file(path / MANIFEST) as file:
            file.write((json.dumps(data, indent=1) + "\n").encode())

    def rows(self, chunk: Chunk) -> list[Figures] | None:
        """Return the rows of a chunk that is done; None where it is not, or its file is damaged.

        Args:
            chunk: Robot and disturbance.
        """
        rows = read_rows(self._part(chunk))
        whole = rows is not None and len(rows) == self.study.runs_per_chunk
        return rows if whole else None

    def keep(self, chunk: Chunk, rows: list[Figures]) -> None:
        """Write what came of a chunk.

        Args:
            chunk: Robot and disturbance.
            rows: Its rows.
        """
        remove_parts(self._part(chunk))
        write(as_table(rows), self._part(chunk))

    def finish(self, lost: Mapping[Chunk, list[Figures]]) -> pa.Table:
        """Write the table of all chunks in the study's order, and return it.

        Args:
            lost: Rows of the chunks that have no file.
        """
        rows: list[Figures] = []
        for chunk in self.study.chunks:
            rows += lost[chunk] if chunk in lost else self.rows(chunk) or []
        table = as_table(rows)
        write(table, self.path / f"{self.study.name}.parquet")
        return table

    def _part(self, chunk: Chunk) -> Path:
        i = self.study.chunks.index(chunk)
        return self.path / "parts" / f"{i:04d}-{file_name(chunk)}.parquet"

    def _check(self) -> None:
        there = self._manifest()
        if not there:
            return
        other = there.get("study", {})
        names = differences(other, self._identity)
        if there.get("format") != FORMAT or names:
            raise StudyError(
                f"'{self.path}' holds a different study: it differs from '{self.study.name}' in "
                f"{', '.join(names) or 'format'}. Use another folder, or delete that study"
            )

    def _manifest(self) -> dict[str, Any]:
        path = self.path / MANIFEST
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return {}
        try:
            found = json.loads(text)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise StudyError(f"'{path}' is not the manifest of a study")
        return found
