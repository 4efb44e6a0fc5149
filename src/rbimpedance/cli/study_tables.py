"""What `rbimpedance study` prints: tables of a summary."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from ..study.summary import ALIKE
from .terminal import number, table

LEGEND = (
    "deviation: distance from the motion that the target impedance makes; e_im: impedance error, the force that is "
    "missing (eq. 5); e1: distance from the controller's reference; rms: root mean square of a run; torque "
    "variation: all ups and downs in a second; pairs: runs that both ended; cells: robot and "
    "disturbance; 95 %: interval of the ratio"
)
"""What the columns of the tables mean."""

WORST_SHOWN = 3
"""Cells shown for each of the others; the file has all."""


def tables(summary: dict[str, Any]) -> Iterator[Table]:
    """Return the tables of a summary.

    Args:
        summary: From `summarize`.
    """
    yield _controllers(summary)
    if summary["compared"]:
        yield _ratios(summary, "all", "all runs that ended")
        yield _ratios(
            summary, "equal_torque_variation", f"at equal torque variation, within {ALIKE:g}"
        )
        yield _worst(summary)


def _controllers(summary: dict[str, Any]) -> Table:
    header = ("controller", "runs", "done", "diverged", "failed", "deviation, rms [rad]")
    more = ("deviation, largest [rad]", "e_im, rms [N m]", "e1, rms [rad]", "torque variation")
    figures = ("deviation_rms", "deviation_max", "e_im_rms", "e1_rms", "tau_variation")
    rows = [
        [name, *(str(told[count]) for count in header[1:5])]
        + [_figure(told["median"][figure]) for figure in figures]
        for name, told in summary["controllers"].items()
    ]
    return table(f"{summary['study']}: medians of the runs that ended", (*header, *more), rows)


def _ratios(summary: dict[str, Any], which: str, words: str) -> Table:
    header = ["over", "pairs", "cells", "deviation", "95 %", "e_im", "95 % of it"]
    if which == "all":
        header += ["torque variation", "ours worse", "only ours ended", "only other ended"]
    rows = []
    for name, told in summary["compared"].items():
        deviation, e_im = told[which]["deviation_rms"], told[which]["e_im_rms"]
        row = [name, f"{deviation['pairs']} of {told['pairs']}", str(deviation["cells"])]
        row += [_figure(deviation["ratio"]), _interval(deviation)]
        row += [_figure(e_im["ratio"]), _interval(e_im)]
        if which == "all":
            row += [_figure(told[which]["tau_variation"]["ratio"]), _share(told)]
            row += [str(told["only_ours_ended"]), str(told["only_other_ended"])]
        rows.append(row)
    title = f"{summary['ours']} over each of the others, geometric mean of rms ratios: {words}"
    return table(title, header, rows)


def _worst(summary: dict[str, Any]) -> Table:
    header = ("over", "robot", "disturbance", "ours", "other", "ratio", "ended less often")
    rows = [
        [
            *(name, cell["robot"], cell["disturbance"]),
            *(_figure(cell[figure]) for figure in ("ours", "other", "ratio")),
            str(max(cell["lost"], 0)),
        ]
        for name, told in summary["compared"].items()
        for cell in told["worse_cells"][:WORST_SHOWN]
    ]
    nowhere = [["–"] * len(header)]
    title = f"where {summary['ours']} is worse: deviation, rms [rad]"
    return table(title, header, rows or nowhere)


def _share(told: dict[str, Any]) -> str:
    return "–" if told["share_worse"] is None else f"{told['share_worse']:.1%}"


def _interval(told: dict[str, Any]) -> str:
    if told["low"] is None:
        return "–"
    return f"{number(told['low'])} to {number(told['high'])}"


def _figure(value: float | None) -> str:
    return "–" if value is None else number(value)
