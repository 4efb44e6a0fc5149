"""No number of docs/hardware-limits.md is typed by hand, and the linear theory beside its runs is that of the loop."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from benchmarks.arms import ARMS
from benchmarks.control.hardware import compare_page, page
from benchmarks.control.hardware.linear import Linear
from rbimpedance.control.default_gains import slope_at_zero
from rbimpedance.law.input_gain import loop_matrix

from ..arms import pendulum

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures" / "hardware.json"
LAWS = ROOT / "docs" / "figures" / "hardware_laws.json"


def test_tables_are_those_of_the_measured_figures() -> None:
    text = (ROOT / "docs" / "hardware-limits.md").read_text("utf-8")
    rows = json.loads(FIGURES.read_text("utf-8"))["arms"]
    assert rows.keys() == ARMS.keys()
    for place, table in page.tables(rows).items():
        assert f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->" in text, place


def test_tables_of_laws_are_those_of_the_measured_figures() -> None:
    text = (ROOT / "docs" / "hardware-limits.md").read_text("utf-8")
    for place, table in compare_page.tables(json.loads(LAWS.read_text("utf-8"))).items():
        assert f"<!-- {place} -->\n\n{table}\n\n<!-- end of {place} -->" in text, place


def linear(**changes: Any) -> Any:
    """One link of 0.5 on a rotor of 0.2 kg·m²."""
    one = np.ones(1)
    settings: dict[str, Any] = {
        "model": 0.7 * np.eye(1),
        "links": 0.5 * np.eye(1),
        "viscous": 0.0 * one,
        "rotor": 0.2 * one,
        "stiffness": None,
        "damping": 0.0 * one,
        "time_constant": 0.0,
        "side": "motor",
        "is_differentiated": False,
        "slope": 60.0,
        "margin": 2.0,
        "h": 1e-3,
    }
    return Linear(**(settings | changes))


@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0, 4.0])
def test_perfect_drive_gives_the_loop_of_the_gains(gain: float) -> None:
    loop = linear(model=gain * 0.7 * np.eye(1))
    values = np.linalg.eigvals(loop_matrix(gain, 2.0, 0, 60.0 * 1e-3))
    assert loop.radius() == pytest.approx(np.abs(values).max(), rel=1e-9)


def test_very_stiff_springs_and_fast_torque_give_the_loop_of_a_perfect_drive() -> None:
    rigid = linear().radius()
    stiff = linear(stiffness=np.array([1e11]), damping=np.array([1e6])).radius()
    fast = linear(time_constant=1e-8).radius()
    assert [stiff, fast] == pytest.approx([rigid, rigid], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("is_elastic", [False, True])
def test_runs_settle_and_chatter_where_linear_theory_says(is_elastic: bool) -> None:
    arm = pendulum().with_gravity(np.zeros(3)).with_armature(0.2)
    surface = rbi.FastTerminalSurface(2.0, 3.0, 0.6, smoothing=1e-2)
    trajectory, slope = rbi.trajectories.hold(arm), float(slope_at_zero(surface, 1)[0])
    springs: dict[str, Any] = {"stiffness": 800.0, "damping": 3.0} if is_elastic else {}

    def loop(margin: float) -> Any:
        changes = {name: np.array([value]) for name, value in springs.items()}
        return linear(**changes, slope=slope, margin=margin, time_constant=4e-3)

    below, above = 1.0, 100.0  # unstable and stable margins
    assert not loop(below).is_stable()
    assert loop(above).is_stable()
    for _ in range(20):
        middle = float(np.sqrt(below * above))
        below, above = (below, middle) if loop(middle).is_stable() else (middle, above)

    def kept(margin: float) -> float:
        """What is left of s after two seconds: nothing where it decays, all of it in a limit cycle."""
        reaching = rbi.SuperTwisting(20.0, 50.0, "matched", margin)
        target = rbi.Impedance(1.0, 10.0, 20.0)
        law = rbi.ImpedanceController(arm, target, surface, reaching, dt=1e-3)
        plant = rbi.DrivenPlant(arm, time_constant=4e-3, **springs)
        start = arm.integrate(arm.neutral, [1e-4])
        result = rbi.simulate(law, plant, trajectory, q0=start, duration=2.5)
        t, s = result.t, np.abs(result.s)
        return float(s[t > 2.3].max() / s[(t > 0.5) & (t < 0.7)].max())

    assert kept(1.1 * above) < 0.05
    assert kept(above / 1.5) > 0.5
