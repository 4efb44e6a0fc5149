"""Rows as a table: its columns, and Parquet files of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .._common.files import whole_file
from ..exceptions import MissingExtraError
from .measures import Figures

if TYPE_CHECKING:
    import pyarrow as pa

INPUT = "input_"
"""What the columns of what was drawn begin with."""

COLUMNS = {
    "study": "string",
    "robot": "string",
    "disturbance": "string",
    "sample": "int64",
    "controller": "string",
    "seed": "int64",
    "status": "string",
    "reason": "string",
    "diverged_at": "float64",
    "e1_max": "float64",
    "e1_rms": "float64",
    "e1_end": "float64",
    "e_im_max": "float64",
    "e_im_rms": "float64",
    "deviation_max": "float64",
    "deviation_rms": "float64",
    "worst_joint": "string",
    "tau_variation": "float64",
    "tau_peak": "float64",
    "tau_rms": "float64",
    "saturated": "float64",
    "version_rbimpedance": "string",
    "version_pin": "string",
    "version_numpy": "string",
    "version_python": "string",
}
"""Kind of every column but the inputs, which are numbers and come last."""


def arrow() -> ModuleType:
    """Return the module `pyarrow` with `pyarrow.compute` and `pyarrow.parquet`.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415 (an extra)
        import pyarrow.compute  # noqa: PLC0415
        import pyarrow.parquet  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtraError("a study's table", "study") from error
    module: ModuleType = pa
    return module


def as_table(rows: Sequence[Figures]) -> pa.Table:
    """Return rows as a table; what a row does not have is null there.

    Args:
        rows: In the order of the table.
    """
    pa = arrow()
    drawn = dict.fromkeys(name for row in rows for name in row if name.startswith(INPUT))
    kinds = COLUMNS | dict.fromkeys(drawn, "float64")
    schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in kinds.items()])
    return pa.Table.from_pylist(list(rows), schema)


def write(table: pa.Table, path: Path) -> None:
    """Write a table as a Parquet file that appears whole or not at all.

    Args:
        table: The table.
        path: Where to.
    """
    with whole_file(path) as file:
        arrow().parquet.write_table(table, file, compression="zstd")


def read_rows(path: Path) -> list[Figures] | None:
    """Return the rows of a Parquet file, without what is null; None where there is no sound file.

    Args:
        path: The file.
    """
    pa = arrow()
    try:
        rows: list[dict[str, Any]] = pa.parquet.read_table(path).to_pylist()
    except (OSError, pa.ArrowException):
        return None
    return [{k: value for k, value in row.items() if value is not None} for row in rows]


def file_name(words: Iterable[str]) -> str:
    """Return names as one that every file system takes.

    Args:
        words: The names.
    """
    return "-".join(re.sub(r"[^A-Za-z0-9_]+", "_", word) for word in words)
