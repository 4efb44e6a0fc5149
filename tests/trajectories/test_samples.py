"""Trajectories through samples: exact where the samples are a polynomial, smooth, and gentle on a planner's output."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rbimpedance as rbi
from rbimpedance.control.protocol import Backend
from rbimpedance.simulation.sampling import sample
from rbimpedance.trajectories import (
    SampledTrajectory,
    from_csv,
    from_joint_trajectory,
    samples,
    waypoints,
)

from .. import arms, laws


@pytest.fixture(scope="module")
def spinner() -> rbi.ArmModel:
    return arms.spinner()


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


def planner(n: int, duration: float = 6.0) -> tuple[Any, Any, Any, Any]:
    """A minimum-jerk move of 1 rad and -0.5 rad from rest to rest, sampled: t, q, v, a."""
    t = np.linspace(0.0, duration, n)
    x, way = t / duration, np.array([1.0, -0.5])
    q = np.outer(x**3 * (10 - 15 * x + 6 * x**2), way)
    v = np.outer(30 * x**2 * (1 - x) ** 2 / duration, way)
    a = np.outer(60 * x * (1 - x) * (1 - 2 * x) / duration**2, way)
    return t, q, v, a


PARTS = pytest.mark.parametrize("parts", [2, 3, 4], ids=["q", "q, v", "q, v, a"])


@PARTS
def test_samples_are_passed(arm: rbi.ArmModel, parts: int) -> None:
    given = planner(25)
    trajectory = samples(arm, *given[:parts])
    for i, t in enumerate(given[0]):
        for computed, wanted in zip(trajectory(t), [x[i] for x in given[1:parts]], strict=False):
            assert_allclose(computed, wanted, atol=1e-12)


@PARTS
def test_planners_output_keeps_its_accelerations(arm: rbi.ArmModel, parts: int) -> None:
    """Stopping at every one of the samples takes fifty times the acceleration."""
    given = planner(31)
    fine = np.linspace(0.0, 6.0, 3001)
    true_peak = 10.0 / np.sqrt(3.0) / 6.0**2  # of the minimum-jerk polynomial, for 1 rad
    peak = np.abs(samples(arm, *given[:parts]).sample(fine).a).max()
    assert peak == pytest.approx(true_peak, rel=0.02)
    stop_and_go = waypoints(arm, list(given[1]), list(given[0]))
    assert np.abs(stop_and_go.sample(fine).a).max() > 40.0 * peak


def test_polynomial_of_fifth_degree_is_met_exactly(arm: rbi.ArmModel) -> None:
    coarse, fine = planner(4), planner(61)
    trajectory = samples(arm, *coarse)
    for computed, wanted in zip(trajectory.sample(fine[0]), fine[1:], strict=True):
        assert_allclose(computed, wanted, atol=1e-12)


@PARTS
def test_error_falls_with_the_third_power_of_the_spacing_at_least(
    arm: rbi.ArmModel, parts: int
) -> None:
    fine = planner(901)
    errors = []
    for n in (11, 21):
        q, _, _ = samples(arm, *planner(n)[:parts]).sample(fine[0])
        errors.append(np.abs(q - fine[1]).max())
    assert errors[1] < errors[0] / 8.0 + 1e-14


@PARTS
def test_acceleration_is_continuous_between_first_and_last_sample(
    arm: rbi.ArmModel, parts: int
) -> None:
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.2, 0.5, 12))
    given = [t, *(rng.uniform(-1.0, 1.0, (12, 2)) for _ in range(3))]
    trajectory = samples(arm, *given[:parts])
    h = 1e-9
    for knot in t[1:-1]:
        assert_allclose(trajectory(knot - h).a, trajectory(knot + h).a, atol=1e-4)
    for instant in np.linspace(t[0] + 1e-3, t[-1] - 1e-3, 31):
        before, now, after = (trajectory(instant + step) for step in (-1e-6, 0.0, 1e-6))
        assert_allclose(now.v, (after.q - before.q) / 2e-6, atol=1e-6)
        assert_allclose(now.a, (after.v - before.v) / 2e-6, atol=1e-4)


def test_motion_stands_still_outside_the_samples(arm: rbi.ArmModel) -> None:
    t, q, v, a = planner(5)
    trajectory = samples(arm, t, q, v, a)
    for instant, row in ((-1.0, q[0]), (9.0, q[-1])):
        now = trajectory(instant)
        assert_allclose(now.q, row, atol=1e-14)
        assert_array_equal([now.v, now.a], np.zeros((2, 2)))


def test_continuous_joint_turns_on_through_pi(spinner: rbi.ArmModel) -> None:
    angles = np.linspace(0.0, 9.0, 19)
    q = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(19), np.zeros(19)])
    t = np.arange(19.0)
    v = np.column_stack([np.full(19, 0.5), np.zeros((19, 2))])
    trajectory = samples(spinner, t, q, v)
    for instant in (2.25, 7.5, 17.75):
        now = trajectory(instant)
        assert_allclose(now.q[:2], [np.cos(instant / 2), np.sin(instant / 2)], atol=1e-12)
        assert_allclose(now.v, [0.5, 0.0, 0.0], atol=1e-12)


def test_many_samples_at_once_are_those_one_by_one(arm: rbi.ArmModel) -> None:
    trajectory = samples(arm, *planner(9)[:2])
    assert isinstance(trajectory, SampledTrajectory)
    times = np.linspace(-0.5, 7.0, 16)
    together = sample(arm, trajectory, times)
    for i, t in enumerate(times):
        for rows, single in zip(together, trajectory(float(t)), strict=True):
            assert_allclose(rows[i], single, atol=1e-14)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"t": [0.0, 1.0, 1.0]}, rbi.ParameterError, r"increasing; t\[2\] = 1 follows t\[1\] = 1"),
        ({"t": [0.0, np.nan, 1.0]}, rbi.NonFiniteError, r"^t must be finite; entry 1"),
        ({"t": [0.0]}, rbi.DimensionError, "^t must be at least two times"),
        ({"q": np.zeros((2, 2))}, rbi.DimensionError, r"^q must be .*\(3, 2\), got shape \(2, 2\)"),
        ({"v": np.zeros((3, 3))}, rbi.DimensionError, r"^v must be .*\(3, 2\)"),
        ({"v": np.full((3, 2), np.inf)}, rbi.NonFiniteError, "^v"),
        ({"a": np.zeros((3, 2))}, rbi.ParameterError, "^a must be given together with v"),
        ({"q": [["a"] * 2] * 3}, rbi.DimensionError, "^q must be"),
    ],
)
def test_unusable_samples_are_refused(
    arm: rbi.ArmModel, changes: dict[str, Any], error: type[Exception], words: str
) -> None:
    given: dict[str, Any] = {"t": [0.0, 1.0, 2.0], "q": np.zeros((3, 2))} | changes
    with pytest.raises(error, match=words):
        samples(arm, **given)


# --- messages and files -----------------------------------------------------------------------------------------


def as_dictionary(t: float, *rows: Any) -> dict[str, Any]:
    names = ("positions", "velocities", "accelerations")
    time = {"sec": int(t), "nanosec": round(1e9 * (t % 1.0))}
    return dict(zip(names, rows, strict=False)) | {"time_from_start": time}


def as_message(t: float, *rows: Any) -> SimpleNamespace:
    part = as_dictionary(t, *rows)
    empty: dict[str, Any] = {"velocities": [], "accelerations": []}
    return SimpleNamespace(**(empty | part | {"time_from_start": timedelta(seconds=t)}))


@PARTS
@pytest.mark.parametrize("form", [as_dictionary, as_message])
def test_joint_trajectory_is_read_in_the_arms_order(
    arm: rbi.ArmModel, parts: int, form: Any
) -> None:
    given = planner(6)
    points = [form(t, *(x[i, ::-1] for x in given[1:parts])) for i, t in enumerate(given[0])]
    message = {"joint_names": arm.joint_names[::-1], "points": points}
    read, direct = from_joint_trajectory(arm, message), samples(arm, *given[:parts])
    times = np.linspace(0.0, 6.0, 31)
    for one, other in zip(read.sample(times), direct.sample(times), strict=True):
        assert_allclose(one, other, atol=1e-9)


def test_joint_trajectory_of_another_arm_is_refused(arm: rbi.ArmModel) -> None:
    points = [as_dictionary(t, [0.0, 0.0]) for t in (0.0, 1.0)]
    first, second = arm.joint_names
    for names, words in (
        ([first, "elbow"], "joint_names has 'elbow', which is not a joint of 'two_link'"),
        ([first, first], f"joint_names has joint '{first}' 2 times"),
        ([first], f"joint_names has joint '{second}' 0 times"),
    ):
        with pytest.raises(rbi.InputError, match=words):
            from_joint_trajectory(arm, {"joint_names": names, "points": points})
    points[1]["positions"] = [0.0]
    with pytest.raises(rbi.InputError, match=r"points\[1\].positions has 1 entries for 2"):
        from_joint_trajectory(arm, {"joint_names": arm.joint_names, "points": points})
    with pytest.raises(rbi.InputError, match="without 'joint_names'"):
        from_joint_trajectory(arm, {"points": points})


@PARTS
def test_csv_file_is_read_by_the_names_of_its_columns(
    arm: rbi.ArmModel, tmp_path: Path, parts: int
) -> None:
    given, (first, second) = planner(6), arm.joint_names
    names = ["t"]
    for ending in ("", "_v", "_a")[: parts - 1]:
        names += [second + ending, first + ending]
    table = np.column_stack([given[0], *(x[:, ::-1] for x in given[1:parts])])
    path = tmp_path / "motion.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    read, direct = from_csv(arm, path), samples(arm, *given[:parts])
    assert_array_equal(read(2.2).q, direct(2.2).q)
    assert_array_equal(read(2.2).a, direct(2.2).a)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,{0},{1}\n0,0,0\n1,x,0", "not a number"),
        ("t,{0},{1}\n0,0,0\n1,0", "row 2: 2 entries for 3 columns"),
        ("t,{0}\n0,0\n1,0", "no column '{1}'"),
        ("{0},{1}\n0,0\n1,0", "no column 't'"),
        ("t,{0},{1},elbow\n0,0,0,0\n1,0,0,0", "column 'elbow' that is not a joint"),
        ("t,{0},{1},{0}_v\n0,0,0,0\n1,0,0,0", "no column '{1}_v'"),
        ("t,{0},{0}\n0,0,0\n1,0,0", "a column twice"),
        ("", "no samples"),
    ],
)
def test_unusable_csv_file_is_refused(
    arm: rbi.ArmModel, tmp_path: Path, text: str, words: str
) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text.format(*arm.joint_names), encoding="utf-8")
    with pytest.raises(rbi.InputError, match=words.format(*arm.joint_names)):
        from_csv(arm, path)


def test_missing_csv_file_is_said(arm: rbi.ArmModel, tmp_path: Path) -> None:
    with pytest.raises(rbi.InputError, match="cannot be read"):
        from_csv(arm, tmp_path / "none.csv")


BACKENDS: tuple[Backend, ...] = ("pinocchio", "compiled")


def test_run_follows_samples_on_both_backends(arm: rbi.ArmModel) -> None:
    controller = laws.controller(arm)
    trajectory = samples(arm, *planner(11, duration=0.4)[:2])
    runs = [
        rbi.simulate(
            controller.with_backend(backend), arm, trajectory, q0=np.zeros(2), duration=0.5
        )
        for backend in BACKENDS
    ]
    assert_allclose(runs[0].q, runs[1].q, atol=1e-9)
    assert_allclose(runs[0].q[-1], [1.0, -0.5], atol=0.01)
