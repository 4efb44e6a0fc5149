"""Gains that are used for something that they were not tuned for draw one note, the first line on stderr."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import rbimpedance as rbi
from rbimpedance.cli.bench import RATIO, TIME
from rbimpedance.tuning.gains_file import load_gains, save_gains

from ..command_line import call

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def gains(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Gains of the UR5 for up to 1 kg, at 1 ms, without noise."""
    arm = rbi.load_robot("ur5")
    reference = rbi.trajectories.cosine(arm)
    proposal = rbi.propose_gains(
        arm, rbi.Uncertainty(1.0, viscous=0.5), reference, 1e-3,
        q0=reference(0.0).q, duration=0.5, limits=arm.effort_limit,
    )  # fmt: skip
    return save_gains(proposal, tmp_path_factory.mktemp("gains") / "gains.json")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--payload", "5"), "payload 5 kg instead of 0 to 1"),
        (("--payload", "1", "--payload-com", "0,0,0.2"), "centre of mass 0,0,0.2 m instead of 0 to 0"),
        (("--payload", "1", "--payload-gyration", "0.1"), "gyration 0.1 m instead of 0 to 0"),
        (("--inertia-scale", "1.2"), "inertia scale 1.2 instead of 1 to 1"),
        (("--viscous", "2"), "viscous friction 2 N·m·s/rad instead of 0 to 0.5"),
        (("--coulomb", "1"), "dry friction 1 N·m instead of 0 to 0"),
        (("--torque-constant", "0.1"), "torque constant 1.1 instead of 1 to 1"),
        (("--velocity-noise", "0.001"), "velocity noise 0.001 rad/s instead of 0 to 0"),
        (("--delay", "1"), "delay 1 ticks instead of 0 to 0"),
        (("--dt", "0.002"), "--dt 0.002 s instead of 0.001, which is used"),
        (("--limits", "20"), "--limits 20, lower than 28 N·m"),
        (("--armature", "0.5"), "another description of 'ur5'"),
        (("--gravity", "0,0,0"), "another description of 'ur5'"),
    ],
)  # fmt: skip
def test_use_for_something_else_is_noted_with_both_values(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture, gains: Path,
    options: tuple[str, ...], words: str,
) -> None:  # fmt: skip
    run = ("run", "ur5", "--gains", str(gains), "--duration", "0.004", "--quiet")
    call(monkeypatch, *run, *options, "--out", str(tmp_path))
    first = capsys.readouterr().err.splitlines()[0]
    assert first.startswith(f"note: '{gains}' was tuned for something else: ")
    assert words in first


@pytest.mark.parametrize(
    "options", [(), ("--payload", "1"), ("--payload", "0.2,0.7", "--viscous", "0.5"), ("--limits", "urdf")]
)  # fmt: skip
def test_use_for_what_they_were_tuned_for_is_not_noted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture, gains: Path,
    options: tuple[str, ...],
) -> None:  # fmt: skip
    run = ("run", "ur5", "--gains", str(gains), "--duration", "0.004", "--quiet")
    assert call(monkeypatch, *run, *options, "--out", str(tmp_path)) == 0
    assert capsys.readouterr().err == ""


def test_what_lies_outside_is_said_in_python_too(gains: Path) -> None:
    arm, made_for = rbi.load_robot("ur5"), load_gains(gains)
    (heavy,) = rbi.Uncertainty((3.0, 3.0)).sample(arm, 1)
    (light,) = rbi.Uncertainty((0.3, 0.3)).sample(arm, 1)
    assert made_for.outside(arm, heavy) == ("payload 3 kg instead of 0 to 1",)
    assert made_for.outside(arm, light) == ()
    assert made_for.outside(rbi.load_robot("panda"), light)[0].startswith("robot 'panda'")


def test_costs_of_another_robot_are_noted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    monkeypatch.setattr("rbimpedance.cli.bench.MEASUREMENTS", {})
    before = tmp_path / "before.json"
    costs = {"one tick": {"step": {TIME: 1.0, RATIO: 2.0}}}
    before.write_text(json.dumps({"robot": "ur5", "machine": {}, "costs": costs}))
    assert call(monkeypatch, "bench", "two_link", "--compare", str(before)) == 0
    assert "measured with something else: two_link instead of ur5" in capsys.readouterr().err
