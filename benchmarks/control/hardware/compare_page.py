"""Tables of docs/hardware-limits.md about laws on usual hardware."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.pages import markdown

Rows = Mapping[str, Mapping[str, Any]]
LABELS = (
    "default, differences",
    "PD + gravity, differences",
    "computed torque + integral, differences",
    "computed torque + momentum observer, differences",
    "computed torque + integral, our observer",
    "ours",
)


def tables(rows: Rows) -> dict[str, str]:
    """Every table by its place."""
    return {
        "hardware-laws": _laws(rows),
        "hardware-ranges": _ranges(rows),
        "hardware-standing": _standing(rows),
        "hardware-springs": _springs(rows),
    }


def _laws(rows: Rows) -> str:
    lines = []
    for name, row in rows.items():
        for bits, found in row["laws"].items():
            quiet = [label for label in LABELS if _ratio(found[label], row) <= 2.1]
            best = min(quiet, key=lambda label: found[label]["error"])
            cells = [_bold(_cell(found[label], row["need"]), label == best) for label in LABELS]
            lines.append((name, bits, *cells))
    return markdown(("arm", "bits", *LABELS), lines)


def _ranges(rows: Rows) -> str:
    measured = {name: row["ranges"] for name, row in rows.items() if "ranges" in row}
    labels = list(next(iter(measured.values())))
    lines = [
        (label, *(_cell(found[label], found[label]["need"]) for found in measured.values()))
        for label in labels
    ]
    return markdown(("hardware", *measured), lines)


def _standing(rows: Rows) -> str:
    lines = [
        (
            name,
            *(f"{found['still']:.2g}" for found in row["laws"].values()),
            f"{row['standing']['variation']:.2g}",
        )
        for name, row in rows.items()
    ]
    bits = [f"{b} bits" for b in next(iter(rows.values()))["laws"]]
    return markdown(("arm", *bits, "17 bits, friction 50 % higher at rest"), lines)


def _springs(rows: Rows) -> str:
    measured = {name: row["springs"] for name, row in rows.items() if "springs" in row}
    rotors = list(next(iter(measured.values())))
    lines = [
        (name, *(_cell(found[rotor], found[rotor]["need"]) for rotor in rotors))
        for name, found in measured.items()
    ]
    return markdown(("arm", *(f"rotors of {rotor} kg·m²" for rotor in rotors)), lines)


def _ratio(run: Mapping[str, Any], row: Mapping[str, Any]) -> float:
    return float(run["variation"]) / float(row["need"])


def _cell(run: Mapping[str, Any], need: float) -> str:
    """Error in mrad, and the torque variation over what is needed."""
    if run["error"] == float("inf"):
        return "lost"
    return f"{_short(1e3 * run['error'])} ({_short(run['variation'] / need)})"


def _short(number: float) -> str:
    return f"{number:.0f}" if number >= 10.0 else f"{number:.1f}"


def _bold(text: str, is_best: bool) -> str:
    return f"**{text}**" if is_best else text
