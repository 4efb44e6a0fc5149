"""The figure of the benchmark: what is short is good."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rbimpedance.pictures.figures.style import COLORS, STYLE

from .report import RATIO, Report, Section

_OURS = ("step", "realtime", "simulate")


def draw(report: Report) -> Figure:
    """Draw what the report has of: the tick, the closed loop, both beside others, and chains of n joints."""
    drawn = [
        (section, plot)
        for key, plot in _PANELS.items()
        if (section := report.section(key)) is not None
    ]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, sum(_height(section) for section, _ in drawn)))
        heights = [_height(section) for section, _ in drawn]
        axes = figure.subplots(len(drawn), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
        for ax, (section, plot) in zip(axes[:, 0], drawn, strict=True):
            plot(ax, section)
    return figure


def _height(section: Section) -> float:
    return 2.8 if section.key == "scaling" else 0.9 + 0.22 * len(section.lines)


def _bars(figure: str, label: str) -> Callable[[Axes, Section], None]:
    def plot(axes: Axes, section: Section) -> None:
        lines = [line for line in section.lines if figure in line.figures][::-1]
        names, widths = [line.name for line in lines], [line.figures[figure] for line in lines]
        colors = [COLORS[0] if name.startswith(_OURS) else "0.6" for name in names]
        bars = axes.barh(names, widths, color=colors)
        axes.bar_label(bars, fmt="%.2f", padding=3, fontsize=8)
        axes.axvline(1.0, color="black", linewidth=0.8, zorder=0)
        axes.set(xlabel=label)
        axes.set_title(section.title, loc="left", fontsize=9)
        axes.margins(x=0.15)
        axes.grid(visible=False, axis="y")

    return plot


def _lines(axes: Axes, section: Section) -> None:
    points = [line for line in section.lines if not line.name.startswith("fit")]
    joints = [int(line.name.split()[0]) for line in points]
    for name in section.columns:
        axes.plot(joints, [line.figures[name] for line in points], "o-", markersize=3, label=name)
    axes.set_title(section.title, loc="left", fontsize=9)
    axes.set(xlabel="joints", ylabel="a tick [µs]", ylim=(0.0, None))
    axes.legend(loc="upper left", fontsize=7.5)


_PANELS: dict[str, Callable[[Axes, Section], None]] = {
    "tick": _bars(f"{RATIO} rnea p50", "pin.rnea from Python = 1"),
    "peers": _bars(f"{RATIO} rnea", "pin.rnea from Python = 1"),
    "loop": _bars(f"{RATIO} (rnea + aba)", "pin.rnea + pin.aba from Python = 1"),
    "peer-loops": _bars(f"{RATIO} (rnea + aba)", "pin.rnea + pin.aba from Python = 1"),
    "scaling": _lines,
}
