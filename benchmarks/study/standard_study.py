"""Turn a run of the standard study into the tables and figures of docs/standard-study.md.

    rbimpedance study standard --jobs 2 --out out/standard
    python -m benchmarks.study.standard_study out/standard
    rbimpedance study linear --jobs 2 --out out/linear
    python -m benchmarks.study.standard_study --linear out/linear

Every number of the page comes from the studies' own tables; docs/figures/standard_study.json and linear_study.json keep
them.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet

from benchmarks import pages
from benchmarks.pages import markdown, rewrite
from rbimpedance.study.summary import COMPARED, summarize

PAGE = pages.DOCS / "standard-study.md"
FIGURES = pages.FIGURES / "standard_study.json"
LINEAR = pages.FIGURES / "linear_study.json"
PICTURES = ("deviation", "ratio", "pareto")


def number(value: float | None, digits: int = 2) -> str:
    """Write a figure with a few significant digits, without an exponent where it can be read without."""
    if value is None or not np.isfinite(value):
        return "–"
    if 1e-3 <= abs(value) < 1e4:
        return np.format_float_positional(value, digits, fractional=False, trim="-")
    return f"{value:.{digits - 1}e}"


def times(told: Mapping[str, Any]) -> str:
    """Write how many times lower ours is, with its interval."""
    if told["ratio"] is None:
        return "–"
    middle = number(1.0 / told["ratio"])
    if told["low"] is None:
        return middle
    return f"{middle} ({number(1.0 / told['high'])}–{number(1.0 / told['low'])})"


def alone(summary: Mapping[str, Any]) -> str:
    """Each controller for itself."""
    rows = []
    for name, told in summary["controllers"].items():
        median = told["median"]
        rows.append(
            [name, f"{told['done']} of {told['runs']}"]
            + [number(median[x]) for x in ("deviation_rms", "deviation_max", "e_im_rms")]
            + [number(median["tau_variation"], 3)]
        )
    header = ("controller", "ended", "deviation, rms [rad]", "largest", "e_im, rms [N·m]")
    return markdown((*header, "variation [N·m/s]"), rows)


def compared(summary: Mapping[str, Any]) -> str:
    """Ours against the others, in all pairs."""
    rows = []
    for name, told in summary["compared"].items():
        figures = [times(told["all"][figure]) for figure in COMPARED]
        rows.append([name, *figures, f"{told['share_worse']:.1%}"])
    return markdown(("over", "deviation", "e_im", "torque variation", "ours worse"), rows)


def alike(summary: Mapping[str, Any]) -> str:
    """Ours against the others, in pairs whose torques travel equally far."""
    rows = []
    for name, told in summary["compared"].items():
        pairs = told["equal_torque_variation"]
        figures = [times(pairs[figure]) for figure in COMPARED[:2]]
        rows.append([name, *figures, f"{pairs[COMPARED[0]]['pairs']} of {told['pairs']}"])
    return markdown(("over", "deviation", "e_im", "pairs"), rows)


def worse(summary: Mapping[str, Any]) -> str:
    """On how many arms ours is worse, by disturbance."""
    counts = {
        name: {
            key: sum(cell["disturbance"] == key for cell in told["worse_cells"])
            for key in summary["disturbances"]
        }
        for name, told in summary["compared"].items()
    }
    rows = [
        [key, *(str(counts[name][key] or "") for name in counts)]
        for key in summary["disturbances"]
        if any(counts[name][key] for name in counts)
    ]
    return markdown(("disturbance", *counts), rows)


def by_disturbance(rows: list[dict[str, Any]], figure: str) -> dict[str, dict[str, float]]:
    """Median of a figure by disturbance and controller, over the runs that ended."""
    found: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        values = found.setdefault(row["disturbance"], {}).setdefault(row["controller"], [])
        if row["status"] == "done":
            values.append(row[figure])
    return {
        key: {name: float(np.median(x)) if x else float("nan") for name, x in of_key.items()}
        for key, of_key in found.items()
    }


def medians(table: Mapping[str, Mapping[str, float]]) -> str:
    """Medians by disturbance, a column for each controller."""
    names = list(next(iter(table.values())))
    rows = [[key, *(number(of_key[name]) for name in names)] for key, of_key in table.items()]
    return markdown(("disturbance", *names), rows)


def figures_of(table: pyarrow.Table) -> dict[str, Any]:
    """All that the page tells of a study's table."""
    rows = table.to_pylist()
    deviation = by_disturbance(rows, "deviation_rms")
    return {
        "summary": summarize(table) | {"disturbances": list(deviation)},
        "deviation_rms": deviation,
        "tau_variation": by_disturbance(rows, "tau_variation"),
    }


def tables(figures: Mapping[str, Any]) -> dict[str, str]:
    """Every table of the page, by its mark."""
    return {
        "alone": alone(figures["summary"]),
        "compared": compared(figures["summary"]),
        "alike": alike(figures["summary"]),
        "deviation": medians(figures["deviation_rms"]),
        "variation": medians(figures["tau_variation"]),
        "worse": worse(figures["summary"]),
    }


def linear_tables(figures: Mapping[str, Any]) -> dict[str, str]:
    """Tables of the study with an integrator, by their marks."""
    found = tables(figures)
    return {
        f"linear {name}": found[name] for name in ("alone", "compared", "deviation", "variation")
    }


def rewrite_linear(folder: Path) -> None:
    """Read the study of linear laws, and rewrite its part of the page."""
    figures = figures_of(pyarrow.parquet.read_table(folder / "linear.parquet"))
    LINEAR.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    rewrite(PAGE, linear_tables(figures))


def main() -> None:
    """Read the study and rewrite the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=Path("out/standard"))
    parser.add_argument("--linear", action="store_true", help="the folder is that of LINEAR")
    asked = parser.parse_args()
    folder = asked.folder
    if asked.linear:
        rewrite_linear(folder)
        return
    figures = figures_of(pyarrow.parquet.read_table(folder / "standard.parquet"))
    FIGURES.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    for name in PICTURES:
        shutil.copyfile(folder / f"{name}.png", FIGURES.with_name(f"study_{name}.png"))
    rewrite(PAGE, tables(figures))


if __name__ == "__main__":
    main()
