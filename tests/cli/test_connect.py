"""`rbimpedance connect`: it says what it will do, drives the simulated robot, and refuses what is unsafe."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import call

SIM = ("connect", "sim", "two_link", "--duration", "0.2")


def test_plan_is_printed_before_the_report(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, *SIM, "--payload", "0.3", "--out", str(tmp_path)) == 0
    said = capsys.readouterr().out
    assert said.index("hold where it is for 0.2 s") < said.index("RunReport: finished")
    with np.load(tmp_path / "connect.npz") as log:
        assert len(log["t"]) > 100


def test_report_as_json_has_the_loop_statistics(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lossy = ("--lost", "0.1", "--json", "--out", str(tmp_path))
    assert call(monkeypatch, *SIM, *lossy) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["ended"] == "finished"
    assert figures["missed"] > 0


def test_motion_that_begins_elsewhere_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text("t,joint1,joint2\n0,2.5,0\n1,2.5,0.1\n")
    code = call(monkeypatch, *SIM, "--trajectory", str(motion), "--out", str(tmp_path))
    assert code == 2
    assert "away from where the motion begins" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("connect", "franka", "two_link"), "--host must be the address of the robot"),
        ((*SIM, "--effort", "2"), "--effort must be more than 0 and at most 1"),
    ],
)
def test_bad_input_is_said_and_leaves_with_2(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: str,
) -> None:
    assert call(monkeypatch, *arguments, "--out", str(tmp_path)) == 2
    assert words in capsys.readouterr().err
