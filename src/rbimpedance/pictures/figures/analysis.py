"""Figures that explain a run: convergence and its certificate, limits, chatter, the phase plane, robustness, energy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike

from ..._common.arrays import Array, per_joint, vector
from ...exceptions import ParameterError
from ...law.certificate import Certificate
from ...law.surfaces import Surface
from ...simulation.energy import EnergyBalance
from ...simulation.result import SimulationResult
from .style import COLORS, STYLE, NotebookFigure, draw_cells, draw_channels, panels
from .units import force_unit, position_unit, rate_unit

_FLOOR = 1e-12  # errors below it are drawn at it: a log scale has no zero


def convergence(result: SimulationResult, certificate: Certificate | None = None) -> Figure:
    """Errors abs(e1) and abs(e_im) on a log scale, and by when the certificate promises what.

    Args:
        result: The run.
        certificate: Its finite times are drawn: T₀ dotted, until e1 has settled dashed, in each joint's colour.
    """
    with panels(rows=2) as (figure, axes):
        for panel, values, label in (
            (axes[0], result.e1, f"$|e_1|$ [{position_unit(result)}]"),
            (axes[1], result.e_im, f"$|e_{{im}}|$ [{force_unit(result)}]"),
        ):
            draw_channels(panel, result, np.maximum(np.abs(values), _FLOOR), label)
            panel.set_yscale("log")
            if certificate is not None:
                _draw_times(panel, result, certificate)
        _remove_legend(axes[1])
    return figure


def _draw_times(axes: Axes, result: SimulationResult, certificate: Certificate) -> None:
    """A line where each joint's sliding variable is zero by then (dotted), and its error has settled (dashed)."""
    for times, style in ((certificate.reaching_time, ":"), (certificate.total_time, "--")):
        for i, time in enumerate(np.broadcast_to(times, result.e1.shape[1])):
            if time <= result.t[-1]:
                axes.axvline(time, color=COLORS[i % len(COLORS)], linestyle=style, linewidth=0.9)


def _remove_legend(axes: Axes) -> None:
    legend = axes.get_legend()
    if legend is not None:
        legend.remove()


def torque_margins(result: SimulationResult, effort_limit: ArrayLike) -> Figure:
    """Torques as shares of their limits, with the ticks at a limit marked.

    Args:
        result: The run.
        effort_limit: Largest torque, scalar or (nv,), +inf where there is none [N·m or N].
    """
    limit = per_joint("effort_limit", np.asarray(effort_limit, float), result.tau.shape[1])
    with panels(rows=1) as (figure, axes):
        shares = result.tau / limit
        draw_channels(axes[0], result, shares, r"$\tau$ / limit [1]")
        at_limit = np.where(result.saturated, np.sign(shares), np.nan)
        for i, line in enumerate(at_limit.T):
            style: Any = {"color": COLORS[i % len(COLORS)], "linewidth": 3.0, "linestyle": "-"}
            axes[0].plot(result.t, line, **style)
        for side in (-1.0, 1.0):
            axes[0].axhline(side, color="black", linewidth=0.7)
    return figure


def chatter_spectrum(results: Mapping[str, SimulationResult], joint: int = 0) -> Figure:
    """Amplitude spectrum of a joint's torque over the second half of each run.

    Args:
        results: Runs by name, in the order of the legend.
        joint: Index of the joint.
    """
    with panels(rows=1, height=2.6, xlabel="frequency [Hz]") as (figure, axes):
        for name, result in results.items():
            tau = result.tau[len(result.t) // 2 :, joint]
            window = np.hanning(len(tau))
            amplitudes = 2.0 * np.abs(np.fft.rfft((tau - tau.mean()) * window)) / window.sum()
            frequencies = np.fft.rfftfreq(len(tau), float(result.t[1] - result.t[0]))
            axes[0].loglog(frequencies[1:], np.maximum(amplitudes[1:], _FLOOR), label=name)
        unit = " or ".join(dict.fromkeys(force_unit(result, joint) for result in results.values()))
        axes[0].set_ylabel(rf"amplitude of $\tau_{joint + 1}$ [{unit}]")
        axes[0].legend(loc="upper right", fontsize=7.5)
    return figure


def phase_plane(result: SimulationResult, surface: Surface, joint: int = 0) -> Figure:
    """Path of a joint in the plane of e1 and e2, and the sliding surface s = 0 in it.

    Args:
        result: The run.
        surface: Its sliding surface.
        joint: Index of the joint.
    """
    e1, e2 = result.e1[:, joint], result.e2[:, joint]
    xlabel = f"$e_1$ [{position_unit(result, joint)}]"
    with panels(rows=1, width=3.6, height=3.2, xlabel=xlabel) as (figure, axes):
        reach = 1.15 * max(np.abs(e1).max(), _FLOOR), 1.15 * max(np.abs(e2).max(), _FLOOR)
        x, y = np.meshgrid(*(np.linspace(-size, size, 201) for size in reach))
        nv = result.e1.shape[1]
        points = zip(x.ravel(), y.ravel(), strict=True)
        s = np.array([surface.value(np.full(nv, a), np.full(nv, b))[joint] for a, b in points])
        axes[0].contour(x, y, s.reshape(x.shape), levels=[0.0], colors=COLORS[1], linestyles="--")
        axes[0].plot([], [], color=COLORS[1], linestyle="--", label="$s = 0$")
        axes[0].plot(e1, e2, color=COLORS[0], label=result.joint_names[joint])
        axes[0].plot(e1[0], e2[0], "o", color=COLORS[0], markersize=4)
        axes[0].set_ylabel(f"$e_2$ [{rate_unit(result, joint)}]")
        axes[0].legend(loc="best", fontsize=7.5)
    return figure


def robustness_map(
    rows: ArrayLike, columns: ArrayLike, errors: ArrayLike, *, labels: tuple[str, str, str]
) -> Figure:
    """A figure of merit over two parameters, as colours on a log scale with the figures written in.

    Args:
        rows: Values of the first parameter, shape (m,).
        columns: Values of the second, shape (n,).
        errors: Positive figures, shape (m, n); not finite where the run diverged.
        labels: What rows, columns and figures are, with their units.

    Raises:
        ParameterError: The figures have another shape.
    """
    down, right = vector("rows", rows, None, "m"), vector("columns", columns, None, "n")
    figures: Array = np.asarray(errors, np.float64)
    if figures.shape != (len(down), len(right)):
        raise ParameterError(
            "errors", f"shape {figures.shape}", f"shape ({len(down)}, {len(right)})"
        )
    with mpl.rc_context(STYLE | {"axes.grid": False}):
        figure = NotebookFigure(figsize=(1.4 + 0.62 * len(right), 1.1 + 0.42 * len(down)))
        axes = figure.subplots()
        shown = np.ma.masked_invalid(np.maximum(figures, _FLOOR))
        picture = axes.imshow(shown, cmap="cividis_r", norm="log", aspect="auto", origin="lower")
        ticks = LogLocator(subs=(1.0, 2.0, 5.0) if shown.max() < 100.0 * shown.min() else (1.0,))
        bar = figure.colorbar(picture, ax=axes, label=labels[2], ticks=ticks, format="%g")
        bar.minorticks_off()
        middle = np.sqrt(shown.max() * shown.min())
        texts = np.array([[_in_short(x) for x in row] for row in figures])
        draw_cells(axes, texts, (shown > middle).filled(False), fontsize=6.0)
        axes.set_yticks(range(len(down)), [f"{x:g}" for x in down])
        axes.set_xticks(range(len(right)), [f"{x:g}" for x in right])
        axes.set_ylabel(labels[0])
        axes.set_xlabel(labels[1])
    return figure


def _in_short(x: float) -> str:
    """Two digits of a figure, without an exponent where it does without."""
    if not np.isfinite(x):
        return "diverged"
    if 100.0 <= x < 1e4:
        return f"{x:.0f}"
    return f"{x:.2g}" if 0.01 <= x < 100.0 else f"{x:.1e}"


def interaction_energy(result: SimulationResult, balance: EnergyBalance) -> Figure:
    """Torques of the environment, and where the energy of the run went.

    Args:
        result: The run.
        balance: What `energy_balance` returned for it.
    """
    with panels(rows=2) as (figure, axes):
        draw_channels(axes[0], result, result.tau_ext, rf"$\tau_{{ext}}$ [{force_unit(result)}]")
        for name in ("motors", "environment", "friction", "kinetic", "potential"):
            axes[1].plot(result.t, getattr(balance, name), label=name)
        axes[1].set_ylabel("energy [J]")
        axes[1].margins(x=0.0)
        axes[1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5)
    return figure
