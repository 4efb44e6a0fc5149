"""No number in the tables of docs/standard-study.md is typed by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import pages
from benchmarks.study import large_errors, standard_study
from rbimpedance.study.standard import LINEAR, STANDARD

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def figures() -> dict[str, Any]:
    told: dict[str, Any] = json.loads(standard_study.FIGURES.read_text("utf-8"))
    return told


def test_tables_are_those_of_the_measured_figures(figures: dict[str, Any]) -> None:
    page = standard_study.PAGE.read_text("utf-8")
    for place, table in standard_study.tables(figures).items():
        assert f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->" in page, place


def test_tables_of_linear_laws_are_those_of_their_figures() -> None:
    page = standard_study.PAGE.read_text("utf-8")
    figures = json.loads(standard_study.LINEAR.read_text("utf-8"))
    assert list(figures["summary"]["controllers"]) == list(LINEAR.controllers)
    for place, table in standard_study.linear_tables(figures).items():
        assert f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->" in page, place


@pytest.mark.parametrize(("where", "page"), [("joints", "standard-study.md"), ("tool", "tool.md")])
def test_tables_of_starts_are_those_of_their_figures(where: str, page: str) -> None:
    rows = json.loads((pages.FIGURES / "large_errors.json").read_text("utf-8"))
    text = (pages.DOCS / page).read_text("utf-8")
    for place, table in large_errors.tables(rows, where).items():
        assert f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->" in text, place


def test_figures_are_of_the_whole_study_as_it_is_defined_now(figures: dict[str, Any]) -> None:
    assert figures["summary"]["runs"] == STANDARD.runs
    assert list(figures["summary"]["controllers"]) == list(STANDARD.controllers)
    assert figures["summary"]["disturbances"] == list(STANDARD.disturbances)


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (None, "–"),
        (float("nan"), "–"),
        (4.62e-6, "4.6e-06"),
        (0.0123, "0.012"),
        (0.8, "0.8"),
        (171.0, "170"),
        (1234.0, "1200"),
        (83400.0, "8.3e+04"),
    ],
)
def test_figures_are_written_with_two_digits(value: float | None, written: str) -> None:
    assert standard_study.number(value) == written
