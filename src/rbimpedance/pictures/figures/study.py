"""Figures of a study: how far each controller was from the target, where ours is worse, and what precision costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..._common.arrays import Array
from .style import STYLE, NotebookFigure, draw_cells

if TYPE_CHECKING:
    import pyarrow as pa

_FLOOR = 1e-9  # deviations below it are drawn at it [rad]
_WIDEST = 32.0  # factor at which the map's colours end
_COLORS = mpl.color_sequences["petroff10"]  # ten that most people can distinguish
_MARKERS = "oXsD^vPp<>hd"


def deviations(table: pa.Table) -> Figure:
    """How the deviations of each controller's runs are spread, on a log scale, with their medians and what diverged.

    Args:
        table: From `run_study`.
    """
    rows = table.to_pylist()
    names = _names(rows, "controller")
    with mpl.rc_context(STYLE):
        figure = NotebookFigure(figsize=(6.4, 0.8 + 0.42 * len(names)))
        axes = figure.subplots()
        for i, name in enumerate(names):
            of_name = [row for row in rows if row["controller"] == name]
            _draw_spread(axes, i, _logs(of_name, "deviation_rms"))
            lost = sum(row["status"] != "done" for row in of_name)
            label, beside = f"{lost} did not end" if lost else "", axes.get_yaxis_transform()
            axes.text(1.01, i, label, transform=beside, va="center", fontsize=7.5)
        _log_axis(axes)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("deviation from the target's motion, rms of a run [rad]")
    return figure


def ratio_map(table: pa.Table) -> Figure:
    """Deviation of the first controller over that of the best of the others, for each robot and disturbance.

    The best is the one with the smallest geometric mean of its runs there, of those that all ended; a cell without such
    a one, or in which a run of ours did not end, says so.

    Args:
        table: From `run_study`.
    """
    rows = table.to_pylist()
    robots, names = _names(rows, "robot"), _names(rows, "disturbance")
    ratios = np.array([[_ratio_to_best(rows, robot, name) for robot in robots] for name in names])
    with mpl.rc_context(STYLE | {"axes.grid": False}):
        figure = NotebookFigure(figsize=(2.4 + 0.72 * len(robots), 1.2 + 0.34 * len(names)))
        axes = figure.subplots()
        shown = np.ma.masked_invalid(np.log(ratios))
        reach = np.log(_WIDEST)
        picture = axes.imshow(shown, cmap="PuOr_r", aspect="auto", vmin=-reach, vmax=reach)
        bar = figure.colorbar(picture, ax=axes, extend="both", label="ours / best of the others")
        ticks = {"1/32": -5, "1/8": -3, "1/2": -1, "1": 0, "2": 1, "8": 3, "32": 5}
        bar.set_ticks([power * np.log(2.0) for power in ticks.values()], labels=list(ticks))
        texts = np.array([[_ratio_text(ratio) for ratio in row] for row in ratios.tolist()])
        draw_cells(axes, texts, np.abs(shown.filled(0.0)) > 0.55 * reach, fontsize=7.0)
        axes.set_xticks(range(len(robots)), robots, rotation=30, ha="right")
        axes.set_yticks(range(len(names)), names)
    return figure


def pareto(table: pa.Table) -> Figure:
    """Deviation against variation of the torque: every run as a point, and the median of each controller.

    Args:
        table: From `run_study`.
    """
    rows = [row for row in table.to_pylist() if row["status"] == "done"]
    names = _names(table.to_pylist(), "controller")
    with mpl.rc_context(STYLE):
        figure = NotebookFigure(figsize=(6.6, 4.0))
        axes = figure.subplots()
        for i, name in enumerate(names):
            of_name = [row for row in rows if row["controller"] == name]
            x = np.array([row["tau_variation"] for row in of_name])
            y = 10.0 ** _logs(of_name, "deviation_rms")
            color, marker = _COLORS[i % len(_COLORS)], _MARKERS[i % len(_MARKERS)]
            axes.plot(x, y, ".", color=color, markersize=2.0, alpha=0.25, zorder=1)
            middle = ([np.median(x)], [np.median(y)]) if of_name else ([], [])
            (point,) = axes.plot(*middle, marker, color=color, label=name, linestyle="none")
            point.set(markeredgecolor="w", markersize=8.0, zorder=3)
        if rows:
            axes.set_xscale("log")
            axes.set_yscale("log")
        axes.set_xlabel(r"variation of the torque, all joints [N$\cdot$m/s]")
        axes.set_ylabel("deviation from the target's motion, rms [rad]")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5)
    return figure


FIGURES = {"deviation": deviations, "ratio": ratio_map, "pareto": pareto}
"""By the names of their files."""


def _ratio_text(ratio: float) -> str:
    return f"{ratio:.2g}" if np.isfinite(ratio) else "lost" if ratio > 0.0 else "alone"


def _draw_spread(axes: Axes, i: int, logs: Array) -> None:
    color = _COLORS[i % len(_COLORS)]
    if len(logs) > 1 and np.ptp(logs) > 0.0:
        drawn: Any = axes.violinplot(
            [logs], [i], orientation="horizontal", widths=0.85, showextrema=False
        )
        drawn["bodies"][0].set(facecolor=color, alpha=0.45)
    if len(logs):
        low, middle, high = np.quantile(logs, [0.05, 0.5, 0.95])
        axes.plot([low, high], [i, i], color=color, linestyle="-", linewidth=1.4)
        axes.plot([middle], [i], "o", color=color, markeredgecolor="w", markersize=6.0)


def _log_axis(axes: Axes) -> None:
    """Name the powers of ten of an axis that shows logarithms."""
    low, high = axes.get_xlim()
    powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    axes.set_xticks(list(powers), [f"$10^{{{power}}}$" for power in powers])
    axes.set_xlim(low, high)


def _ratio_to_best(rows: list[dict[str, Any]], robot: str, disturbance: str) -> float:
    """Ours over the best of the others in one cell; infinite where ours is lost, NaN where the others are."""
    cell = [row for row in rows if (row["robot"], row["disturbance"]) == (robot, disturbance)]
    ours, *others = _names(rows, "controller")
    own = _mean_log(cell, ours)
    best = np.nanmin([np.inf, *(_mean_log(cell, name) for name in others)])
    if np.isnan(own):
        return float(np.inf)
    return float(10.0 ** (own - best)) if np.isfinite(best) else float(np.nan)


def _mean_log(cell: list[dict[str, Any]], controller: str) -> float:
    """Mean logarithm of a controller's deviations; NaN unless all its runs ended."""
    rows = [row for row in cell if row["controller"] == controller]
    if not rows or any(row["status"] != "done" for row in rows):
        return float(np.nan)
    return float(_logs(rows, "deviation_rms").mean())


def _logs(rows: list[dict[str, Any]], figure: str) -> Array:
    """Decimal logarithms of a figure of the runs that ended."""
    values = [row[figure] for row in rows if row["status"] == "done"]
    return np.log10(np.maximum(np.array(values, dtype=np.float64), _FLOOR))


def _names(rows: list[dict[str, Any]], column: str) -> list[str]:
    return list(dict.fromkeys(row[column] for row in rows))
