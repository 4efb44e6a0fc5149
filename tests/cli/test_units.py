"""Figures of joints that slide are in m, N and kg; those of joints that turn in rad, N·m and kg·m²."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.cli import tune_tables
from rbimpedance.pictures import figures

from ..arms import LIMIT, urdf, urdf_joint, urdf_link
from ..command_line import call

Capture = pytest.CaptureFixture[str]
GAINS = ("--k1", "15", "--k2", "40", "--duration", "0.02")


def arm_of(folder: Path, *kinds: str) -> str:
    """A chain of joints of these kinds, as a file."""
    names = ["base", *(f"link{i}" for i in range(len(kinds)))]
    parts = [
        urdf_joint(f"{kind}{i}", kind, names[i], names[i + 1], "0 1 0", LIMIT)
        + urdf_link(names[i + 1], 1.0)
        for i, kind in enumerate(kinds)
    ]
    file = folder / "arm.urdf"
    file.write_text(urdf(*parts), encoding="utf-8")
    return str(file)


def headings(text: str) -> str:
    """What stands in brackets."""
    return " ".join(re.findall(r"\[[^\]]*\]", text.replace("\n", " ")))


def test_run_of_sliding_joints_is_in_metres_and_newtons(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    file = arm_of(tmp_path, "prismatic")
    assert call(monkeypatch, "run", file, *GAINS, "--out", str(tmp_path)) == 0
    told = headings(capsys.readouterr().out)
    assert "[m]" in told
    assert "[N/s]" in told
    assert "rad" not in told
    assert "N·m" not in told


def test_run_of_both_kinds_has_a_table_for_each(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    file = arm_of(tmp_path, "revolute", "prismatic")
    assert call(monkeypatch, "run", file, *GAINS, "--out", str(tmp_path)) == 0
    said = capsys.readouterr().out
    turns, slides = said[: said.index("prismatic1")], said[said.index("prismatic1") :]
    assert "revolute0" in turns
    assert "|e1| largest [rad]" in turns
    assert "|e1| largest [m]" in slides
    assert "[rad" not in slides
    assert "e_im: impedance error" in said


def test_axes_name_the_units_of_the_joints(tmp_path: Path) -> None:
    for kinds, unit, force in (
        (("prismatic",), "[m]", "[N]"),
        (("revolute",), "[rad]", r"[N$\cdot$m]"),
        (("revolute", "prismatic"), "[rad or m]", r"[N$\cdot$m or N]"),
    ):
        arm = rbi.load_robot(arm_of(tmp_path, *kinds))
        law = rbi.ImpedanceController(arm)
        result = rbi.simulate(law, arm, rbi.trajectories.hold(arm), duration=0.01)
        assert figures.tracking_errors(result).axes[0].get_ylabel() == f"$e_1$ {unit}"
        assert figures.torques(result).axes[0].get_ylabel() == rf"$\tau$ {force}"


def test_error_of_fast_motion_is_explained_by_the_step_of_the_simulation() -> None:
    """Without a disturbance, the simulated error is h/2·a over the surface's slope, whatever the motion's speed."""
    arm = rbi.load_robot("ur5")
    for period in (6.0, 2.0):
        motion = rbi.trajectories.cosine(arm, amplitude=0.1, period=period)
        proposal = rbi.propose_gains(
            arm, rbi.Uncertainty(), motion, 1e-3, q0=motion(0.0).q, duration=period / 2.0
        )
        late = max(case.error.max() for case in proposal.worst)
        assert late < proposal.error.max() < 10.0 * late
        np.testing.assert_allclose(late, tune_tables.step_error(proposal), rtol=0.05)
        assert f"the error is {proposal.error.max():.2g} rad at most" in proposal.explain()


def test_table_of_gains_of_sliding_joints_is_in_kilograms(tmp_path: Path) -> None:
    arm = rbi.load_robot(arm_of(tmp_path, "revolute", "prismatic"))
    motion = rbi.trajectories.cosine(arm, center=0.5, amplitude=0.05)
    proposal = rbi.propose_gains(
        arm, rbi.Uncertainty(), motion, 1e-3, q0=motion(0.0).q, duration=0.1
    )
    turns, slides = tune_tables.gains_tables(proposal)
    assert "inertia \\[kg·m^2]" in [str(column.header) for column in turns.columns]
    assert "inertia \\[kg]" in [str(column.header) for column in slides.columns]
    assert "rad or m" in proposal.explain()


def test_refused_gains_of_a_sliding_joint_are_explained_in_newtons_and_metres(
    tmp_path: Path,
) -> None:
    arm = rbi.load_robot(arm_of(tmp_path, "prismatic"))
    motion = rbi.trajectories.cosine(arm, center=0.5, amplitude=0.05)
    asked: dict[str, Any] = {"dt": 1e-3, "q0": motion(0.0).q, "duration": 0.1, "remedy_time": 0.0}
    weak = rbi.propose_gains(arm, rbi.Uncertainty(), motion, limits=rbi.Limits(1e-3), **asked)
    exact = rbi.propose_gains(arm, rbi.Uncertainty(payload=1.0), motion, accuracy=1e-15, **asked)
    for refused, unit in ((weak, "N"), (exact, "m")):
        assert not refused.feasible
        assert re.search(rf"\d {unit}\b", refused.explain())
        assert not re.search(r"N·m|\brad\b", refused.explain())


def test_the_verdict_of_a_sliding_arm_is_in_m(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    call(monkeypatch, "run", arm_of(tmp_path, "prismatic"), *GAINS, "--out", str(tmp_path / "out"))
    assert re.search(r"its rms error is \S+ m in the last", capsys.readouterr().out)


def test_a_run_says_when_nothing_is_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    arm, out = arm_of(tmp_path, "revolute"), ("--out", str(tmp_path / "out"))
    call(monkeypatch, "run", arm, *GAINS, *out, "--seed", "3")
    assert "nothing is unknown" in capsys.readouterr().out
    call(monkeypatch, "run", arm, *GAINS, *out, "--coulomb", "0.1")
    assert "nothing is unknown" not in capsys.readouterr().out
