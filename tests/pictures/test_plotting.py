"""Figures show the data that they are given, with a unit on every axis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rbimpedance import (
    SimulationResult,
    SuperTwisting,
    estimate_disturbance,
    load_robot,
)
from rbimpedance.pictures import figures as plotting
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
    axes = plotting.comparison({"first": result, "second": result}).axes
    assert [text.get_text() for text in axes[1].get_yticklabels()] == ["first", "second"]
    variation = result.metrics(after=0.05)["tau_variation"][0]
    assert {text.get_text().strip() for text in axes[1].texts} == {f"{variation:.3g}"}


def test_style_does_not_leak_into_the_users_figures(result: SimulationResult) -> None:
    before = dict(mpl.rcParams)
    plotting.torques(result)
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_ending_chooses_the_format(result: SimulationResult, tmp_path: Path, ending: str) -> None:
    path = plotting.save(plotting.torques(result), tmp_path / f"figure.{ending}")
    start = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[ending]
    assert path.read_bytes().startswith(start)
