"""`rbimpedance bench`: what it prints, never how long anything takes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.cli.bench import MEASUREMENTS, RATIO, TIME, costs, load, tick
from rbimpedance.cli.timing import RNEA

from ..command_line import call

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `--json` printed; the module's only measurement of everything."""
    path = tmp_path_factory.mktemp("bench") / "before.json"
    with pytest.MonkeyPatch.context() as patch, path.open("w", encoding="utf-8") as file:
        patch.setattr("sys.stdout", file)
        assert call(patch, "bench", "two_link", "--ticks", "100", "--json") == 0
    return path


@pytest.mark.slow
def test_every_cost_is_a_positive_time_and_its_ratio_to_the_yardstick(saved: Path) -> None:
    found = json.loads(saved.read_text(encoding="utf-8"))
    assert list(found["costs"]) == list(MEASUREMENTS)
    assert {"date", "processor", "pin"} <= set(found["machine"])
    for part in found["costs"].values():
        assert part[RNEA][RATIO] == 1.0
        for cost in part.values():
            assert cost[TIME] > 0.0
            assert cost[RATIO] == pytest.approx(cost[TIME] / part[RNEA][TIME])


def test_yardstick_is_timed_as_often_as_every_way_to_take_a_tick() -> None:
    done: list[tuple[int, int]] = []
    found = tick(rbi.load_robot("two_link"), 100, lambda *told: done.append(told))
    assert {len(durations) for durations in found.values()} == {100}
    assert done[-1] == (50, 50)


def test_costs_are_medians() -> None:
    found = costs({RNEA: np.array([1.0, 2.0, 9.0]), "step": np.array([5.0, 5.0, 80.0])})
    assert found["step"] == {TIME: 5.0, RATIO: 2.5}


@pytest.mark.slow
def test_comparison_prints_the_ratio_before(
    saved: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    assert call(monkeypatch, "bench", "two_link", "--ticks", "100", "--compare", str(saved)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("two_link on ")
    compared = [line for line in lines if "before" in line]
    assert len(compared) == sum(len(part) for part in load(saved).values())


@pytest.mark.parametrize("text", ["[]", "{}", '{"costs": {"a": {"b": 1.0}}}', "no JSON"])
def test_file_that_bench_did_not_write_is_bad_input(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    (tmp_path / "other.json").write_text(text, encoding="utf-8")
    arguments = ("bench", "two_link", "--compare", str(tmp_path / "other.json"))
    assert call(monkeypatch, *arguments) == 2
    assert "not what `bench --json` printed" in capsys.readouterr().err.replace("\n", " ")


def test_full_says_where_the_whole_benchmark_is(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    assert call(monkeypatch, "bench", "--full") == 2
    assert "python -m benchmarks.speed" in capsys.readouterr().err.replace("\n", " ")
