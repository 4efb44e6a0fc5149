"""The figures that explain a run show what they say, with a unit on every axis."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import rbimpedance as rbi
from rbimpedance import ParameterError, SimulationResult
from rbimpedance._common.arrays import Array
from rbimpedance.pictures import figures as plotting
from rbimpedance.simulation import scenarios


@pytest.fixture(scope="module")
def result() -> SimulationResult:
    return scenarios.paper(duration=1.0).simulate()


@pytest.fixture(scope="module")
def certificate() -> rbi.Certificate:
    surface = scenarios.paper_surface("fast-terminal")
    return rbi.certify(60.0, 200.0, 1.0, s0=[2.0, 1.0], disturbance0=0.0, surface=surface, e0=0.1)


def curves(axes: Axes) -> list[Array]:
    """The curves over time, without the straight marks."""
    return [
        np.asarray(line.get_ydata()) for line in axes.lines if len(np.ravel(line.get_xdata())) > 2
    ]


def test_convergence_draws_the_certificates_times_in_each_joints_colour(
    result: SimulationResult, certificate: rbi.Certificate
) -> None:
    upper, lower = plotting.convergence(result, certificate).axes
    np.testing.assert_array_equal(curves(upper)[0], np.abs(result.e1[:, 0]))
    np.testing.assert_array_equal(curves(lower)[1], np.abs(result.e_im[:, 1]))
    assert upper.get_yscale() == lower.get_yscale() == "log"
    marks = {
        (
            round(float(np.ravel(line.get_xdata())[0]), 9),
            to_hex(line.get_color()),
            line.get_linestyle(),
        )
        for line in upper.lines
        if len(np.ravel(line.get_xdata())) == 2
    }
    expected = {
        (round(float(times[i]), 9), plotting.COLORS[i].lower(), style)
        for times, style in ((certificate.reaching_time, ":"), (certificate.total_time, "--"))
        for i in range(2)
        if times[i] <= result.t[-1]
    }
    assert marks == expected
    assert expected != set()


def test_torque_margins_are_shares_and_mark_the_ticks_at_a_limit(result: SimulationResult) -> None:
    saturated = np.zeros_like(result.saturated)
    saturated[100:200, 1] = True
    marked = dataclasses.replace(result, saturated=saturated)
    (axes,) = plotting.torque_margins(marked, [50.0, np.inf]).axes
    shares = curves(axes)
    np.testing.assert_allclose(shares[0], result.tau[:, 0] / 50.0)
    np.testing.assert_array_equal(shares[1], 0.0)
    np.testing.assert_array_equal(np.isfinite(shares[3]), saturated[:, 1])


def test_spectrum_shows_a_tone_at_its_frequency_and_amplitude(result: SimulationResult) -> None:
    tau = np.tile(3.0 * np.sin(2.0 * np.pi * 80.0 * result.t)[:, np.newaxis], (1, 2))
    tone = dataclasses.replace(result, tau=tau)
    (axes,) = plotting.chatter_spectrum({"tone": tone}, joint=1).axes
    (line,) = axes.lines
    frequencies, amplitudes = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert frequencies[np.argmax(amplitudes)] == pytest.approx(80.0, abs=2.0)
    assert amplitudes.max() == pytest.approx(3.0, rel=0.03)


@pytest.mark.slow
def test_phase_plane_draws_the_path_and_the_surface_it_ends_on(result: SimulationResult) -> None:
    surface = rbi.PowerSurface(gamma=3.0, exponent=5.0 / 3.0)
    (axes,) = plotting.phase_plane(result, surface, joint=1).axes
    path = axes.lines[1]
    np.testing.assert_array_equal(path.get_xdata(), result.e1[:, 1])
    np.testing.assert_array_equal(path.get_ydata(), result.e2[:, 1])
    drawn = np.concatenate([p.vertices for p in axes.collections[0].get_paths()])
    x, y = drawn.T
    reach = np.abs(result.e2[:, 1]).max()
    expected = -3.0 * np.sign(x) * np.abs(x) ** (5.0 / 3.0)
    np.testing.assert_allclose(y, expected, atol=0.01 * reach)


def test_robustness_map_writes_every_figure_and_says_where_a_run_diverged() -> None:
    errors = [[1e-3, 0.02], [4.0, np.inf], [np.nan, 810.0]]
    figure = plotting.robustness_map([0, 1, 2], [10, 20], errors, labels=("kg", "k1", "rad"))
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["1.0e-03", "0.02", "4", "diverged", "diverged", "810"]


def test_robustness_map_refuses_figures_of_another_shape() -> None:
    with pytest.raises(ParameterError, match=r"shape \(2, 2\)"):
        plotting.robustness_map([0, 1], [1, 2], [[1.0, 2.0]], labels=("a", "b", "c"))


def test_energy_figure_shows_the_balance(result: SimulationResult) -> None:
    balance = rbi.energy_balance(result, rbi.load_robot("two_link"))
    upper, lower = plotting.interaction_energy(result, balance).axes
    np.testing.assert_array_equal(curves(upper)[0], result.tau_ext[:, 0])
    np.testing.assert_array_equal(curves(lower)[0], balance.motors)


@pytest.mark.slow
def test_every_axis_says_its_unit(result: SimulationResult, certificate: rbi.Certificate) -> None:
    surface = rbi.PowerSurface(gamma=3.0, exponent=5.0 / 3.0)
    balance = rbi.energy_balance(result, rbi.load_robot("two_link"))
    figures: list[Figure] = [
        plotting.convergence(result, certificate),
        plotting.torque_margins(result, 60.0),
        plotting.chatter_spectrum({"one": result}),
        plotting.phase_plane(result, surface),
        plotting.interaction_energy(result, balance),
    ]
    for figure in figures:
        assert all("[" in axes.get_ylabel() for axes in figure.axes)
        assert "[" in figure.axes[-1].get_xlabel()


@pytest.mark.slow
def test_notebooks_show_figures(result: SimulationResult) -> None:
    for figure in (plotting.torques(result), plotting.comparison({"one": result})):
        assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
