"""Tables and the figure of docs/hardware-limits.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from benchmarks.pages import markdown

from .measure import SETS
from .trials import ACCURACY, ROUGHNESS

Rows = Mapping[str, Mapping[str, Any]]
NONE = "none"


def tables(rows: Rows) -> dict[str, str]:
    """Every table by its place."""
    return {
        "hardware-usual": _usual(rows),
        "hardware-alone": _alone(rows),
        "hardware-bounds": _bounds(rows),
        "hardware-stiffness": _stiffness(rows),
        "hardware-rotors": _rotors(rows),
        "hardware-slower": _slower(rows),
        "hardware-honest": _honest(rows),
    }


def _run(run: Mapping[str, Any]) -> str:
    """A run in short: quiet or not, error of the links, roughness."""
    if "diverges" in run:
        return f"diverges ({run['diverges']})"
    verdict = "quiet" if run["quiet"] else "**not quiet**"
    return f"{verdict}: {_angle(run['e1'])}, {_share(run['roughness'])}"


def _angle(radians: float) -> str:
    return f"{_short(1e3 * radians)} mrad"


def _share(share: float) -> str:
    return f"{_short(100.0 * share)} %"


def _short(number: float) -> str:
    return f"{number:.0f}" if number >= 100.0 else f"{number:.2g}"


def _usual(rows: Rows) -> str:
    header = ("arm", "perfect drives", "the usual hardware", "…, encoders on the links")
    return markdown(
        header,
        [
            (name, *(_run(_default(row)[key]) for key in ("rigid", "usual", "usual_link")))
            for name, row in rows.items()
        ],
    )


def _alone(rows: Rows) -> str:
    kinds = {"lag": "lag", "ripple": "ripple", "encoders": "encoders", "springs": "springs"}
    return markdown(
        ("arm", *kinds.values()),
        [
            (name, *(_run(_default(row)["alone"][kind]) for kind in kinds))
            for name, row in rows.items()
        ],
    )


def _default(row: Mapping[str, Any]) -> Mapping[str, Any]:
    found: Mapping[str, Any] = row["sets"]["default"]
    return found


def _bounds(rows: Rows) -> str:
    """Lag, encoders and ripple."""
    lines = []
    for name, row in rows.items():
        for label in SETS:
            found = row["sets"][label]
            ripple = f"{100.0 * found['ripple']:.0f} %" if found.get("ripple") else ""
            lines.append(
                (
                    *(name, label, f"{found['margin']:.1f}"),
                    *(_time(found["lag"]), _time(found["lag_theory"])),
                    *(found["bits"] or NONE, ripple),
                )
            )
    header = (
        *("arm", "gains", "margin", "largest lag", "linear theory"),
        *("fewest bits", "largest ripple"),
    )
    return markdown(header, lines)


def _time(seconds: float | None) -> str:
    return NONE if seconds is None else f"{1e3 * seconds:.2g} ms"


def _stiffness(rows: Rows) -> str:
    lines = []
    for name, row in rows.items():
        for label in SETS:
            found = row["sets"][label]
            keys = [
                f"springs_{side}{kind}" for side in ("motor", "link") for kind in ("", "_theory")
            ]
            lines.append((name, label, *(_factors(found[key]) for key in keys)))
    header = (
        *("arm", "gains", "encoders on the motors", "linear theory"),
        *("encoders on the links", "linear theory"),
    )
    return markdown(header, lines)


def _factors(factors: Sequence[float]) -> str:
    return ", ".join(f"{factor:g}" for factor in factors) or NONE


def _rotors(rows: Rows) -> str:
    inertias = [found["rotor"] for found in next(iter(rows.values()))["rotors"]]
    lines = []
    for name, row in rows.items():
        cells = [
            NONE
            if found["delay"] is None
            else f"`delay={found['delay']}`: {_angle(found['run']['e1'])} ({_angle(found['run']['link'])}), "
            f"{_share(found['run']['roughness'])}"
            for found in row["rotors"]
        ]
        lines.append((name, *cells))
    return markdown(("arm", *(f"rotors of {x:g} kg·m²" for x in inertias)), lines)


def _slower(rows: Rows) -> str:
    lines = []
    for name, row in rows.items():
        cells = []
        for side in ("motor", "link"):
            found = row["slower"].get(side)
            cells += (
                [NONE, ""]
                if found is None
                else [f"{found['margin']:.0f}, {found['slope']:.0f}/s", _run(found["run"])]
            )
        lines.append((name, *cells))
    header = (
        *("arm", "encoders on the motors: margin, slope", "measured"),
        *("on the links: margin, slope", "measured"),
    )
    return markdown(header, lines)


def _honest(rows: Rows) -> str:
    lines = []
    for name, row in rows.items():
        found = row["honest"]
        if not found["feasible"]:
            lines.append((name, NONE, found["reason"], ""))
            continue
        law = f"{found['margin']:.1f}, {found['slope']:.0f}/s"
        lines.append((name, law, _run(found["run"]), found["bits"] or NONE))
    return markdown(("arm", "margin, slope", "with 19 bits", "fewest bits"), lines)


def draw(rows: Rows, path: Path) -> None:
    """Roughness of every run with the default gains, and the lag that each set of gains tolerates."""
    names = list(rows)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2))
    kinds = {
        "perfect": [_default(row)["rigid"] for row in rows.values()],
        "lag 1.5 ms": [_default(row)["alone"]["lag"] for row in rows.values()],
        "ripple 1 %": [_default(row)["alone"]["ripple"] for row in rows.values()],
        "encoders, 19 bits": [_default(row)["alone"]["encoders"] for row in rows.values()],
        "springs": [_default(row)["alone"]["springs"] for row in rows.values()],
        "all": [_default(row)["usual"] for row in rows.values()],
    }
    places = np.arange(len(names))
    for i, (label, runs) in enumerate(kinds.items()):
        shares = [100.0 * run.get("roughness", np.nan) for run in runs]
        left.semilogy(places + 0.1 * (i - 2.5), shares, "o", label=label)
    left.axhline(100.0 * ROUGHNESS, color="k", linestyle=":")
    left.set_ylabel("torque from tick to tick, % of the effort limit")
    left.set_title("default gains, one imperfection at a time")
    markers = dict(zip(SETS, "osv", strict=True))
    for i, (label, marker) in enumerate(markers.items()):
        for j, (key, color) in enumerate((("lag", "C0"), ("lag_theory", "C1"))):
            bounds = [1e3 * (row["sets"][label][key] or np.nan) for row in rows.values()]
            word = f"{label}, {'measured' if j == 0 else 'linear theory'}"
            right.semilogy(places + 0.15 * (i - 1), bounds, marker, color=color, label=word)
    right.set_ylabel("largest time constant of the torque [ms]")
    right.set_title(f"tolerated lag (roughness ≤ {ROUGHNESS:.0%}, error ≤ {1e3 * ACCURACY:g} mrad)")
    for axes in (left, right):
        axes.set_xticks(places, names)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.08))
    figure.tight_layout(w_pad=3.0)
    figure.savefig(path, dpi=150)
    plt.close(figure)
