"""Messages of the library in the terms of the command line, and input that is found wrong before any work."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common import first_sign
from rbimpedance.cli import law, terminal
from rbimpedance.cli.terminal import progress
from rbimpedance.cli.wording import as_options

from ..command_line import call
from .conftest import PYTHON

Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("python", "options"),
    [
        ("freeze with lock=('a_joint', 'b_joint')", "freeze with --lock a_joint --lock b_joint"),
        ("lock some with lock=(...)", "lock some with --lock NAME"),
        ('weld it with lock=("root_joint",)', "weld it with --lock root_joint"),
        ("name another frame with tool_frame=, or", "name another frame with --tool-frame, or"),
        ("rotor inertia with armature=", "rotor inertia with --armature"),
        ("armature=[0.1, 0.2]", "--armature 0.1,0.2"),
        ("k1 must be positive, got np.float64(-1.0)", "--k1 must be positive, got -1.0"),
        ("SuperTwisting.k1 must be positive", "--k1 must be positive"),
        ("payload_com must be three numbers", "--payload-com must be three numbers"),
        ("a shorter period, dt = 0.0005 s: margin 3", "a shorter period, --dt 0.0005: margin 3"),
        ("accuracy = 0.02 rad instead: margin 3", "--accuracy 0.02 instead: margin 3"),
        ("with a delay of 3 ticks at dt = 0.001 s no margin", "with a delay of 3 ticks at dt = 0.001 s no margin"),
        ("found in '/a/lock/file.urdf'", "found in '/a/lock/file.urdf'"),
    ],
)  # fmt: skip
def test_arguments_become_options(python: str, options: str) -> None:
    assert as_options(python) == options


@pytest.mark.parametrize(
    "error",
    [
        rbi.JointLimitError("center ± amplitude", "a", 3.0, (0.0, 1.0)),
        rbi.ParameterError("duration", np.float64(-1.0), "positive"),
        rbi.ParameterError("k1", np.array([1.0, -1.0]), "positive"),
        rbi.DivergenceError(1.0, "a", None),
        rbi.DimensionError("Limits.effort", "a scalar or one number per joint, shape (nv,) = (8,)", "shape (2,)"),
    ],
)  # fmt: skip
def test_no_error_names_python_on_the_command_line(error: rbi.RBImpedanceError) -> None:
    assert PYTHON.search(as_options(str(error))) is None


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--duration", "0"), "--duration must be"),
        (("--duration", "0.00055"), "multiple"),
        (("--dt", "-1"), "--dt must be"),
        (("--period", "0"), "--period must be"),
        (("--payload", "abc"), "--payload must be"),
        (("--payload", "-1"), "--payload must be"),
        (("--viscous", "1,2,3"), "--viscous must be"),
        (("--amplitude", "9"), "--center ± --amplitude puts"),
        (("--start", "1,2,3"), "--start must be"),
        (("--mass", "1,2,3"), "--mass must be"),
        (("--mass", "-1"), "--mass must be"),
        (("--limits", "1,2,3"), "--limits must be"),
        (("--limits", "-1"), "--limits must be"),
        (("--accuracy", "0"), "--accuracy must be"),
        (("--seed", "-1"), "--seed must be"),
        (("--delay", "-1"), "--delay must be"),
        (("--wrench", "1,2"), "--wrench must be"),
        (("--substeps", "0"), "--substeps must be"),
        (("--out", "file"), "file"),
        (("--html", "file/run.html"), "file"),
    ],
)
def test_input_is_found_wrong_before_gains_are_searched_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture, options: tuple[str, ...], word: str
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    monkeypatch.setattr(law, "propose_gains", lambda *_, **__: pytest.fail("searched"))
    assert call(monkeypatch, "run", "two_link", *options) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert word in said.err
    assert said.out == ""


def test_near_name_and_kinds_of_source_are_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    assert call(monkeypatch, "inspect", "franka") == 2
    said = capsys.readouterr().err
    assert "?;" not in said
    assert said.endswith("or - for standard input\n")


def test_arm_with_a_gripper_is_noted_with_the_option_that_helps(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    gains = ("--k1", "15", "--k2", "40", "--duration", "0.01", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "panda", *gains) == 0
    said = capsys.readouterr().err
    assert said.startswith("note: joints of a gripper are controlled with the arm")
    assert said.endswith("--lock panda_finger_joint1\n")
    assert call(monkeypatch, "run", "panda", *gains, *said.split()[-2:]) == 0
    assert capsys.readouterr().err == ""


def test_missing_rotor_inertia_is_noted_before_the_search(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    def leave(*_: object, **__: object) -> None:
        raise rbi.ParameterError("payload", 2.0, "less")

    monkeypatch.setattr(law, "propose_gains", leave)
    options = ("--payload", "2", "--quiet", "--out", str(tmp_path))
    words = "if the joints are geared, give it: --armature 0.1"
    for command in ("run", "tune"):
        assert call(monkeypatch, command, "panda", *options) == 2
        assert words in capsys.readouterr().err
        assert call(monkeypatch, command, "panda", *options, "--armature", "0.1") == 2
        assert words not in capsys.readouterr().err
    assert call(monkeypatch, "tune", "ur5", *options) == 2
    assert words not in capsys.readouterr().err


def test_long_work_says_so_in_a_file_and_short_work_does_not(
    monkeypatch: pytest.MonkeyPatch, messages: list[str]
) -> None:
    monkeypatch.setattr(terminal, "SILENCE", 0.05)
    with progress("short", quiet=False):
        pass
    with progress("quiet", quiet=True):
        time.sleep(0.2)
    assert messages == []
    with progress("tuning", quiet=False):
        time.sleep(0.3)
    assert messages == ["tuning ..."]


@pytest.mark.parametrize("name", ["rbimpedance", "-m", "my_script.py"])
def test_slow_start_of_the_command_line_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture, name: str
) -> None:
    monkeypatch.setattr(first_sign, "PATIENCE", 0.05)
    monkeypatch.setattr("sys.argv", [name])
    monkeypatch.setattr("sys.orig_argv", ["python", "-m", "rbimpedance"])
    first_sign.watch()
    first_sign.loaded()
    time.sleep(0.2)
    assert capsys.readouterr().err == ""
    first_sign.watch()
    time.sleep(0.2)
    first_sign.loaded()
    expected = "" if name == "my_script.py" else "loading rbimpedance ...\n"
    assert capsys.readouterr().err == expected
    monkeypatch.setattr("sys.argv", [name, "run", "--quiet"])
    first_sign.watch()
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_view_takes_its_old_option_and_warns(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "view", "two_link", "--out", "arm.html") == 0
    assert (
        capsys.readouterr().err == "warning: --out arm.html is deprecated; write --html arm.html\n"
    )
    assert (tmp_path / "arm.html").exists()


def test_control_period_that_no_arm_is_controlled_with_is_refused_at_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "run", "two_link", "--dt", "1") == 2
    assert "--dt must be a control period in seconds, at most 0.1" in capsys.readouterr().err
