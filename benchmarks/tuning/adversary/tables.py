"""What the attack found, as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.pages import markdown

FAMILIES = {
    "tuned on": "arms of this page",
    "unseen": "other arms",
    "random": "random arms",
    "coupled": "strongly coupled links",
}
CLAIMS = {
    "beyond_peak": "beyond the stated peak",
    "beyond_torque": "beyond the stated torque",
    "beyond_error": "beyond the stated error",
    "beyond_reaching": "later than `reaching_time`",
    "beyond_settling": "later than `total_time`",
}

Rows = Sequence[dict[str, Any]]


def tables(rows: Rows) -> dict[str, str]:
    """Tables by the name of their place in docs/robustness.md."""
    groups = [(words, [r for r in rows if r["family"] == name]) for name, words in FAMILIES.items()]
    groups = [(words, group) for words, group in groups if group]
    header = ("", "tasks", "feasible", "plants", "diverged", *CLAIMS.values())
    found = markdown(header, [_broken(*group) for group in groups])
    times = ("", "stated error over the worst one, median", "least", "infeasible", "tuned by hand")
    more = (*times, "seconds if feasible, median", "largest", "if infeasible, median", "largest")
    return {"adversary": found, "adversary-figures": markdown(more, [_figures(*g) for g in groups])}


def _broken(words: str, rows: Rows) -> tuple[Any, ...]:
    yes = [row for row in rows if row["feasible"]]
    counts = [sum(row[name] for row in yes) for name in ("plants", "diverged", *CLAIMS)]
    return (words, len(rows), len(yes), *counts)


def _figures(words: str, rows: Rows) -> tuple[Any, ...]:
    accepted, refused = ([r for r in rows if r["feasible"] is is_yes] for is_yes in (True, False))
    ratios = [row["stated"] / row["late"] for row in accepted if row["late"]]
    by_hand = sum(row["by_hand"] is not None for row in refused)
    return (
        words,
        *_two(ratios, np.median, np.min),
        len(refused),
        by_hand,
        *_two([row["cpu"] for row in accepted], np.median, np.max),
        *_two([row["cpu"] for row in refused], np.median, np.max),
    )


def _two(numbers: Sequence[float], *figures: Any) -> list[str]:
    return [f"{figure(numbers):.2g}" if numbers else "–" for figure in figures]
