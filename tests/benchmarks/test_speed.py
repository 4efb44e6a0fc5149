"""The benchmark: what its tables say of each other, never how long anything takes."""

from __future__ import annotations

import gc
import math
import sys
from contextlib import ExitStack
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import rbimpedance as rbi
from benchmarks.speed import libraries, paced, page, report, startup, ticks
from benchmarks.speed.__main__ import main, measure
from benchmarks.speed.cases import chain, load
from benchmarks.speed.comparison import computed_torques
from benchmarks.speed.goals import section as goals
from benchmarks.speed.loop_tables import batch, loop
from benchmarks.speed.plan import QUICK, Setting
from benchmarks.speed.report import RATIO, Line, Report, Section
from benchmarks.speed.tick_tables import TOTAL, linear_fit, phases, tick
from benchmarks.speed.workers import Worker, WorkerError
from rbimpedance.cli import timing
from rbimpedance.cli.timing import REALTIME, RNEA, inputs, interleaved, timer
from rbimpedance.robot.loading.plain_urdf import plain

ROOT = Path(__file__).parents[2]
PLAN = QUICK._replace(ticks=200, runs=2, loop_ticks=50, batch_ticks=20, worlds=(2,))

ECHO = """
import sys
for line in sys.stdin:
    verb, what, *numbers = line.split()
    if what == "die":
        sys.exit("it was told to")
    print(*(numbers if verb == "call" else [1500.0] * int(numbers[0])), flush=True)
"""


def no_progress(done: int, total: int) -> None:
    del done, total


@pytest.fixture(scope="module")
def setting() -> Setting:
    return Setting("two_link", load("two_link"), PLAN, no_progress)


@pytest.fixture(scope="module")
def tick_table(setting: Setting) -> Section:
    return tick(setting)


def ratios(section: Section) -> list[float]:
    return [x for line in section.lines for k, x in line.figures.items() if k.startswith(RATIO)]


def a_report(*values: float) -> Report:
    lines = tuple(Line(f"line {i}", {"a [µs]": x, f"{RATIO} b": x}) for i, x in enumerate(values))
    return Report({"date": "today"}, (Section("key", "Title", "Text.", lines),))


@pytest.mark.slow
def test_phases_sum_to_the_total(setting: Setting) -> None:
    table = phases(setting)
    for backend in ("pinocchio", "compiled"):
        of_backend = [line for line in table.lines if line.name.startswith(backend)]
        *parts, total = [line.figures["time [µs]"] for line in of_backend]
        assert of_backend[-1].name.endswith(TOTAL)
        assert math.fsum(parts) == pytest.approx(total, rel=1e-12)


def test_ratios_of_the_tick_are_positive_and_those_of_the_yardstick_one(
    tick_table: Section,
) -> None:
    assert min(ratios(tick_table)) > 0.0
    own = tick_table.line(RNEA).figures
    assert {x for name, x in own.items() if name.startswith(RATIO)} == {1.0}


def test_percentiles_rise(tick_table: Section) -> None:
    for line in tick_table.lines:
        values = [x for name, x in line.figures.items() if not name.startswith(RATIO)]
        assert values == sorted(values)


@pytest.mark.slow
def test_yardsticks_of_the_closed_loop_make_one(setting: Setting) -> None:
    table = loop(setting)
    figure = f"{RATIO} (rnea + aba)"
    shares = [table.line(name).figures[figure] for name in (RNEA, "pin.aba")]
    assert sum(shares) == pytest.approx(1.0)
    assert min(ratios(table)) > 0.0


def test_every_number_of_worlds_is_measured(setting: Setting) -> None:
    table = batch(setting)
    assert {line.name.split()[0] for line in table.lines} == {"2"}
    assert min(ratios(table)) > 0.0


def test_everything_is_timed_as_often_as_asked() -> None:
    arm = load("two_link")
    rnea = timer(timing.rnea(arm, inputs(arm)))
    found = interleaved({"a": rnea, "b": rnea}, 100, rounds=5)
    assert {name: len(durations) for name, durations in found.items()} == {"a": 100, "b": 100}


def test_paced_loop_gives_one_duration_a_period() -> None:
    arm = load("two_link")
    found = paced.run({RNEA: timing.rnea(arm, inputs(arm))}, 5, 1e-4)
    assert found.durations[RNEA].shape == found.late.shape == (5,)
    assert found.late.min() >= 0.0


@pytest.mark.slow
@pytest.mark.parametrize("mode", paced.COLLECTORS)
def test_garbage_collector_is_left_as_it_was(mode: str) -> None:
    with paced.collector(mode):
        assert gc.isenabled() == (mode != "off")
        assert (gc.get_freeze_count() > 0) == (mode == "frozen")
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_ticks_leave_no_blocks_behind() -> None:
    made = ticks.of_arm(load("two_link"))[REALTIME["compiled"]]
    _, blocks = startup.growth(made, 2000)
    assert blocks < 100  # of 2000 ticks


def test_line_is_fitted_exactly_to_points_on_a_line() -> None:
    assert linear_fit((1, 2, 5), [3.0, 5.0, 11.0]) == pytest.approx((2.0, 1.0, 1.0))


def test_chain_has_as_many_joints_as_asked_for() -> None:
    assert [chain(n).nv for n in (1, 4)] == [1, 4]


def test_report_comes_back_from_its_file(tmp_path: Path, tick_table: Section) -> None:
    found = Report({"date": "today"}, (tick_table,))
    found.save(tmp_path / "report.json")
    assert report.load(tmp_path / "report.json") == found


def test_figure_that_is_not_finite_is_null_in_the_file(tmp_path: Path) -> None:
    a_report(math.inf).save(tmp_path / "report.json")
    back = report.load(tmp_path / "report.json")
    assert math.isnan(back.sections[0].lines[0].figures["a [µs]"])


def test_report_compared_with_itself_gives_one(tick_table: Section) -> None:
    found = Report({}, (tick_table,))
    factors = {change.factor for change in report.changes(found, found)}
    assert factors == {1.0}


def test_comparison_looks_at_ratios_only() -> None:
    (change,) = report.changes(a_report(2.0), a_report(3.0))
    assert (change.figure, change.factor) == (f"{RATIO} b", 1.5)


def test_file_that_is_no_report_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text("[]", encoding="utf-8")
    with pytest.raises(rbi.InputError, match="not a report"):
        report.load(tmp_path / "other.json")


def test_goal_is_met_up_to_its_bound_and_missed_beyond_it() -> None:
    def verdict(ratio: float) -> str:
        laws = Section("laws", "", "", (Line("any", {f"{RATIO} rnea, step, compiled": ratio}),))
        (line,) = goals(Report({}, (laws,))).lines
        return line.note

    assert (verdict(1.0), verdict(1.01)) == ("met", "MISSED")


def test_page_is_rewritten_between_its_marks_only(tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    path.write_text(f"before\n\n{page.BEGIN}\nold\n{page.END}\n\nafter\n", encoding="utf-8")
    page.write(a_report(1.0), path, "figure.png")
    text = path.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "| line 0 | 1 | 1 |" in text
    assert "old" not in text


def test_page_without_marks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(rbi.InputError, match="must be a page with the lines"):
        page.write(a_report(1.0), tmp_path / "page.md", "figure.png")


def test_documentation_has_the_marks() -> None:
    text = (ROOT / "docs/benchmarks.md").read_text(encoding="utf-8")
    assert 0 < text.index(page.BEGIN) < text.index(page.END)


def test_worker_answers_and_is_timed_in_microseconds() -> None:
    with Worker([sys.executable, "-c", ECHO]) as worker:
        assert worker.call("back", [1.0, -0.1]).tolist() == [1.0, -0.1]
        assert worker.timer("back")(3).tolist() == [1.5, 1.5, 1.5]


def test_worker_writes_its_logs_elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    code = "import sys; sys.stdin.readline(); print(open('LOG', 'w').write('said'))"
    with Worker([sys.executable, "-c", code]) as worker:
        assert worker.call("log").tolist() == [4]
    assert not list(tmp_path.iterdir())


def test_worker_that_ends_leaves_its_last_words() -> None:
    with Worker([sys.executable, "-c", ECHO]) as worker, pytest.raises(WorkerError) as raised:
        worker.call("die")
    assert str(raised.value) == "it was told to"


def reasons(names: tuple[str, ...], sources: Path) -> dict[str, str]:
    with ExitStack() as stack:
        return libraries.start(stack, Path("no.urdf"), names, sources).reasons


def test_missing_compiler_is_a_row_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CXX", raising=False)
    assert reasons(("c++",), ROOT / "benchmarks" / "speed")["c++"].startswith("no C++ compiler")


def test_peer_that_does_not_install_is_a_row_that_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    python = tmp_path / "rbimpedance/environments/tsid/bin/python"

    def create(folder: Path, **options: bool) -> None:
        assert options["with_pip"]
        (folder / "bin").mkdir(parents=True)
        python.write_text(
            '#!/bin/sh\necho "ERROR: No such library" >&2\nexit 1\n', encoding="utf-8"
        )
        python.chmod(0o755)

    monkeypatch.setattr("venv.create", create)
    reason = reasons(("tsid",), ROOT / "benchmarks" / "speed")["tsid"]
    assert reason == "does not install: No such library"


@pytest.mark.parametrize("name", libraries.PEERS)
def test_every_peer_has_a_program_and_is_in_the_extra(name: str) -> None:
    source = ROOT / "benchmarks" / "speed" / "peers" / f"{name}_peer.py"
    program = source.read_text(encoding="utf-8")
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert [task for task in libraries.PEERS[name].tasks if f'"{task}": ' not in program] == []
    assert [need for need in libraries.PEERS[name].requirements if f'"{need}"' not in project] == []


def test_plain_description_has_the_dynamics_of_the_locked_arm() -> None:
    whole = rbi.load_robot("panda")
    fingers = ("panda_finger_joint1", "panda_finger_joint2")
    assert whole.description is not None
    text = plain(whole.description.xml, fingers)
    locked = load("panda").with_friction(0.0, 0.0)
    given = inputs(locked)[:3]
    mine, theirs = (computed_torques(arm, given) for arm in (rbi.load_robot(text), locked))
    np.testing.assert_allclose(mine, theirs, rtol=0.0, atol=1e-10)
    assert "mesh" not in text


def test_ticks_of_all_kinds_go_on_for_ever() -> None:
    made = ticks.of_arm(load("two_link"))
    assert {name: len(list(islice(one, 70))) for name, one in made.items()} == dict.fromkeys(
        made, 70
    )


def test_report_of_a_table_has_its_goals_and_says_what_it_ran_on() -> None:
    found = measure("two_link", ["loop"], "quick", show=False).data()
    assert [section["key"] for section in found["sections"]] == ["goals", "loop"]
    assert {"date", "processor", "pin"} <= set(found["machine"])


def test_unknown_section_is_bad_input() -> None:
    with pytest.raises(rbi.ParameterError, match="did you mean 'tick'"):
        main(section=["tik"])
