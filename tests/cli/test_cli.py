"""The command line does what its help says, and fails with the exit code that it promises."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from rbimpedance import SimulationResult, load_robot
from rbimpedance.cli import app as cli
from rbimpedance.simulation import scenarios

from ..command_line import call


def test_paper_writes_figures_and_data_and_names_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "paper", "--duration", "0.2", "--out", str(tmp_path)) == 0
    printed = capsys.readouterr().out
    for name in ("fig2_errors.png", "fig3_impedance_error.png", "fig4_torque.png", "paper.npz"):
        assert (tmp_path / name).stat().st_size > 0
        assert name in printed


def test_paper_npz_holds_the_run_of_the_scenario(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = ("--known", "full", "--surface", "fast-terminal", "--scheme", "matched")
    times = ("--duration", "0.2", "--dt", "0.002", "--quiet")
    assert call(monkeypatch, "paper", *options, *times, "--out", str(tmp_path)) == 0
    written = SimulationResult.load(tmp_path / "paper.npz")
    expected = scenarios.paper(
        known="full", surface="fast-terminal", scheme="matched", duration=0.2, dt=0.002
    ).simulate()
    np.testing.assert_array_equal(written.tau, expected.tau)


def test_run_takes_a_urdf_on_stdin(tmp_path: Path) -> None:
    urdf = Path(__file__).parents[2] / "urdf" / "two_link.urdf"
    options = ["--duration", "0.1", "--payload", "0.5", "--out", str(tmp_path), "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "rbimpedance", "run", "-", *options],
        input=urdf.read_text(encoding="utf-8"),
        capture_output=True,
        text=True,
        check=True,
    )
    metrics = json.loads(done.stdout)["metrics"]
    assert len(metrics["e1_max"]) == 2
    assert (tmp_path / "result.npz").exists()


def test_payload_reaches_the_plant_and_not_the_controller(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = ("--payload", "1", "--duration", "0.05", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options) == 0
    made_by = SimulationResult.load(tmp_path / "result.npz").provenance
    arm = load_robot("two_link")
    assert made_by["controller"]["arm"]["digest"] == arm.digest
    assert made_by["plant"]["digest"] == arm.with_payload(1.0).digest


def test_inspect_prints_the_limits_that_the_urdf_gives(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "inspect", "ur5", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["joint_names"][0] == "shoulder_pan_joint"
    assert said["effort_limit"] == [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("run", "no_such_robot"), "no_such_robot"),
        (("run", "two_link", "--dt", "-1"), "dt"),
        (("run", "two_link", "--k1", "0"), "k1"),
        (("run", "two_link", "--k1", "one"), "--k1"),
        (("run", "two_link", "--duration", "0.00055"), "multiple"),
        (("inspect", "two_link", "--gravity", "0,0"), "--gravity"),
    ],
)
def test_bad_input_is_exit_code_2_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    word: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, *arguments) == 2
    assert word in capsys.readouterr().err


def test_divergence_is_exit_code_1_and_keeps_the_run_so_far(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--k1", "4000", "--k2", "1e7", "--scheme", "explicit", "--dt", "0.02")
    assert call(monkeypatch, "run", "two_link", *options, "--quiet", "--out", str(tmp_path)) == 1
    assert "diverged" in capsys.readouterr().err
    kept = SimulationResult.load(tmp_path / "result.npz")
    assert np.isfinite(kept.q).all()


def test_view_writes_one_file_named_after_the_robot(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "view", "two_link", "--html") == 0
    assert "two_link.html" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["two_link.html"]


def test_run_writes_the_animation_that_view_writes_from_its_result(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run, view = tmp_path / "run.html", tmp_path / "view.html"
    options = ("--duration", "0.2", "--wrench", "0,0,5", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options, "--html", str(run)) == 0
    assert call(monkeypatch, "view", str(tmp_path / "result.npz"), "--out", str(view)) == 0
    assert abs(run.stat().st_size - view.stat().st_size) < 1000  # one arrow, given or found


def test_view_serves_the_page_until_it_is_interrupted() -> None:
    command = [sys.executable, "-u", "-m", "rbimpedance", "view", "two_link"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0]
        with urllib.request.urlopen(url, timeout=20.0) as answer:
            assert b"two_link" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20.0) == 0
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5.0)


def test_inspect_says_first_that_an_arm_without_masses_has_no_gravity(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(
        '<robot name="bare"><link name="base"/><link name="arm"/><joint name="bare" type="continuous">'
        '<parent link="base"/><child link="arm"/></joint></robot>'
    )
    assert call(monkeypatch, "inspect", str(path), "--armature", "0.1") == 2
    assert "--massless --armature" in capsys.readouterr().err
    assert call(monkeypatch, "inspect", str(path), "--armature", "0.1", "--massless") == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert notes[0].startswith("note: NO GRAVITY: the links that 'bare' move have no mass")


def test_argument_of_a_xacro_file_is_passed_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="joint" default="a"/>'
        '<link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="$(arg joint)" type="continuous">'
        '<parent link="base"/><child link="arm"/></joint></robot>'
    )
    given = ("inspect", str(path), "--json", "--xacro-arg")
    assert call(monkeypatch, *given, "joint:=elbow") == 0
    assert json.loads(capsys.readouterr().out)["joint_names"] == ["elbow"]
    assert call(monkeypatch, *given, "joint=elbow") == 2
    assert "NAME:=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["paper", "run", "inspect", "view"])
def test_help_shows_an_example(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert call(monkeypatch, command, "--help") == 0
    assert f"Example: rbimpedance {command}" in capsys.readouterr().out


def test_nothing_is_coloured_when_output_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "inspect", "two_link") == 0
    assert "\x1b[" not in capsys.readouterr().out


def test_help_loses_no_unit_to_markup() -> None:
    source = Path(cli.__file__).read_text(encoding="utf-8")
    helps = re.findall(r'help="([^"]*)"', source)
    assert len(helps) > 20
    assert [text for text in helps if "[" in text] == []
