"""Figures show the data that they are given, with a unit on every axis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from rbimpedance import (
    SimulationResult,
    SuperTwisting,
    estimate_disturbance,
    load_robot,
)
from rbimpedance.pictures import figures as plotting
from rbimpedance.pictures.figures.style import name_lines
from rbimpedance.simulation import scenarios


@pytest.fixture(scope="module")
def result() -> SimulationResult:
    return scenarios.paper(scheme="matched", duration=0.1).simulate()


def drawn(axes: Axes) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """The curves of an axes as columns."""
    return np.column_stack([line.get_ydata() for line in axes.lines])


@pytest.mark.parametrize(
    ("draw", "channels"),
    [
        (plotting.tracking_errors, ("e1", "e2")),
        (plotting.impedance_error, ("e_im",)),
        (plotting.torques, ("tau",)),
    ],
)
def test_figure_shows_every_joint_of_its_channels(
    result: SimulationResult,
    draw: Callable[[SimulationResult], Figure],
    channels: tuple[str, ...],
) -> None:
    panels = draw(result).axes
    assert len(panels) == len(channels)
    for axes, channel in zip(panels, channels, strict=True):
        np.testing.assert_array_equal(drawn(axes), getattr(result, channel))
        legend = axes.get_legend()
        assert legend is not None
        assert [text.get_text() for text in legend.get_texts()] == ["joint1", "joint2"]


def test_every_axis_says_its_unit(result: SimulationResult) -> None:
    estimate = estimate_disturbance(result, load_robot("two_link"), SuperTwisting(60.0, 200.0))
    figures = [
        plotting.tracking_errors(result),
        plotting.impedance_error(result),
        plotting.torques(result),
        plotting.disturbance(result, estimate),
        plotting.comparison({"one": result, "other": result}),
    ]
    labels = [axes.get_ylabel() for figure in figures for axes in figure.axes]
    labels += [figure.axes[-1].get_xlabel() for figure in figures]
    assert [label for label in labels if label and "[" not in label] == []


def test_comparison_names_every_law_and_the_figure_of_its_bar(result: SimulationResult) -> None:
    upper, lower, bars = plotting.comparison({"first": result, "second": result}).axes
    variation = f"{result.metrics(after=0.05)['tau_variation'][0]:.3g}"
    assert [text.get_text().split() for text in bars.texts] == [
        [variation, "first"],
        [variation, "second"],
    ]
    for axes in (upper, lower):
        assert [text.get_text() for text in axes.texts] == ["first", "second"]


def test_names_stand_beside_the_ends_of_their_lines_and_apart() -> None:
    figure = Figure()
    axes = figure.subplots()
    ends = {"low": 1e-3, "middle": 1.0, "close": 1.1, "high": 1e3}
    for name, y in ends.items():
        axes.semilogy([0.0, 1.0], [1.0, y], label=name)
    name_lines(axes, axes.get_lines())
    figure.canvas.draw()
    shown = {text.get_text(): text for text in axes.texts if isinstance(text, Annotation)}
    for name, y in ends.items():
        _, wanted = axes.transAxes.inverted().transform(axes.transData.transform((1.0, y)))
        assert shown[name].xy[1] == pytest.approx(wanted)
    places = np.array([shown[name].xyann[1] for name in ends]) * axes.bbox.height
    assert (np.diff(places) >= 7.5 / 72.0 * figure.dpi).all()  # the height of a line of text


def test_style_does_not_leak_into_the_users_figures(result: SimulationResult) -> None:
    before = dict(mpl.rcParams)
    plotting.torques(result)
    assert dict(mpl.rcParams) == before


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_ending_chooses_the_format(result: SimulationResult, tmp_path: Path, ending: str) -> None:
    path = plotting.save(plotting.torques(result), tmp_path / f"figure.{ending}")
    start = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[ending]
    assert path.read_bytes().startswith(start)
