"""What the command line shows: tables, progress bars, JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

_REFRESH_TICKS = 100

stdout = Console()
"""For results; colours only on a terminal and never against NO_COLOR."""

stderr = Console(stderr=True)
"""For progress and errors."""


@contextmanager
def progress(title: str, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with the time left on stderr; yields a callback (done, total)."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=stderr, transient=True, disable=quiet) as bar:
        task = bar.add_task(title, total=None)

        def update(done: int, total: int) -> None:
            if done % _REFRESH_TICKS == 0 or done == total:
                bar.update(task, completed=done, total=total)

        yield update


def table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Build a table: the first column to the left, figures to the right."""
    built = Table(title=escape(title), title_justify="left")
    for i, name in enumerate(header):
        built.add_column(escape(name), justify="left" if i == 0 else "right", no_wrap=i > 0)
    for row in rows:
        built.add_row(*(escape(cell) for cell in row))
    return built


def print_table(built: Table) -> None:
    """Print a table; where stdout is no terminal it takes the width that it needs."""
    if not sys.stdout.isatty():
        stdout.width = max(stdout.width, 200)
    stdout.print(built)


def print_json(data: Mapping[str, Any]) -> None:
    """Print plain JSON: arrays become lists, infinite and missing numbers null."""
    print(json.dumps(_plain(data), indent=2, allow_nan=False))


def number(value: float, digits: int = 3) -> str:
    """Write a figure with a few significant digits; infinite ones as a dash."""
    return f"{value:.{digits}g}" if np.isfinite(value) else "–"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    return value
