"""Tables of docs/hardware-limits.md about laws on usual hardware."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

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

QUIET = 2.1
"""Largest multiple of the needed torque variation that counts as quiet, rounding included."""


def tables(rows: Rows) -> dict[str, str]:
    """Every table by its place."""
    return {
        "hardware-ours": _by_choice(rows, "ours", "{} bits"),
        "hardware-factors": _factors(rows),
        "hardware-laws": _laws(rows),
        "hardware-ranges": _by_arm(rows, "ranges", "hardware"),
        "hardware-standing": _standing(rows),
        "hardware-springs": _by_arm(rows, "springs", "rotors [kg·m²]"),
        "hardware-engines": _by_choice(rows, "engines", "{}"),
        "hardware-impedance": _impedance(rows),
        "hardware-wall": _wall(rows),
    }


def _with(rows: Rows, part: str) -> dict[str, Mapping[str, Any]]:
    return {name: row for name, row in rows.items() if part in row}


def _by_choice(rows: Rows, part: str, title: str) -> str:
    """Arms as rows, what was chosen for a part as columns."""
    measured = _with(rows, part)
    choices = list(next(iter(measured.values()))[part])
    lines = [
        (name, *(_cell(row[part][choice], row["need"]) for choice in choices))
        for name, row in measured.items()
    ]
    return markdown(("arm", *map(title.format, choices)), lines)


def _laws(rows: Rows) -> str:
    lines = []
    for name, row in _with(rows, "laws").items():
        for bits, found in row["laws"].items():
            runs = found | {"ours": row["ours"][bits]}
            quiet = [label for label in LABELS if _ratio(runs[label], row) <= QUIET]
            best = min(quiet, key=lambda label: runs[label]["error"])
            cells = [_bold(_cell(runs[label], row["need"]), label == best) for label in LABELS]
            lines.append((name, bits, *cells))
    return markdown(("arm", "bits", *LABELS), lines)


def _factors(rows: Rows) -> str:
    """Error of linear laws over ours: the best on differences, then the one on our observer."""
    measured = _with(rows, "laws")
    bits = sorted({b for row in measured.values() for b in row["laws"]}, key=int)
    lines = [(name, *(_factor(row, b) for b in bits)) for name, row in measured.items()]
    return markdown(("arm", *(f"{b} bits" for b in bits)), lines)


def _factor(row: Mapping[str, Any], bits: str) -> str:
    if bits not in row["laws"] or "refused" in row["ours"][bits]:
        return "–"
    found, ours = row["laws"][bits], row["ours"][bits]["error"]
    quiet = [label for label in LABELS[1:4] if _ratio(found[label], row) <= QUIET]
    differences = min(found[label]["error"] for label in quiet or LABELS[1:4])
    return f"{_short(differences / ours)}, {_short(found[LABELS[4]]['error'] / ours)}"


def _by_arm(rows: Rows, part: str, title: str) -> str:
    measured = {name: row[part] for name, row in _with(rows, part).items()}
    labels = list(next(iter(measured.values())))
    lines = [
        (label, *(_cell(found[label], found[label]["need"]) for found in measured.values()))
        for label in labels
    ]
    return markdown((title, *measured), lines)


def _impedance(rows: Rows) -> str:
    (measured,) = _with(rows, "impedance").values()
    lines = [
        (label, *(f"{100.0 * error:.1f} %" for error in found.values()))
        for label, found in measured["impedance"].items()
    ]
    return markdown(("plant", "M_d", "D_d", "K_d"), lines)


def _wall(rows: Rows) -> str:
    (measured,) = _with(rows, "wall").values()
    lines = [
        (label, f"{found['peak']:.1f}", f"{found['steady']:.1f}", found["contacts"])
        for label, found in measured["wall"].items()
    ]
    return markdown(("plant", "peak force [N]", "steady force [N]", "contacts"), lines)


def _standing(rows: Rows) -> str:
    measured = _with(rows, "ours")
    bits = list(next(iter(measured.values()))["ours"])
    lines = [
        (
            name,
            *(_variation(row["ours"][b], "still") for b in bits),
            _variation(row["standing"], "variation"),
        )
        for name, row in measured.items()
    ]
    header = ("arm", *(f"{b} bits" for b in bits), "17 bits, friction 50 % higher at rest")
    return markdown(header, lines)


def _variation(run: Mapping[str, Any], key: str) -> str:
    return "refused" if "refused" in run else f"{run[key]:.2g}"


def _ratio(run: Mapping[str, Any], row: Mapping[str, Any]) -> float:
    return np.inf if "refused" in run else float(run["variation"]) / float(row["need"])


def _cell(run: Mapping[str, Any], need: float) -> str:
    """Error in mrad, and the torque variation over what is needed."""
    if "refused" in run:
        return "refused"
    if run["error"] == float("inf"):
        return "lost"
    return f"{_short(1e3 * run['error'])} ({_short(run['variation'] / need)})"


def _short(number: float) -> str:
    return f"{number:.0f}" if number >= 10.0 else f"{number:.1f}"


def _bold(text: str, is_best: bool) -> str:
    return f"**{text}**" if is_best else text
