"""Figures of results, in one style; every function returns a matplotlib `Figure` and opens no window."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..._common.arrays import Array
from ...simulation.result import SimulationResult
from .style import STYLE, NotebookFigure, draw_channels, name_lines, panels
from .units import force_unit, position_unit, rate_unit


def tracking_errors(result: SimulationResult) -> Figure:
    """Errors e1 and e2 over time (the paper's figure 2)."""
    with panels(rows=2) as (figure, axes):
        draw_channels(axes[0], result, result.e1, f"$e_1$ [{position_unit(result)}]")
        draw_channels(axes[1], result, result.e2, f"$e_2$ [{rate_unit(result)}]")
    return figure


def impedance_error(result: SimulationResult) -> Figure:
    """Impedance error e_im over time (the paper's figure 3)."""
    with panels(rows=1) as (figure, axes):
        draw_channels(axes[0], result, result.e_im, rf"$e_{{im}}$ [{force_unit(result)}]")
    return figure


def torques(result: SimulationResult) -> Figure:
    """Motor torque over time (the paper's figure 4)."""
    with panels(rows=1) as (figure, axes):
        draw_channels(axes[0], result, result.tau, rf"$\tau$ [{force_unit(result)}]")
    return figure


def disturbance(result: SimulationResult, estimate: Array) -> Figure:
    """Disturbance torque over time, as `estimate_disturbance` estimates it from a result.

    Args:
        result: The result that was observed.
        estimate: What `estimate_disturbance` returned, shape (N, nv) [N·m or N].
    """
    with panels(rows=1) as (figure, axes):
        draw_channels(axes[0], result, estimate, f"disturbance [{force_unit(result)}]")
    return figure


def comparison(results: Mapping[str, SimulationResult]) -> Figure:
    """Errors on a log scale and the torque's variation, for several controllers under the same conditions.

    Args:
        results: Results of equal length by name, from top to bottom.

    Returns:
        Three panels: largest abs(e1) and abs(e_im) of any joint over time, and the total variation per second of the
        first joint's torque over the second half of the run.
    """
    with mpl.rc_context(STYLE):
        figure = NotebookFigure(figsize=(7.6, 5.6 + 0.19 * len(results)))
        heights = (2.3, 2.3, 0.5 + 0.19 * len(results))
        upper, lower, bars = figure.subplots(3, 1, height_ratios=heights)
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)
        for axes, channel in ((upper, "e1"), (lower, "e_im")):
            for name, result in results.items():
                largest = np.abs(getattr(result, channel)).max(axis=1)
                axes.semilogy(result.t, largest, label=name)
            axes.margins(x=0.0)
            name_lines(axes, axes.get_lines())
        upper.set_ylabel(r"largest $|e_1|$ [rad]")
        lower.set_ylabel(r"largest $|e_{im}|$ [N$\cdot$m]")
        lower.set_xlabel("time [s]")
        _variation_bars(bars, results)
    return figure


def error_sizes(runs: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Largest abs(e1) of any joint over time, on a log scale.

    Args:
        runs: Times (N,) and errors (N, nv) by name, in the order of the legend.
    """
    with panels(rows=1, height=3.2) as (figure, axes):
        for name, (t, e1) in runs.items():
            axes[0].semilogy(t, np.abs(e1).max(axis=1), label=name)
        axes[0].set_ylabel(r"largest $|e_1|$ [rad]")
        axes[0].margins(x=0.0)
        name_lines(axes[0], axes[0].get_lines())
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure; the ending of the name chooses the format: .pdf and .svg to print, .png for a screen.

    Args:
        figure: The figure.
        path: Where to.

    Returns:
        The path that was written.
    """
    with mpl.rc_context({"pdf.fonttype": 42}):  # fonts as outlines, which publishers ask for
        figure.savefig(path)
    return Path(path)


def _variation_bars(axes: Axes, results: Mapping[str, SimulationResult]) -> None:
    """One horizontal bar per result, in the colour and line style of its curve, with its figure and name."""
    styles = mpl.rcParams["axes.prop_cycle"]
    for i, ((name, result), style) in enumerate(zip(results.items(), styles, strict=False)):
        variation = result.metrics(after=result.t[-1] / 2.0)["tau_variation"][0]
        line = {"color": style["color"], "linestyle": style["linestyle"]}
        axes.plot([1e-2, variation], [i, i], linewidth=3.0, **line)
        text = f" {variation:.3g}  {name}"
        axes.annotate(text, (variation, i), va="center", fontsize=7.5, color=style["color"])
    axes.set_xscale("log")
    axes.set_xlim(left=1e-1)
    axes.set_yticks([])
    axes.invert_yaxis()
    axes.set_xlabel(r"variation of $\tau_1$, second half [N$\cdot$m/s]")
