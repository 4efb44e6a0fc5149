"""`run --frame` and `tune --frame`: what they simulate, in metres and radians at the tool, and what they refuse."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.robot.dexterous import ENOUGH, dexterity, dexterous_configuration

from ..command_line import call

Capture = pytest.CaptureFixture[str]
Patch = pytest.MonkeyPatch
ARM = ("ur5", "--frame", "tool0", "--armature", "0.1")
GAINS = ("--k1", "15,25,10", "--k2", "60,150,20")


@pytest.fixture(scope="module")
def said(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[rbi.SimulationResult, dict[str, object]]:
    """A pushed tool on a line, as a result and as JSON."""
    out, patch = tmp_path_factory.mktemp("out"), pytest.MonkeyPatch()
    options = ("--line", "0,0.02,0", "--period", "0.2", "--wrench", "0,0,4", "--duration", "0.15")
    target = ("--stiffness", "1000,1000,400,30,30,30", "--mass", "1,0.1", "--payload", "0.5")
    given = (*ARM, *GAINS, *options, *target, "--substeps", "1", "--json", "--out", str(out))
    with patch.context() as context, redirect_stdout(StringIO()) as printed:
        code = call(context, "run", *given)
    assert code == 0
    return rbi.SimulationResult.load(out / "result.npz"), json.loads(printed.getvalue())


def test_run_moves_the_frame_as_the_options_say(
    said: tuple[rbi.SimulationResult, dict[str, object]],
) -> None:
    """The line ends after half a period; the wrench acts at the frame; the target is the one of the options."""
    result, _ = said
    log, law = result.tool, result.provenance["controller"]["controller"]
    assert log is not None
    assert law["frame"] == "tool0"
    assert law["impedance"]["stiffness"] == [1000.0, 1000.0, 400.0, 30.0, 30.0, 30.0]
    assert law["impedance"]["mass"] == [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]
    assert law["impedance"]["damping_ratio"] == 1.0
    assert_allclose(log.wrench, np.tile([0.0, 0.0, 4.0, 0.0, 0.0, 0.0], (151, 1)), atol=1e-9)
    moved = log.position_r[-1] - log.position_r[0]
    assert_allclose(moved[:2], [0.0, 0.02], atol=1e-9)
    t, w = 0.15, np.sqrt(400.0 / 1.0)
    yielded = 4.0 / 400.0 * (1.0 - (1.0 + w * t) * np.exp(-w * t))
    assert_allclose(moved[2], yielded, rtol=1e-6)
    assert_allclose(log.position[-1], log.position_r[-1], atol=1e-3)


def test_json_has_figures_in_metres_and_radians(
    said: tuple[rbi.SimulationResult, dict[str, object]],
) -> None:
    result, words = said
    log, tool = result.tool, words["tool"]
    assert log is not None
    assert isinstance(tool, dict)
    assert_allclose(tool["e1_max"], np.abs(log.e1).max(axis=0))
    assert_allclose(tool["wrench_max"], [0.0, 0.0, 4.0, 0.0, 0.0, 0.0], atol=1e-9)
    assert words["verdict"] == {"ok": True, "failures": [], "remedies": []}
    m, rad = (np.sqrt(np.mean(np.sum(log.e1[-37:, k : k + 3] ** 2, axis=1))) for k in (0, 3))
    assert f"{m:.2g} m and {rad:.2g} rad at the tool" in str(result.verdict())


def test_tables_are_of_the_tool_and_then_of_the_torques(
    monkeypatch: Patch, tmp_path: Path, capsys: Capture
) -> None:
    options = ("--duration", "0.02", "--circle", "0.05", "--out", str(tmp_path))
    call(monkeypatch, "run", *ARM, *GAINS, *options)
    printed = capsys.readouterr().out
    labels = (
        "|e1| largest [m]",
        "|e1| largest [rad]",
        "wrench, largest [N·m]",
        "|tau| largest [N·m]",
    )
    for words in labels:
        assert words in printed
    assert "|e_im|" not in printed
    files = {"errors.png", "path.png", "torque.png", "result.npz"}
    assert {path.name for path in tmp_path.iterdir()} == files


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("ur5", "--frame", "tool_0"), "'ur5' has no frame 'tool_0'; did you mean 'tool0'?"),
        (("ur5", "--frame", "xyz"), "there are: 'tool0', "),
        (("ur5", "--frame", "tool0", "--tool-frame", "tool0"), "--tool-frame must be left out"),
        (("ur5", "--line", "0,0,1"), "--line must be given with --frame NAME"),
        (("ur5", "--axes", "reference"), "--axes must be given with --frame NAME"),
        ((*ARM, "--amplitude", "1"), "--amplitude must be left out with --frame"),
        ((*ARM, "--line", "0,0"), "--line must be 3 or 6 numbers"),
        ((*ARM, "--line", "0,0,0,4,0,0"), "--line must be a turn shorter than π"),
        ((*ARM, "--circle", "-1"), "--circle must be"),
        ((*ARM, "--line", "0,0,1", "--circle", "1"), "one of them, or neither"),
        ((*ARM, "--mass", "1,2,3"), "--mass must be 2 or 6 numbers"),
        ((*ARM, "--stiffness", "-1,2"), "--stiffness must be"),
        ((*ARM, *GAINS, "--surface", "power"), "--surface must be left out with --frame"),
        ((*ARM, "--k1", "1,2", "--k2", "1"), "--k1 must be 1 or 3 numbers"),
        ((*ARM, *GAINS, "--wrench", "1,2"), "--wrench must be 3 or 6 numbers"),
    ],
)
def test_bad_input_is_exit_code_2_with_the_reason(
    monkeypatch: Patch, tmp_path: Path, capsys: Capture, arguments: tuple[str, ...], word: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "run", *arguments) == 2
    assert word in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ur5", "z1", "two_link", "panda"])
def test_a_tool_begins_where_it_can_move(name: str) -> None:
    """The UR5's ready posture is stretched out; the panda's is as good as any."""
    arm = rbi.load_robot(name)
    q = dexterous_configuration(arm, arm.tool_frame)
    assert dexterity(arm, q, arm.tool_frame) >= ENOUGH
    lower, upper = arm.joint_limits()
    positions = arm.difference(arm.zero, q)
    assert ((positions >= lower) & (positions <= upper)).all()
    assert_allclose(q, dexterous_configuration(arm, arm.tool_frame))
    if dexterity(arm, arm.ready, arm.tool_frame) >= ENOUGH:
        assert_allclose(q, arm.ready)


@pytest.mark.slow
def test_gains_that_tune_writes_are_those_that_run_reads(
    monkeypatch: Patch, tmp_path: Path, capsys: Capture
) -> None:
    task = ("--payload", "1", "--line", "0,0.05,0", "--period", "1", "--out", str(tmp_path))
    assert call(monkeypatch, "tune", *ARM, *task, "--duration", "1") == 0
    printed = capsys.readouterr().out
    for words in ("translation [m]", "rotation [rad]", "1: 0 kg", "in simulation of the worst plants"):  # fmt: skip
        assert words in printed
    assert "null space" not in printed  # six joints have none
    file = tmp_path / "gains.json"
    data = json.loads(file.read_text("utf-8"))
    assert data["frame"] == "tool0"
    run = ("--gains", str(file), "--duration", "0.01", "--json", "--payload", "1")
    assert call(monkeypatch, "run", *ARM, *run, "--out", str(tmp_path)) == 0
    law = rbi.SimulationResult.load(tmp_path / "result.npz").provenance["controller"]["controller"]
    assert_allclose(law["reaching"]["k2"], np.repeat(data["k2"][:2], 3))
    assert law["reaching"]["margin"] == data["margin"][0]
    capsys.readouterr()
    assert call(monkeypatch, "run", "ur5", *run, "--out", str(tmp_path)) == 2
    assert "for the frame 'tool0'" in capsys.readouterr().err


@pytest.mark.slow
def test_no_gains_is_exit_code_1_with_the_block_or_joint(
    monkeypatch: Patch, tmp_path: Path, capsys: Capture
) -> None:
    options = ("--delay", "60", "--duration", "0.5", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "tune", *ARM, "--payload", "2", *options) == 1
    assert "No gains: joint " in capsys.readouterr().out
