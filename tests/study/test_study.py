"""Studies: the same table however it is computed, every run a row, and a summary that counts them all."""

from __future__ import annotations

import json
import linecache
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock, create_autospec

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.provenance import provenance
from rbimpedance.control.telemetry import FLAGS
from rbimpedance.pictures.figures import study as _study_figures
from rbimpedance.study import StudyError, execution, find_study, on_dask
from rbimpedance.study.identity import differences, identity
from rbimpedance.study.measures import measure
from rbimpedance.study.summary import ALIKE, geometric_mean
from rbimpedance.study.table import as_table

from ..arms import spinner
from ..command_line import call
from ..studies import (
    CONTROLLERS,
    SMALL,
    TARGET,
    broken,
    deadly,
    spring,
    wild,
    with_controller,
)

pytest.importorskip("pyarrow", reason="needs the extra 'study'")

ROOT = Path(__file__).parents[2]
Rows = list[dict[str, Any]]


def rows(study: rbi.Study, folder: Path, **options: Any) -> Rows:
    found: Rows = rbi.run_study(study, folder, **options).to_pylist()
    return found


def identities(found: Rows) -> list[tuple[Any, ...]]:
    return [
        tuple(row[k] for k in ("robot", "disturbance", "sample", "controller")) for row in found
    ]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    return rows(SMALL, tmp_path_factory.mktemp("small"))


# --- the same table, however it is computed ---------------------------------------------------------------------


@pytest.mark.slow
def test_every_run_is_a_row_in_the_order_of_the_study(small: Rows) -> None:
    assert identities(small) == [
        (robot, disturbance, sample, controller)
        for robot in ("one", "two")
        for disturbance in ("payload", "push")
        for sample in (0, 1)
        for controller in CONTROLLERS
    ]
    assert {row["status"] for row in small} == {"done"}


@pytest.mark.slow
def test_two_workers_of_which_one_dies_give_the_rows_of_one_process(tmp_path: Path) -> None:
    """The only test that starts processes for Dask."""
    pytest.importorskip("distributed", reason="needs the extra 'study'")
    marker = tmp_path / "died"
    study = with_controller("deadly", partial(deadly, marker))
    of_two = rows(study, tmp_path / "two", jobs=2)
    assert marker.exists()
    assert of_two == rows(study, tmp_path / "one")
    table, other = (tmp_path / name / "small.parquet" for name in ("two", "one"))
    assert table.read_bytes() == other.read_bytes()


@pytest.mark.slow
def test_study_whose_process_is_killed_goes_on_to_the_same_rows(
    tmp_path: Path, small: Rows
) -> None:
    code = (
        "import os, signal, sys; from pathlib import Path; import rbimpedance as rbi\n"
        "from tests.studies import SMALL\n"
        "def on_run(done, total):\n"
        "    if done == 7: os.kill(os.getpid(), signal.SIGKILL)\n"
        "rbi.run_study(SMALL, sys.argv[1], on_run=on_run)"
    )
    killed = subprocess.run([sys.executable, "-c", code, tmp_path], cwd=ROOT, check=False)
    assert killed.returncode == -signal.SIGKILL
    done: list[int] = []
    assert rows(SMALL, tmp_path, on_run=lambda count, _: done.append(count)) == small
    assert done == list(range(4, 17))


def test_damaged_part_is_computed_again(tmp_path: Path) -> None:
    study = SMALL.part(robots=("one",), samples=1)
    before = rows(study, tmp_path)
    part = sorted((tmp_path / "parts").iterdir())[1]
    part.write_bytes(part.read_bytes()[:100])
    done: list[int] = []
    assert rows(study, tmp_path, on_run=lambda count, _: done.append(count)) == before
    assert done == [2, 3, 4]


def test_part_of_a_study_has_the_rows_of_the_whole(tmp_path: Path, small: Rows) -> None:
    part = SMALL.part(robots=("two",), controllers=("spring",), disturbances=("push",), samples=1)
    (found,) = rows(part, tmp_path)
    (whole,) = [row for row in small if identities([row]) == [("two", "push", 0, "spring")]]
    assert {name: whole[name] for name in found} == found
    assert {name for name in whole if name not in found} == {"input_payload"}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 6}, "seed"),
        ({"duration": 0.06}, "duration"),
        ({"controllers": {"torque": spring, "spring": spring}}, "controllers"),
    ],
)
def test_folder_of_another_study_is_refused_and_what_differs_is_named(
    change: dict[str, Any], named: str, tmp_path: Path
) -> None:
    part = SMALL.part(robots=("one",), disturbances=("push",), samples=1)
    rows(part, tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    with pytest.raises(StudyError, match=f"holds a different study: .* differs .* in {named}"):
        rows(replace(part, **change), tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before


class OneProcess:
    """What a Dask client is to a study, in this process; one disturbance kills every worker."""

    def __init__(self, deadly: str) -> None:
        self.deadly = deadly

    def submit(self, function: Callable[..., Any], *arguments: Any, key: str) -> Any:
        from distributed import Future, KilledWorker  # noqa: PLC0415

        future = create_autospec(Future, instance=True)
        killed = KilledWorker(key, None, 3) if arguments[-1] == self.deadly else None
        future.exception.return_value = killed
        future.result.side_effect = lambda: function(*arguments)
        return future

    def cancel(self, futures: list[Any]) -> None:
        assert len(futures) == 4


@pytest.mark.slow
def test_chunk_that_kills_its_workers_becomes_rows_and_is_tried_again_at_the_next_start(
    tmp_path: Path, small: Rows, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra 'study'")
    monkeypatch.setattr(distributed, "as_completed", list)
    monkeypatch.setattr(execution, "cluster", lambda *_: nullcontext(OneProcess("push")))
    found = rows(SMALL, tmp_path, jobs=2)
    assert identities(found) == identities(small)
    lost = [row for row in found if row["disturbance"] == "push"]
    assert {(row["status"], row["reason"]) for row in lost} == {
        ("failed", "its worker died, 4 times")
    }
    assert [row for row in found if row not in lost] == [
        {name: value for name, value in row.items() if name != "input_force"}
        for row in small
        if row["disturbance"] == "payload"
    ]
    assert rows(SMALL, tmp_path) == small


def test_workers_with_other_versions_are_refused() -> None:
    client = Mock()
    client.run.return_value = {"tcp://there": "0.0.1"}
    with pytest.raises(
        StudyError, match=r"worker tcp://there has rbimpedance 0\.0\.1; this process"
    ):
        on_dask.check_workers(client)


def test_identity_is_that_of_the_code_and_not_of_its_layout(tmp_path: Path) -> None:
    texts = (
        "def make(task):\n    return task.arm\n",
        "def make(\n  task,\n):  # why\n  return task.arm",
    )
    told = []
    for text in (*texts, texts[0].replace("arm", "dt")):
        (tmp_path / "mine.py").write_text(
            f"{text}\nfrom tests import studies\nSTUDY = studies.with_controller('made', make)\n",
            encoding="utf-8",
        )
        linecache.clearcache()
        told.append(identity(find_study(f"{tmp_path / 'mine.py'}:STUDY")))
    assert differences(told[0], told[1]) == []
    assert differences(told[0], told[2]) == ["controllers"]


# --- every controller meets the same plants ---------------------------------------------------------------------


def test_every_controller_meets_what_was_drawn_for_the_sample_and_each_sample_is_another(
    small: Rows,
) -> None:
    drawn: dict[tuple[Any, ...], set[tuple[float | None, float | None]]] = {}
    for row in small:
        experiment = row["robot"], row["disturbance"], row["sample"]
        drawn.setdefault(experiment, set()).add((row["input_payload"], row["input_force"]))
    assert [len(inputs) for inputs in drawn.values()] == 8 * [1]
    assert len(set().union(*drawn.values())) == 8


def test_draws_depend_on_names_and_not_on_what_else_is_in_the_study() -> None:
    fewer = SMALL.part(robots=("two",), controllers=("spring",), disturbances=("push",))
    draws = [study.generator("two", "push", 1).uniform() for study in (SMALL, fewer)]
    assert draws[0] == draws[1]
    others = [("one", "push", 1), ("two", "payload", 1), ("two", "push", 0)]
    assert draws[0] not in {SMALL.generator(*other).uniform() for other in others}
    assert draws[0] != replace(SMALL, seed=6).generator("two", "push", 1).uniform()


# --- runs that fail ---------------------------------------------------------------------------------------------


def test_run_that_fails_or_diverges_is_a_row_with_its_reason_and_the_others_go_on(
    tmp_path: Path,
) -> None:
    makers = {"wild": wild, "broken": broken, "spring": spring}
    study = replace(SMALL.part(robots=("one",), samples=1), controllers=makers)
    diverged, failed, done, *_ = rows(study, tmp_path)
    assert diverged["status"] == "diverged"
    assert 0.0 <= diverged["diverged_at"] < 0.05
    assert diverged["worst_joint"] in {"joint1", "joint2"}
    assert (failed["status"], done["status"]) == ("failed", "done")
    assert failed["reason"] == "ValueError: no gains for one: <object object at 0x...>"
    assert diverged["deviation_rms"] is failed["deviation_rms"] is None
    assert done["deviation_rms"] > 0.0
    assert diverged["input_payload"] == failed["input_payload"] == done["input_payload"]


def test_robot_that_cannot_be_loaded_costs_its_own_runs_only(tmp_path: Path) -> None:
    def missing() -> rbi.study.Task:
        raise rbi.ModelError("no such arm")

    study = replace(SMALL, robots={"none": missing, "one": SMALL.robots["one"]}, samples=1)
    found = rows(study, tmp_path)
    assert [row["status"] for row in found] == 4 * ["failed"] + 4 * ["done"]
    assert found[0]["reason"] == "ModelError: no such arm"


# --- what is measured -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [lambda: rbi.load_robot("two_link"), spinner])
def test_deviation_is_the_step_response_where_the_arm_does_not_yield(
    make: Callable[[], rbi.ArmModel],
) -> None:
    """M_d = 1, D_d = 3, K_d = 2: poles at -1 and -2, q_e = tau·(1/2 - exp(-t) + exp(-2t)/2)."""
    arm, dt, after = make(), 0.01, 0.5
    task = rbi.study.Task(robot="arm", arm=arm, impedance=rbi.Impedance(1.0, 3.0, 2.0), dt=dt)
    t = np.linspace(0.0, 1.99, 200)
    tau_ext = np.linspace(0.3, 1.0, arm.nv)
    still, nothing = np.tile(arm.neutral, (len(t), 1)), np.zeros((len(t), arm.nv))
    unused: Any = dict.fromkeys(("v", "e1", "e2", "e_im", "s"), nothing)
    unused |= dict.fromkeys(FLAGS, nothing.astype(np.bool_))
    result = rbi.SimulationResult(
        t=t,
        q=still,
        q_r=still,
        tau_ext=np.tile(tau_ext, (len(t), 1)),
        tau=nothing + (-1.0) ** np.arange(len(t))[:, None],
        **unused,
        provenance=provenance(spring_on(arm, dt), arm),
    )
    figures = measure(result, task, rbi.trajectories.hold(arm, arm.neutral), after)
    response = (0.5 - np.exp(-t) + np.exp(-2.0 * t) / 2.0)[t >= after]
    expected = np.outer(response, tau_ext)
    assert figures["deviation_rms"] == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-9)
    assert figures["deviation_max"] == pytest.approx(expected.max(), rel=1e-9)
    assert figures["worst_joint"] == arm.joint_names[-1]
    assert figures["tau_variation"] == pytest.approx(2.0 / dt * arm.nv, rel=1e-9)
    assert figures["e1_max"] == 0.0


def spring_on(arm: rbi.ArmModel, dt: float) -> Any:
    return rbi.baselines.PDGravity(arm, TARGET, dt)


def test_errors_are_those_of_the_true_motion_where_the_controller_sees_another(
    tmp_path: Path,
) -> None:
    def noisy(task: rbi.study.Task, rng: np.random.Generator) -> rbi.study.Experiment:
        wrap = partial(rbi.tuning.ImperfectController, position_noise=0.1)
        calm = SMALL.disturbances["push"](task, rng)
        return replace(calm, environment=None, wrap=wrap)

    study = replace(SMALL, disturbances={"noise": noisy}, samples=1, duration=0.01, after=0.0)
    found = rows(study.part(robots=("one",)), tmp_path)
    for row in found:
        assert row["e1_max"] == pytest.approx(row["deviation_max"], rel=1e-9)
        assert row["e1_max"] < 0.02


# --- the summary ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_interval_covers_the_true_ratio_as_often_as_it_says_though_samples_of_a_cell_are_alike() -> (
    None
):
    covered = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        logs = [
            np.log(0.5) + effect + 0.05 * rng.standard_normal(7)
            for effect in 0.4 * rng.standard_normal(40)
        ]
        found = geometric_mean(np.sum(logs, axis=1), np.full(40, 7.0))
        covered += found["low"] <= 0.5 <= found["high"]
    assert 36 <= covered <= 39


def made_up(controller: str, sample: int, status: str = "done", **figures: float) -> dict[str, Any]:
    told = dict.fromkeys(
        ("deviation_rms", "deviation_max", "e_im_rms", "e1_rms", "tau_variation", "tau_peak"), 1.0
    )
    key = {"study": "s", "robot": "r", "disturbance": f"d{sample % 2}", "sample": sample}
    return (
        key
        | {"controller": controller, "status": status}
        | (told | figures if status == "done" else {})
    )


def test_summary_counts_every_run_and_takes_ratios_of_pairs_that_both_ended() -> None:
    table = [
        *(made_up("ours", i, deviation_rms=0.5, tau_variation=2.0) for i in range(4)),
        made_up("ours", 4, "diverged"),
        made_up("ours", 5, deviation_rms=3.0, tau_variation=ALIKE * 0.999),
        made_up("ours", 6, "failed"),
        *(made_up("other", i) for i in range(3)),
        made_up("other", 3, "diverged"),
        *(made_up("other", i) for i in (4, 5)),
        made_up("other", 6, "diverged"),
    ]
    found = rbi.study.summarize(as_table(table))
    ours = found["controllers"]["ours"]
    assert [ours[k] for k in ("runs", "done", "diverged", "failed")] == [7, 5, 1, 1]
    told = found["compared"]["other"]
    counts = [told[k] for k in ("pairs", "only_ours_ended", "only_other_ended", "none_ended")]
    assert counts == [7, 1, 1, 1]
    assert (told["worse"], told["share_worse"]) == (2, 2 / 6)
    ratio = told["all"]["deviation_rms"]
    assert (ratio["pairs"], ratio["ratio"]) == (4, pytest.approx((0.5**3 * 3.0) ** 0.25))
    alike = told["equal_torque_variation"]["deviation_rms"]
    assert (alike["pairs"], alike["ratio"], alike["low"]) == (1, pytest.approx(3.0), None)
    worst = [(cell["disturbance"], cell["lost"]) for cell in told["worse_cells"]]
    assert worst == [("d0", 1), ("d1", -1)]


@pytest.mark.slow
@pytest.mark.parametrize("draw", _study_figures.FIGURES.values(), ids=_study_figures.FIGURES)
@pytest.mark.parametrize("statuses", [("done", "done"), ("done", "diverged"), ("failed", "failed")])
def test_figures_show_what_there_is(
    draw: Callable[[Any], Any], statuses: tuple[str, str], tmp_path: Path
) -> None:
    table = [
        made_up(name, i, status, deviation_rms=1e-3 * (i + 1))
        for i in range(4)
        for name, status in zip(("ours", "other"), statuses, strict=True)
    ]
    draw(as_table(table)).savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000


# --- the command ------------------------------------------------------------------------------------------------

FILE = """
from pathlib import Path
from dataclasses import replace
from tests import studies

def stopped(task):
    if not Path("go").exists():
        raise KeyboardInterrupt
    return studies.spring(task)

STUDY = replace(studies.SMALL.part(robots=("one",)), controllers={"spring": studies.spring, "stopped": stopped})
"""


@pytest.mark.slow
def test_study_stopped_by_hand_says_how_to_go_on_and_then_does(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(FILE, encoding="utf-8")
    command = ("study", "mine.py:STUDY", "--out", "out", "--samples", "1")
    assert call(monkeypatch, *command) == 130
    said = "stopped: what is done is kept in 'out'; the same command continues from there\n"
    assert capsys.readouterr().err == said
    Path("go").touch()
    assert call(monkeypatch, *command) == 0
    names = ["small.parquet", "summary.json", "deviation.png", "ratio.png", "pareto.png"]
    assert capsys.readouterr().out.endswith(f"written: {', '.join(f'out/{n}' for n in names)}\n")
    assert all(Path("out", name).is_file() for name in names)
    assert call(monkeypatch, *command, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("out", "summary.json").read_text(encoding="utf-8"))
    assert told["compared"]["stopped"]["all"]["deviation_rms"]["ratio"] == 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("stand",), "no study 'stand': .* did you mean 'standard'"),
        (("none.py:STUDY",), "no file 'none.py'"),
        (("tests.studies:NOTHING",), "'tests.studies' has nothing of the name 'NOTHING'"),
        (("tests.studies:SMALL", "--controllers", "sprung"), "did you mean 'spring'"),
        (("tests.studies:SMALL", "--jobs", "0"), "jobs must be a positive whole number"),
        (("tests.studies:SMALL", "--samples", "0"), "samples must be a positive whole number"),
    ],
)
def test_study_that_cannot_be_is_exit_code_2_with_a_word_on_what_would(
    arguments: tuple[str, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "study", *arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert re.search(words, said.err)


def test_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(rbi.MissingExtraError, match=r'pip install -e "\.\[study\]"'):
        rbi.run_study(SMALL, tmp_path / "out")
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "dask", None)
    with pytest.raises(rbi.MissingExtraError, match=r'pip install -e "\.\[study\]"'):
        rbi.run_study(SMALL, tmp_path / "out", jobs=2)


def test_study_of_a_module_is_found_by_its_name() -> None:
    assert find_study("tests.studies:SMALL") is SMALL
