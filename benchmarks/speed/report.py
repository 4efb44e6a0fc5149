"""What a benchmark found: sections of lines of named figures, as JSON and back, and compared with another run."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rbimpedance.exceptions import InputError

RATIO = "×"
"""Begins the name of a figure that is a ratio of two measurements of one run; such figures travel between machines."""


class Line(NamedTuple):
    """One line of a table.

    Attributes:
        name: What was measured.
        figures: Its figures by name, the unit in the name.
        note: What has to be known about it, or why there are no figures.
    """

    name: str
    figures: Mapping[str, float]
    note: str = ""


class Section(NamedTuple):
    """One table.

    Attributes:
        key: Its short name.
        title: Its title.
        text: What was measured and how.
        lines: The lines.
    """

    key: str
    title: str
    text: str
    lines: tuple[Line, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the figures, each once, in the order of their first appearance."""
        return tuple(dict.fromkeys(name for line in self.lines for name in line.figures))

    def line(self, name: str) -> Line:
        """Return the line of a name."""
        return next(line for line in self.lines if line.name == name)


class Report(NamedTuple):
    """One run of the benchmark.

    Attributes:
        machine: What it ran on, versions and date.
        sections: What was found.
    """

    machine: Mapping[str, str]
    sections: tuple[Section, ...]

    def section(self, key: str) -> Section | None:
        """Return the section of a short name, None where it was not measured."""
        return next((section for section in self.sections if section.key == key), None)

    def data(self) -> dict[str, Any]:
        """Return the report as plain JSON data; a figure that is not finite becomes None."""
        return {
            "machine": dict(self.machine),
            "sections": [
                section._asdict() | {"lines": [_plain(line) for line in section.lines]}
                for section in self.sections
            ],
        }

    def save(self, path: Path) -> None:
        """Write the report as JSON."""
        text = json.dumps(self.data(), indent=2, ensure_ascii=False, allow_nan=False)
        path.write_text(text + "\n", encoding="utf-8")


def load(path: Path) -> Report:
    """Read a report that `Report.save` wrote.

    Raises:
        InputError: It is no such file.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return Report(data["machine"], tuple(_section(section) for section in data["sections"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"'{path}' is not a report that `--save` wrote: {error}") from error


class Change(NamedTuple):
    """One ratio in two reports.

    Attributes:
        section: Short name of the section.
        line: Name of the line.
        figure: Name of the figure.
        before: Its value in the first report.
        after: Its value in the second.
    """

    section: str
    line: str
    figure: str
    before: float
    after: float

    @property
    def factor(self) -> float:
        """After over before."""
        return self.after / self.before if self.before else math.nan


def changes(before: Report, after: Report) -> Iterator[Change]:
    """Compare the ratios that two reports have in common; `RATIO` says why ratios only."""
    for section in after.sections:
        old = before.section(section.key)
        known = {} if old is None else {line.name: line.figures for line in old.lines}
        for line in section.lines:
            for figure, value in line.figures.items():
                if figure.startswith(RATIO) and figure in known.get(line.name, {}):
                    then = known[line.name][figure]
                    yield Change(section.key, line.name, figure, then, value)


def _plain(line: Line) -> dict[str, Any]:
    figures = {name: _finite(value) for name, value in line.figures.items()}
    return {"name": line.name, "figures": figures, "note": line.note}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _section(data: Mapping[str, Any]) -> Section:
    lines = tuple(
        Line(
            line["name"],
            {k: math.nan if x is None else float(x) for k, x in line["figures"].items()},
            line["note"],
        )
        for line in data["lines"]
    )
    return Section(data["key"], data["title"], data["text"], lines)
