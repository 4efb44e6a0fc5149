"""The report as tables of the terminal and as markdown, and the page of the documentation that holds it."""

from __future__ import annotations

import math
from pathlib import Path

from rich.table import Table

from benchmarks import pages
from rbimpedance.cli.terminal import number, table
from rbimpedance.exceptions import InputError

from .report import Change, Report, Section

BEGIN, END = (
    "<!-- figures: written by `python -m benchmarks.speed --write docs` -->",
    "<!-- end of the figures -->",
)


def section_table(section: Section) -> Table:
    """Return a section as a table; the note last, where there is one."""
    header, rows = _cells(section)
    return table(section.title, header, rows)


def change_table(changes: list[Change], shown: int = 40) -> Table:
    """Return the ratios that changed most."""
    worst = sorted(changes, key=lambda change: -abs(math.log(abs(change.factor) or 1.0)))
    rows = [
        [
            f"{change.section}: {change.line}, {change.figure}",
            *(number(x) for x in (change.before, change.after, change.factor)),
        ]
        for change in worst[:shown]
    ]
    title = f"{len(changes)} ratios compared; those that changed most first"
    return table(title, ("ratio", "before", "after", "after / before"), rows)


def markdown(report: Report, figure: str) -> str:
    """Return the report as markdown.

    Args:
        report: The report.
        figure: Address of the figure, relative to the page.
    """
    parts = [pages.markdown(("", "measured on"), [list(x) for x in report.machine.items()])]
    parts.append(f"![Costs as ratios]({figure})")
    for section in report.sections:
        parts += [f"## {section.title}", section.text, pages.markdown(*_cells(section))]
    return "\n\n".join(parts)


def write(report: Report, page: Path, figure: str) -> None:
    """Replace what stands between the two marks of a page.

    Raises:
        InputError: There is no such page, or no marks in it.
    """
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"'{page}' must be a page with the lines\n{BEGIN}\n{END}")
    page.write_text(
        f"{before}{BEGIN}\n\n{markdown(report, figure)}\n\n{END}{after}", encoding="utf-8"
    )


def _cells(section: Section) -> tuple[tuple[str, ...], list[list[str]]]:
    columns, has_notes = section.columns, any(line.note for line in section.lines)
    header = ("", *columns, *(("note",) if has_notes else ()))
    rows = []
    for line in section.lines:
        cells = [_figure(line.figures.get(column)) for column in columns]
        rows.append([line.name, *cells, *((line.note,) if has_notes else ())])
    return header, rows


def _figure(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 1000.0 else number(value)
