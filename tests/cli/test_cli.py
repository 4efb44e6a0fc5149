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

from rbimpedance import ModelError, SimulationResult, load_robot
from rbimpedance.cli import law
from rbimpedance.robot.loading.robot_nicknames import NICKNAMES
from rbimpedance.robot.loading.robot_sources import known_names
from rbimpedance.simulation import scenarios

from .. import arms
from ..arms import LIMIT, urdf, urdf_joint, urdf_link
from ..command_line import call

GAINS = ("--k1", "15", "--k2", "40")


@pytest.mark.slow
def test_paper_writes_figures_and_data_and_names_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "paper", "--duration", "0.2", "--out", str(tmp_path)) == 0
    printed = capsys.readouterr().out
    for name in ("fig2_errors.png", "fig3_impedance_error.png", "fig4_torque.png", "paper.npz"):
        assert (tmp_path / name).stat().st_size > 0
        assert name in printed


@pytest.mark.slow
def test_paper_npz_holds_the_run_of_the_scenario(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = ("--model", "full", "--surface", "fast-terminal", "--scheme", "matched")
    times = ("--duration", "0.2", "--dt", "0.002", "--quiet")
    assert call(monkeypatch, "paper", *options, *times, "--out", str(tmp_path)) == 0
    written = SimulationResult.load(tmp_path / "paper.npz")
    expected = scenarios.paper(
        known="full", surface="fast-terminal", scheme="matched", duration=0.2, dt=0.002
    ).simulate()
    np.testing.assert_array_equal(written.tau, expected.tau)


@pytest.mark.slow
def test_run_takes_a_urdf_on_stdin(tmp_path: Path) -> None:
    urdf = Path(__file__).parents[2] / "urdf" / "two_link.urdf"
    options = ["--duration", "0.1", *GAINS, "--out", str(tmp_path), "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "rbimpedance", "run", "-", *options],
        input=urdf.read_text(encoding="utf-8"),
        capture_output=True,
        text=True,
        check=True,
    )
    said = json.loads(done.stdout)
    assert said["verdict"] == {"ok": True, "failures": [], "remedies": []}
    assert len(said["metrics"]["e1_max"]) == 2
    assert (tmp_path / "result.npz").exists()


@pytest.mark.slow
def test_payload_reaches_the_plant_and_not_the_controller(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = (*GAINS, "--payload", "1", "--duration", "0.05", "--quiet", "--out", str(tmp_path))
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
        (("run", "two_link", "--k1", "0", "--k2", "1"), "k1"),
        (("run", "two_link", "--k1", "one", "--k2", "1"), "--k1"),
        (("run", "two_link", "--k1", "8"), "got '--k1 alone'"),
        (("run", "two_link", "--center", "nan,0"), "--center must be a number or numbers"),
        (("run", "two_link", "--scheme", "explicit"), "--k1 and --k2"),
        (("run", "two_link", *GAINS, "--duration", "0.00055"), "multiple"),
        (("run", "two_link", *GAINS, "--wrench", "1,2,3,4"), "3 or 6 numbers"),
        (("run", "two_link", *GAINS, "--limits", "urdf"), "without effort limits"),
        (("run", "panda", *GAINS, "--amplitude", "3"), "outside its position limits"),
        (
            ("tune", "two_link", "--center", "1,2,3"),
            "2 numbers, one for each of the joints joint1, joint2",
        ),
        (
            ("run", "panda", "--start", "1,2"),
            "8 numbers, one for each of the joints panda_joint1, ",
        ),
        (("run", "ur5", "--amplitude", "1,2"), "the 6 joints are shoulder_pan_joint"),
        (("run", "ur5", *GAINS, "--k1", "1,2"), "the 6 joints are shoulder_pan_joint"),
        (("robots", "no_such_robot"), "no_such_robot"),
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
    options = (
        "--k1",
        "4000",
        "--k2",
        "1e7",
        "--scheme",
        "explicit",
        "--dt",
        "0.02",
        "--start",
        "0",
    )
    assert call(monkeypatch, "run", "two_link", *options, "--quiet", "--out", str(tmp_path)) == 1
    assert "diverged" in capsys.readouterr().err
    kept = SimulationResult.load(tmp_path / "result.npz")
    assert np.isfinite(kept.q).all()


def test_view_writes_one_file_of_the_given_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "view", "two_link", "--html", "two_link.html") == 0
    assert "two_link.html" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["two_link.html"]


@pytest.mark.slow
def test_run_writes_the_animation_that_view_writes_from_its_result(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run, view = tmp_path / "run.html", tmp_path / "view.html"
    options = (*GAINS, "--duration", "0.2", "--wrench", "0,0,5", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options, "--html", str(run)) == 0
    assert call(monkeypatch, "view", str(tmp_path / "result.npz"), "--html", str(view)) == 0
    assert abs(run.stat().st_size - view.stat().st_size) < 1000  # one arrow, given or found


@pytest.mark.slow
def test_view_serves_the_page_until_it_is_interrupted() -> None:
    command = [sys.executable, "-u", "-m", "rbimpedance", "view", "two_link"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0]
        with urllib.request.urlopen(url, timeout=20.0) as answer:
            assert b"two_link" in answer.read()
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(timeout=20.0) == 0
        finally:
            process.kill()  # where this run itself ignores interrupts, so does the command
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5.0)


BARE = """<robot name="bare"><link name="base"/><link name="arm"/>
<joint name="bare" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"""
XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="joint" default="a"/>
<link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"
ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="$(arg joint)" type="continuous">
<parent link="base"/><child link="arm"/></joint></robot>"""


def test_inspect_says_first_that_an_arm_without_masses_has_no_gravity(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(BARE)
    assert call(monkeypatch, "inspect", str(path), "--armature", "0.1") == 2
    assert "--massless --armature" in capsys.readouterr().err
    assert call(monkeypatch, "inspect", str(path), "--armature", "0.1", "--massless") == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert notes[0].startswith("note: NO GRAVITY: the links that 'bare' move have no mass")


def test_argument_of_a_xacro_file_is_passed_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    given = ("inspect", str(path), "--json", "--xacro-arg")
    assert call(monkeypatch, *given, "joint:=elbow") == 0
    assert json.loads(capsys.readouterr().out)["joint_names"] == ["elbow"]
    assert call(monkeypatch, *given, "joint=elbow") == 2
    assert "NAME:=VALUE" in capsys.readouterr().err


def test_nothing_is_coloured_when_output_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "inspect", "two_link") == 0
    assert "\x1b[" not in capsys.readouterr().out


# --- runs that went wrong, and what was asked of them -----------------------------------------------------------


UNGUARDED = ("--limits", "none", "--no-stops")


@pytest.mark.slow
def test_lost_arm_is_exit_code_1_and_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gains = ("--k1", "8", "--k2", "10", "--payload", "2", "--start", "0,0,0,-0.07,0,0,0,0")
    options = (*gains, *UNGUARDED, "--duration", "1.5", "--json", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "panda", *options) == 1
    said = capsys.readouterr()
    line, remedy = said.err.splitlines()[-2:]
    verdict = json.loads(said.out)["verdict"]
    assert not verdict["ok"]
    assert remedy == "- " + verdict["remedies"][0]
    assert line == "failed: " + "; ".join(verdict["failures"])
    for words in (
        "beyond its position limit",
        "leave out --no-stops",
        "from its reference",
        "passed its limit",
    ):
        assert words in line


@pytest.mark.slow
def test_arm_that_leaves_its_position_limits_is_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joint = urdf_joint("turn", "revolute", "base", "hand", "0 1 0", LIMIT)
    (tmp_path / "arm.urdf").write_text(urdf(joint, urdf_link("hand", 1.0)), encoding="utf-8")
    pushed = ("--wrench", "0,0,0,0,60,0", "--duration", "1", "--out", str(tmp_path), "--quiet")
    assert call(monkeypatch, "run", str(tmp_path / "arm.urdf"), *GAINS, *UNGUARDED, *pushed) == 1
    free = SimulationResult.load(tmp_path / "result.npz")
    assert re.search(r"joint 'turn' was \S+ rad beyond its", capsys.readouterr().err)
    assert call(monkeypatch, "run", str(tmp_path / "arm.urdf"), *GAINS, *pushed) == 1
    stopped = SimulationResult.load(tmp_path / "result.npz")
    assert stopped.q.max() < 2.1 < free.q.max()


@pytest.mark.slow
def test_run_without_gains_tunes_them_for_what_is_unknown_and_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--payload", "0.3", "--duration", "0.2", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options) == 0
    said = capsys.readouterr().out
    assert "no gains given: tuning two_link" in said
    assert f"tuned gains ({tmp_path / 'gains.json'})" in said
    tuned = json.loads((tmp_path / "gains.json").read_text(encoding="utf-8"))
    assert tuned["uncertainty"]["payload"] == [0.0, 0.3]
    made_by = SimulationResult.load(tmp_path / "result.npz").provenance
    assert made_by["controller"]["reaching"]["k1"] == tuned["k1"]


@pytest.mark.slow
def test_gains_that_do_not_exist_are_exit_code_1_with_the_remedies(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(law, "REMEDY_TIME", 60.0)
    options = ("--payload", "1", "--position-noise", "0.1", "--json", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options) == 1
    said = capsys.readouterr()
    verdict = json.loads(said.out)["verdict"]
    assert said.err.startswith(f"failed: {verdict['failures'][0]}\n- ")
    assert verdict["failures"][0].startswith("no gains: joint 'joint")
    assert any(remedy.startswith("--accuracy ") for remedy in verdict["remedies"])


@pytest.mark.slow
def test_unknowns_are_in_the_simulated_arm_at_the_last_number_of_each_range(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    unknown = (
        "--payload",
        "0.1,0.5",
        "--viscous",
        "2",
        "--coulomb",
        "0,1",
        "--inertia-scale",
        "0.9",
    )
    options = (*GAINS, *unknown, "--duration", "0.05", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options) == 0
    arm = load_robot("two_link")
    plant = arm.with_scaled_inertia(0.9).with_friction(arm.viscous + 2.0, arm.coulomb + 1.0)
    made_by = SimulationResult.load(tmp_path / "result.npz").provenance
    assert made_by["plant"]["digest"] == plant.with_payload(0.5).digest
    assert made_by["controller"]["arm"]["digest"] == arm.digest


@pytest.mark.slow
def test_run_starts_on_its_reference_or_where_it_is_told_to(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    motion = ("--center", "0.4,-0.3", "--amplitude", "0.1,0.2", "--period", "2")
    options = (*GAINS, *motion, "--duration", "0.05", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options) == 0
    np.testing.assert_allclose(SimulationResult.load(tmp_path / "result.npz").q[0], [0.5, -0.1])
    assert call(monkeypatch, "run", "two_link", *options, "--start", "0.45,-0.05") == 0
    np.testing.assert_allclose(SimulationResult.load(tmp_path / "result.npz").q[0], [0.45, -0.05])


def test_joints_are_chosen_by_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "inspect", "ur5", "--json", "--joints", "elbow_joint") == 0
    assert json.loads(capsys.readouterr().out)["joint_names"] == ["elbow_joint"]


@pytest.mark.slow
def test_wrench_of_six_numbers_turns_the_tool(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = (*GAINS, "--duration", "0.05", "--quiet", "--out", str(tmp_path))
    assert call(monkeypatch, "run", "two_link", *options, "--wrench", "0,0,0,0,-2,0") == 0
    result = SimulationResult.load(tmp_path / "result.npz")
    np.testing.assert_allclose(np.abs(result.tau_ext[0]), 2.0)  # both axes are parallel to y


@pytest.mark.slow
def test_controller_keeps_the_torque_limits_of_the_description_unless_told_otherwise(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    options = (*GAINS, "--duration", "0.01", "--quiet", "--out", str(tmp_path))
    for limits, expected in (((), 150.0), (("--limits", "none"), None)):
        assert call(monkeypatch, "run", "ur5", *options, *limits) == 0
        made_by = SimulationResult.load(tmp_path / "result.npz").provenance["controller"]
        kept = made_by["limits"]
        assert (None if kept is None else np.ravel(kept["effort"])[0]) == expected


@pytest.mark.slow
@pytest.mark.parametrize(("word", "now"), [("mass", "inertia"), ("full", "full")])
def test_old_option_known_works_and_warns(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    word: str,
    now: str,
) -> None:
    options = ("two_link", *GAINS, "--duration", "0.02", "--json", "--out", str(tmp_path))
    assert call(monkeypatch, "run", *options, "--known", word) == 0
    old = capsys.readouterr()
    assert old.err == f"warning: --known {word} is deprecated; write --model {now}\n"
    assert call(monkeypatch, "run", *options, "--model", now) == 0
    new = capsys.readouterr()
    assert new.err == ""
    assert old.out == new.out


@pytest.mark.slow
def test_paper_takes_the_old_word_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--duration", "0.02", "--json", "--out", str(tmp_path))
    assert call(monkeypatch, "paper", *options, "--known", "mass") == 0
    old = capsys.readouterr()
    assert old.err == "warning: --known mass is deprecated; write --model inertia\n"
    assert call(monkeypatch, "paper", *options) == 0
    assert old.out == capsys.readouterr().out


# --- robots -----------------------------------------------------------------------------------------------------


def test_robots_are_listed_with_the_joints_that_loading_them_gives(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "robots", "--json") == 0
    listed = {robot["name"]: robot for robot in json.loads(capsys.readouterr().out)["robots"]}
    assert listed["two_link"]["source"] == "bundled"
    assert listed["panda"]["source"] == "example-robot-data"
    assert listed["solo12"]["floating"]
    for name in ("two_link", "panda", "ur5", "z1", "xarm7", "kinova", "talos_arm"):
        assert listed[name]["joints"] == load_robot(name).nv
    assert set(known_names()) == set(listed)


def test_robots_of_a_name_are_those_whose_names_contain_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "robots", "UR5", "--quiet") == 0
    names = capsys.readouterr().out.split()
    assert "ur5" in names
    assert all("ur5" in name for name in names)


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        ("franka", "did you mean 'panda'"),
        ("franka_emika_panda", "did you mean 'panda'"),
        ("Gen3", "did you mean 'gen3_description' of robot_descriptions"),
        ("iiwa", "'iiwa14_description'"),
        ("yumi", "'yumi_description'"),
        ("UR5e", "'ur5e_description'"),
    ],
)
def test_name_of_a_maker_leads_to_its_robots(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    asked: str,
    answer: str,
) -> None:
    for command in ("inspect", "robots"):
        assert call(monkeypatch, command, asked) == 2
        assert answer in capsys.readouterr().err
    with pytest.raises(ModelError, match=answer):
        load_robot(asked)


def test_every_nickname_leads_to_names_that_can_be_loaded() -> None:
    here = set(known_names())
    for names in NICKNAMES.values():
        assert [
            name for name in names if name not in here and not name.endswith("_description")
        ] == []


def test_a_payload_that_does_not_load_the_last_joint_is_noted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(
        arms.urdf(arms.urdf_joint("turn", "continuous", "base", "hub"), arms.urdf_link("hub", 2.0))
    )
    options = ("--payload", "0.1", "--duration", "0.1", "--quiet", "--out", str(tmp_path))
    call(monkeypatch, "run", str(file), *GAINS, *options)
    assert "the tool frame 'hub' lies on the axis of joint 'turn'" in capsys.readouterr().err


def test_run_of_an_arm_without_masses_says_that_there_is_no_gravity(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(
        arms.urdf(arms.urdf_joint("turn", "continuous", "base", "hub"), '<link name="hub"/>')
    )
    options = ("--massless", "--armature", "0.1", "--duration", "0.1", "--out", str(tmp_path))
    call(monkeypatch, "run", str(file), *GAINS, *options)
    said = capsys.readouterr()
    assert said.err.startswith("note: NO GRAVITY")
    assert "ok: within its limits" in said.out
