"""One style for all figures."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..._common.arrays import Array, BoolArray
from ...simulation.result import SimulationResult

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette: distinguishable with every kind of colour vision."""

STYLE: Any = {
    "axes.grid": True,
    "axes.prop_cycle": cycler(linestyle=["-", "--", ":"]) * cycler(color=list(COLORS)),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "font.size": 9.0,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
}
"""What matplotlib calls rcParams."""


class NotebookFigure(Figure):
    """A figure that notebooks show, without a window or pyplot."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png")
        return content.getvalue()


@contextmanager
def panels(
    rows: int, width: float = 5.0, height: float = 2.2, *, xlabel: str = "time [s]"
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of panels above each other that share the horizontal axis."""
    with mpl.rc_context(STYLE):
        figure = NotebookFigure(figsize=(width, height * rows))
        axes = np.atleast_1d(figure.subplots(rows, 1, sharex=True)).tolist()
        yield figure, axes
        axes[-1].set_xlabel(xlabel)


def draw_cells(axes: Axes, texts: NDArray[np.str_], is_dark: BoolArray, fontsize: float) -> None:
    """Write a text into every cell of a picture, light on dark cells."""
    for (i, k), text in np.ndenumerate(texts):
        color = "w" if is_dark[i, k] else "k"
        axes.text(k, i, str(text), ha="center", va="center", color=color, fontsize=fontsize)


def draw_channels(
    axes: Axes,
    result: SimulationResult,
    values: Array,
    label: str,
    names: Sequence[str] | None = None,
) -> None:
    """One line per joint, or per column that is named, with a legend next to the axes."""
    for name, line in zip(names or result.joint_names, values.T, strict=True):
        axes.plot(result.t, line, label=name)
    axes.set_ylabel(label)
    axes.margins(x=0.0)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5)


def name_lines(axes: Axes, lines: Sequence[Line2D]) -> None:
    """Write the label of every line beside its end, in its colour; call it when the limits are final."""
    axes.get_xlim(), axes.get_ylim()  # matplotlib sets them on demand
    to_axes = axes.transData + axes.transAxes.inverted()
    last = [
        (float(x[-1]), float(y[np.isfinite(y)][-1]))
        for x, y in ((np.asarray(a.get_xdata()), np.asarray(a.get_ydata())) for a in lines)
    ]
    ends = np.clip(to_axes.transform(last)[:, 1], 0.0, 1.0)
    inches = axes.bbox.height / axes.figure.dpi
    for line, end, place in zip(lines, ends, _apart(ends, 0.15 / inches), strict=True):
        label: Any = {"xycoords": "axes fraction", "fontsize": 7.5, "va": "center"}
        arrow = {"arrowstyle": "-", "linewidth": 0.6, "relpos": (0.0, 0.5)}
        label["arrowprops"] = arrow | {"color": line.get_color(), "shrinkA": 1.0, "shrinkB": 0.0}
        text, color = str(line.get_label()), line.get_color()
        axes.annotate(text, (1.0, end), (1.05, place), color=color, **label)


def _apart(wanted: Array, gap: float) -> Array:
    """Places in [0, 1] near the wanted ones, in their order, with a gap between any two."""
    order = np.argsort(wanted, kind="stable")
    gaps = gap * np.arange(len(order))
    upwards = np.maximum.accumulate(wanted[order] - gaps)
    downwards = np.minimum.accumulate((wanted[order] - gaps)[::-1])[::-1]
    places = np.empty_like(wanted)
    middle = np.clip((upwards + downwards) / 2.0, 0.0, max(0.0, 1.0 - gaps[-1]))
    places[order] = middle + gaps
    return places
