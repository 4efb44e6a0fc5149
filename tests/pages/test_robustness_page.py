"""No number of docs/robustness.md is typed by hand: the tables are what the benchmark makes of its figures."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.tuning.robustness import PARTS

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures" / "robustness.json"
PAGES = [(ROOT / "docs" / name).read_text("utf-8") for name in ("robustness.md", "interaction.md")]


def test_every_part_was_measured_with_one_seed() -> None:
    measured = json.loads(FIGURES.read_text("utf-8"))
    assert measured.keys() == PARTS.keys()
    assert len({part["seed"] for part in measured.values()}) == 1


def test_tables_are_those_of_the_measured_figures() -> None:
    measured = json.loads(FIGURES.read_text("utf-8"))
    for name, figures in measured.items():
        for place, table in PARTS[name].tables(figures).items():
            wanted = f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->"
            assert any(wanted in page for page in PAGES), place
