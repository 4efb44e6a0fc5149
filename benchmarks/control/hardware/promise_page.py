"""Table of docs/hardware-limits.md about promises: how many were kept, and by how much."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias

from benchmarks import pages
from benchmarks.arms import ARMS

Rows: TypeAlias = Sequence[dict[str, Any]]
OUTCOMES = ("kept", "refused", "error", "loud", "diverged")
BROKEN = {"error": "error", "loud": "torque variation", "diverged": "diverged"}


def read(log: Path) -> list[dict[str, Any]]:
    """The cases of a log, each once."""
    if not log.exists():
        return []
    rows = [json.loads(line) for line in log.read_text("utf-8").splitlines() if line]
    return list({(row["seed"], row["case"]): row for row in rows}.values())


def write(rows: Rows, figures: Path, docs: Path) -> None:
    """Write the figures and both tables."""
    parts = {name: summary([row for row in rows if row["arm"] == name]) for name in ARMS}
    found: dict[str, Any] = {
        "arms": {name: part for name, part in parts.items() if part["cases"]},
        "all": summary(rows),
        "broken": [row for row in rows if row["outcome"] in BROKEN],
    }
    path = figures / "hardware_promise.json"
    path.write_text(json.dumps(pages.plain(found), indent=1) + "\n", "utf-8")
    tables = {"hardware-promise": _table(found), "hardware-broken": _named(found["broken"])}
    pages.rewrite(docs / "hardware-limits.md", tables)
    print(found["all"])


def summary(rows: Rows) -> dict[str, Any]:
    """Counts, and medians of what was shown over what was promised."""
    found: dict[str, Any] = {"cases": len(rows)}
    found |= {x: sum(row["outcome"] == x for row in rows) for x in OUTCOMES}
    ran = [row for row in rows if "error" in row]
    if ran:
        found["error_over_promise"] = median(row["error"] / row["promised"] for row in ran)
        found["variation_over_promise"] = median(row["seen"] / row["multiple"] for row in ran)
    return found


def _table(found: dict[str, Any]) -> str:
    lines = [_line(name, part) for name, part in found["arms"].items()]
    lines.append(_line("all", found["all"]))
    medians = "median error / promised", "median variation / promised"
    return pages.markdown(("arm", "cases", "refused", "kept", "broken", *medians), lines)


def _line(name: str, part: dict[str, Any]) -> tuple[Any, ...]:
    broken = sum(part[x] for x in BROKEN)
    answered = part["kept"] + broken
    shares = f" ({100.0 * part['kept'] / answered:.1f} %)" if answered else ""
    medians = ("error_over_promise", "variation_over_promise")
    words = [f"{part[x]:.2f}" if x in part else "–" for x in medians]
    return name, part["cases"], part["refused"], f"{part['kept']}{shares}", broken, *words


def _named(rows: Rows) -> str:
    header = ("case", "arm", "bits", "lag, delay", "friction", "broken", "promised", "shown")
    return pages.markdown(header, [_broken(row) for row in rows]) if rows else "None is broken."


def _broken(row: dict[str, Any]) -> tuple[Any, ...]:
    what = row["outcome"]
    said = f"{1e3 * row['promised']:.2g} mrad", f"{1e3 * row.get('error', 0.0):.2g} mrad"
    if what == "loud":
        said = f"{row['multiple']:.2g} × need", f"{row['seen']:.2g} × need"
    if what == "diverged":
        said = said[0], "–"
    hardware = f"{1e3 * row['lag']:.1f} ms, {row['delay']} ticks", f"{row['friction']:.1f} N·m"
    return row["case"], row["arm"], row["bits"], *hardware, BROKEN[what], *said
