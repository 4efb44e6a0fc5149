"""No number of docs/robustness.md is typed by hand: the tables are what the benchmark makes of its figures."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures" / "robustness.json"
PAGES = [(ROOT / "docs" / name).read_text("utf-8") for name in ("robustness.md", "interaction.md")]


@pytest.fixture(scope="module")
def parts() -> Any:
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        return importlib.import_module("robustness_parts").PARTS
    finally:
        sys.path.pop(0)


def test_every_part_was_measured_with_one_seed(parts: Any) -> None:
    measured = json.loads(FIGURES.read_text("utf-8"))
    assert measured.keys() == parts.keys()
    assert len({part["seed"] for part in measured.values()}) == 1


def test_tables_are_those_of_the_measured_figures(parts: Any) -> None:
    measured = json.loads(FIGURES.read_text("utf-8"))
    for name, figures in measured.items():
        for place, table in parts[name].tables(figures).items():
            wanted = f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->"
            assert any(wanted in page for page in PAGES), place
