"""Figures of a run at the tool."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ..._common.arrays import Array
from ...exceptions import ParameterError
from ...simulation.result import SimulationResult
from ...simulation.tool_log import ToolLog
from ..tool import Compliance, compliance_of
from .style import COLORS, STYLE, NotebookFigure, draw_channels, panels

_AXES = ("#d62728", "#2ca02c", "#1f77b4")  # x, y and z of a frame
_POSES = 4  # at which the frames are drawn
_TRIAD, _ARROW, _BALL = 0.18, 0.4, 0.2  # lengths, as shares of the picture's width


def tool_errors(result: SimulationResult) -> Figure:
    """Error of the tool's pose over time, translation and rotation, and the wrench that the controller was given.

    Args:
        result: One of a controller at the tool.

    Raises:
        ParameterError: It has no `tool`.
    """
    log = _log(result)
    with panels(rows=4, height=1.7) as (figure, axes):
        draw_channels(axes[0], result, log.e1[:, :3], "$e_1$ [m]", ("x", "y", "z"))
        draw_channels(axes[1], result, log.e1[:, 3:], "$e_1$ [rad]", ("rx", "ry", "rz"))
        draw_channels(axes[2], result, log.wrench[:, :3], "force [N]", ("x", "y", "z"))
        moment = log.wrench[:, 3:]
        draw_channels(axes[3], result, moment, r"moment [N$\cdot$m]", ("x", "y", "z"))
    return figure


def tool_path(result: SimulationResult) -> Figure:
    """Path of the tool and its reference in space, with both frames, the force, and the compliance of the target.

    Frames are drawn at some instants, the tool's short and thick, the reference's long and thin. The longest force is
    an arrow at the instant when it acts. The ellipsoid at the end is long where the target is soft.

    Args:
        result: One of a controller at the tool.

    Raises:
        ParameterError: It has no `tool`.
    """
    log = _log(result)
    with mpl.rc_context(STYLE):
        figure = NotebookFigure(figsize=(5.6, 5.0))
        space: Any = figure.add_subplot(projection="3d")
        for positions, style in ((log.position_r, "--"), (log.position, "-")):
            space.plot(
                *positions.T, style, color=COLORS[0] if style == "--" else "k", linewidth=1.0
            )
        middle, width = _cube(log)
        for k in np.linspace(0, len(log.position) - 1, _POSES).round().astype(int):
            _draw_frame(space, log.position[k], log.rotation[k], 0.7 * _TRIAD * width, 2.4)
            _draw_frame(space, log.position_r[k], log.rotation_r[k], _TRIAD * width, 0.9)
        _draw_force(space, log, _ARROW * width)
        compliance = compliance_of(result)
        if compliance is not None:
            _draw_ellipsoid(space, log, compliance, _BALL * width)
        for name, x in zip("xyz", middle, strict=True):
            getattr(space, f"set_{name}lim")(x - width / 2.0, x + width / 2.0)
            getattr(space, f"set_{name}label")(f"{name} [m]")
        space.set_box_aspect((1.0, 1.0, 1.0))
        space.legend(["reference", "tool"], loc="upper left", fontsize=7.5)
    return figure


def _log(result: SimulationResult) -> ToolLog:
    if result.tool is None:
        raise ParameterError("result", "one of the joints", "one of a controller at the tool")
    return result.tool


def _cube(log: ToolLog) -> tuple[Array, float]:
    """Middle and width of a cube around both paths, no smaller than a hand's breadth [m]."""
    points = np.concatenate([log.position, log.position_r])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, max(1.6 * float((high - low).max()), 0.1)


def _draw_frame(space: Any, p: Array, R: Array, length: float, thick: float) -> None:
    for axis, color in zip(R.T, _AXES, strict=True):
        ends = np.transpose([p, p + length * axis])
        space.plot(*ends, "-", color=color, linewidth=thick)


def _draw_force(space: Any, log: ToolLog, length: float) -> None:
    sizes = np.linalg.norm(log.wrench[:, :3], axis=1)
    k = int(np.argmax(sizes))
    if sizes[k] > 0.0:
        arrow = length * log.wrench[k, :3] / sizes[k]
        space.quiver(*log.position[k], *arrow, color="#d55e00", linewidth=1.8)
        space.text(
            *(log.position[k] + 1.1 * arrow), f"{sizes[k]:.3g} N", fontsize=7.5, color="#d55e00"
        )


def _draw_ellipsoid(space: Any, log: ToolLog, compliance: Compliance, size: float) -> None:
    polar, azimuth = np.mgrid[0.0 : np.pi : 16j, 0.0 : 2.0 * np.pi : 32j]
    ball = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    )
    half = size * compliance.sizes / compliance.sizes.max()
    skin = log.position_r[-1] + (ball * half) @ compliance.rotation(log.rotation_r[-1]).T
    space.plot_surface(*np.moveaxis(skin, -1, 0), color="#e69f00", alpha=0.25, linewidth=0.0)
