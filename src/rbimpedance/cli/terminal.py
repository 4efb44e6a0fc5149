"""What the command line shows: tables, progress bars, JSON."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table
from rich.text import Text

from .wording import as_options

SILENCE = 2.0
"""Longest time of work without a word, where stderr is no terminal [s]."""

_BETWEEN_LINES = 10.0  # of progress, there [s]
_REFRESH_TICKS = 100
_LONGEST_CELL = 40  # characters, beyond which a cell may be wrapped
_FRAME = 3  # characters of a column's padding and border

stdout = Console()
"""For results; colours only on a terminal and never against NO_COLOR."""

stderr = Console(stderr=True)
"""For progress and errors."""


def say(words: str) -> None:
    """Print a line on stderr, in the terms of the command line."""
    stderr.print(as_options(words), soft_wrap=True, markup=False)


def tell(words: str) -> None:
    """Print a result in words on stdout, in the terms of the command line."""
    stdout.print(as_options(words), soft_wrap=True, markup=False)


def explain(words: str) -> None:
    """Print what the names in a table mean, below it."""
    stdout.print(words, style="dim", markup=False, highlight=False)


@contextmanager
def progress(
    title: str, *, quiet: bool, every: int = _REFRESH_TICKS
) -> Iterator[Callable[[int, int], None]]:
    """Show progress on stderr; yields a callback (done, total).

    A bar with the time left in a terminal; elsewhere a line where work takes long, and another one every ten seconds.
    """
    if quiet:
        yield _nothing
    elif stderr.is_terminal:
        with _bar(title, every) as update:
            yield update
    else:
        with _lines(title) as update:
            yield update


def _nothing(_done: int, _total: int) -> None:
    """Show nothing."""


@contextmanager
def _bar(title: str, every: int) -> Iterator[Callable[[int, int], None]]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=stderr, transient=True) as bar:
        task = bar.add_task(escape(title), total=None)

        def update(done: int, total: int) -> None:
            if done % every == 0 or done == total:
                bar.update(task, completed=done, total=total)

        yield update


@contextmanager
def _lines(title: str) -> Iterator[Callable[[int, int], None]]:
    """A line after `SILENCE`, also from work that does not call back, and then one every `_BETWEEN_LINES`."""
    first = threading.Timer(SILENCE, say, (f"{title} ...",))
    first.daemon = True
    first.start()
    last = time.monotonic() + SILENCE

    def update(done: int, total: int) -> None:
        nonlocal last
        if done and time.monotonic() - last > _BETWEEN_LINES:
            last = time.monotonic()
            say(f"{title}: {done} of {total}")

    try:
        yield update
    finally:
        first.cancel()


def table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Build a table: the first column to the left, figures to the right; headers wrap, figures and names never."""
    built = Table(title=escape(title))
    for i, name in enumerate(header):
        cells = max((cell_len(row[i]) for row in rows), default=0)
        width = min(cells, _LONGEST_CELL)
        built.add_column(escape(name), justify="left" if i == 0 else "right", min_width=width)
    for row in rows:
        built.add_row(*(escape(cell) for cell in row))
    return built


def print_table(built: Table) -> None:
    """Print a table. Where it is too wide it continues below, with its first column repeated; a file has 80 columns."""
    stdout.print(f"[bold]{built.title}[/bold]", soft_wrap=True, highlight=False)
    room = stdout.width
    first, *rest = built.columns
    while rest:
        count = _count_that_fit(rest, room - _needed(first))
        columns, rest = [first, *rest[:count]], rest[count:]
        size = _widest if sum(map(_widest, columns)) < room else _needed
        part = Table()
        part.columns = [
            replace(column, _index=i, width=size(column) - _FRAME)
            for i, column in enumerate(columns)
        ]
        part.rows = built.rows
        stdout.print(part)


def _count_that_fit(columns: Sequence[Column], room: int) -> int:
    """How many of the columns fit into a width, at least one."""
    ends = np.cumsum([_needed(column) for column in columns])
    return max(1, int(np.searchsorted(ends, room - 1, side="right")))


def _needed(column: Column) -> int:
    """Width of a column whose header is wrapped, with its frame."""
    words = Text.from_markup(str(column.header)).plain.split()
    return max(column.min_width or 0, *map(cell_len, words), 0, 0) + _FRAME


def _widest(column: Column) -> int:
    """Width of a column of which nothing is wrapped, with its frame."""
    texts = [column.header, *column.cells]
    return max(cell_len(Text.from_markup(str(text)).plain) for text in texts) + _FRAME


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
