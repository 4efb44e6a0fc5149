"""The sweep over promises of `propose_gains(…, hardware=…)`: what it samples, counts, and goes on from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.control.hardware import promise, promise_page
from benchmarks.control.hardware.promise import PLANTS, Sampled, Shares

PROMISED: dict[str, Any] = {"promised": 2e-3, "multiple": 1.5}


@pytest.mark.parametrize(("share", "corner"), [(1.0, 0), (0.0, -1)])
def test_sampled_plants_reach_from_one_corner_of_what_is_unknown_to_the_other(
    share: float, corner: int
) -> None:
    case = Sampled("z1", 3.0)
    found = case.anywhere(Shares(share, share, share, share))
    expected = case.unknown().extremes(case.arm())[corner].plant
    q = np.array(case.arm().ready)
    np.testing.assert_allclose(found.mass_matrix(q), expected.mass_matrix(q), rtol=1e-12)
    assert np.array_equal(found.coulomb, expected.coulomb)
    assert np.array_equal(found.viscous, expected.viscous)


@pytest.mark.parametrize(
    ("error", "variation", "outcome"),
    [
        (2.3e-3, 17.0, "kept"),
        (2.5e-3, 10.0, "error"),
        (1.0e-3, 21.0, "loud"),
        (np.inf, np.inf, "diverged"),
    ],
)
def test_promise_is_kept_up_to_a_fifth_more_than_was_said(
    error: float, variation: float, outcome: str
) -> None:
    run = {"error": error, "variation": variation}
    assert promise.verdict(PROMISED, run, need=10.0)["outcome"] == outcome


def test_case_depends_on_the_seed_and_its_number_alone() -> None:
    (case, hardware), (again, same) = promise.drawn(3, 7), promise.drawn(3, 7)
    assert (case.name, case.coulomb, hardware.delay) == (again.name, again.coulomb, same.delay)
    assert promise.plants_drawn(3, 7) == promise.plants_drawn(3, 7)
    assert promise.plants_drawn(3, 7) != promise.plants_drawn(3, 8)


def test_sweep_that_was_stopped_goes_on_where_it_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[int]()

    def outcomes(seed: int, number: int) -> list[dict[str, Any]]:
        asked.append(number)
        return [{"seed": seed, "case": PLANTS * number + i} for i in range(PLANTS)]

    monkeypatch.setattr(promise, "outcomes", outcomes)
    log = tmp_path / "log.jsonl"
    promise.swept(log, 0, 2 * PLANTS)
    promise.swept(log, 0, 5 * PLANTS)
    assert asked == [0, 1, 2, 3, 4]
    assert [row["case"] for row in promise_page.read(log)] == list(range(5 * PLANTS))


def test_summary_counts_every_outcome_and_takes_medians_of_what_ran() -> None:
    ran = [PROMISED | {"outcome": "kept", "error": e, "seen": 1.5} for e in (1e-3, 2e-3, 3e-3)]
    rows = [*ran, PROMISED | {"outcome": "refused"}, PROMISED | {"outcome": "diverged"}]
    found = promise_page.summary(json.loads(json.dumps(rows)))
    assert (found["cases"], found["kept"], found["refused"], found["diverged"]) == (5, 3, 1, 1)
    assert found["error_over_promise"] == pytest.approx(1.0)
