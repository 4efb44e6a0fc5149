"""Trajectories: formulas, and velocities and accelerations against finite differences on the manifold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rbimpedance as rbi
from rbimpedance.trajectories import Trajectory, cosine, hold, waypoints

from .. import arms


@pytest.fixture(scope="module")
def spinner() -> rbi.ArmModel:
    return arms.spinner()


@pytest.fixture(scope="module")
def manipulator() -> rbi.ArmModel:
    return arms.manipulator()


def turn(angle: float, slide: float = 0.0, tilt: float = 0.0) -> list[float]:
    return [float(np.cos(angle)), float(np.sin(angle)), slide, tilt]


TURNS = [turn(3.0, 0.1, 0.5), turn(-3.0, -0.2, 0.7), turn(-2.0, 0.0, 1.9)]
TIMES = [0.5, 1.7, 2.5]
MOTIONS: dict[str, Callable[[rbi.ArmModel], Trajectory]] = {
    "hold": lambda arm: hold(arm, turn(0.4, 0.1, -0.2)),
    "cosine": lambda arm: cosine(
        arm, center=turn(3.0), amplitude=[0.9, 0.1, 0.3], period=[2.0, 3.0, 1.5]
    ),
    "waypoints": lambda arm: waypoints(arm, TURNS, TIMES),
}


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_velocity_and_acceleration_are_the_derivatives(
    spinner: rbi.ArmModel, motion: Callable[[rbi.ArmModel], Trajectory]
) -> None:
    trajectory, h = motion(spinner), 1e-5
    for t in np.linspace(0.1, 3.0, 41):
        before, now, after = (trajectory(t + step) for step in (-h, 0.0, h))
        rate = spinner.difference(before.q, after.q) / (2.0 * h)
        assert_allclose(now.v, rate, rtol=0.0, atol=1e-7)
        assert_allclose(now.a, (after.v - before.v) / (2.0 * h), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_answers_are_the_callers_own(
    spinner: rbi.ArmModel, motion: Callable[[rbi.ArmModel], Trajectory]
) -> None:
    trajectory = motion(spinner)
    kept = [x.copy() for x in trajectory(0.9)]
    for x in trajectory(0.9):
        x[...] = np.nan
    for x, y in zip(trajectory(0.9), kept, strict=True):
        assert_array_equal(x, y)


def test_hold_stays_at_ready_by_default(spinner: rbi.ArmModel) -> None:
    q, v, a = hold(spinner)(7.0)
    assert_array_equal(q, spinner.ready)
    assert_array_equal([v, a], np.zeros((2, 3)))


def test_hold_keeps_its_own_configuration(manipulator: rbi.ArmModel) -> None:
    q = np.full(6, 0.5)
    trajectory = hold(manipulator, q)
    q[0] = 9.0
    assert_array_equal(trajectory(0.0).q, np.full(6, 0.5))


def test_cosine_is_its_formula(manipulator: rbi.ArmModel) -> None:
    center, amplitude, period = np.linspace(-0.5, 0.5, 6), np.linspace(0.1, 0.6, 6), 4.0
    trajectory = cosine(manipulator, center=center, amplitude=amplitude, period=period)
    w = 2.0 * np.pi / period
    for t in (0.0, 0.3, 1.0, 2.7, 11.0):
        q, v, a = trajectory(t)
        assert_allclose(q, center + amplitude * np.cos(w * t), rtol=0.0, atol=1e-14)
        assert_allclose(v, -amplitude * w * np.sin(w * t), rtol=0.0, atol=1e-14)
        assert_allclose(a, -amplitude * w**2 * np.cos(w * t), rtol=0.0, atol=1e-14)


def test_cosine_turns_a_continuous_joint_about_its_center(spinner: rbi.ArmModel) -> None:
    trajectory = cosine(spinner, center=turn(3.0), amplitude=[0.5, 0.0, 0.0], period=2.0)
    assert_allclose(trajectory(0.0).q, turn(3.5), rtol=0.0, atol=1e-14)
    assert_allclose(trajectory(1.0).q, turn(2.5), rtol=0.0, atol=1e-14)


def test_scalar_center_is_meant_for_every_joint(manipulator: rbi.ArmModel) -> None:
    trajectory = cosine(manipulator, center=0.5, amplitude=0.2, period=6.0)
    assert_allclose(trajectory(0.0).q, np.full(6, 0.7), rtol=1e-15)
    assert_allclose(trajectory(3.0).q, np.full(6, 0.3), rtol=1e-15)


def test_center_is_ready_by_default(spinner: rbi.ArmModel) -> None:
    assert_allclose(cosine(spinner, amplitude=0.1, period=1.0)(0.25).q, spinner.ready, atol=1e-15)


def test_cosine_keeps_its_own_numbers(manipulator: rbi.ArmModel) -> None:
    center, amplitude, period = np.zeros(6), np.ones(6), np.full(6, 2.0)
    trajectory = cosine(manipulator, center=center, amplitude=amplitude, period=period)
    for x in (center, amplitude, period):
        x[...] = 9.0
    assert_allclose(trajectory(0.0).q, np.ones(6), rtol=0.0, atol=1e-15)


def test_waypoints_are_passed_at_rest(spinner: rbi.ArmModel) -> None:
    trajectory = waypoints(spinner, TURNS, TIMES)
    for q, t in zip(TURNS, TIMES, strict=True):
        now = trajectory(t)
        assert_allclose(now.q, q, rtol=0.0, atol=1e-14)
        assert_allclose([now.v, now.a], np.zeros((2, 3)), rtol=0.0, atol=1e-12)


def test_acceleration_is_continuous_at_waypoints(spinner: rbi.ArmModel) -> None:
    """Within h of a knot the acceleration is at most jerk·h: both sides tend to zero together."""
    trajectory = waypoints(spinner, TURNS, TIMES)
    sides = [[trajectory(t + side).a for t in TIMES] for side in (-1e-6, 1e-6)]
    assert np.abs(sides).max() < 60.0 * 2.0 / 0.8**3 * 1e-6
    assert np.abs(trajectory(1.0).a).max() > 0.5


def test_motion_stands_still_before_and_after_the_waypoints(spinner: rbi.ArmModel) -> None:
    trajectory = waypoints(spinner, TURNS, TIMES)
    for t, q in ((-3.0, TURNS[0]), (0.0, TURNS[0]), (2.6, TURNS[-1]), (99.0, TURNS[-1])):
        now = trajectory(t)
        assert_allclose(now.q, q, rtol=0.0, atol=1e-14)
        assert_array_equal([now.v, now.a], np.zeros((2, 3)))


def test_waypoints_take_the_short_way_round(spinner: rbi.ArmModel) -> None:
    """From 3 to -3 rad it is 0.28 rad through π, not 6 rad through 0."""
    trajectory = waypoints(spinner, [turn(3.0), turn(-3.0)], [0.0, 1.0])
    assert_allclose(trajectory(0.5).q, turn(np.pi), rtol=0.0, atol=1e-14)
    peak = 15.0 / 8.0 * (2.0 * np.pi - 6.0)  # of the minimum-jerk polynomial
    assert_allclose(trajectory(0.5).v, [peak, 0.0, 0.0], rtol=0.0, atol=1e-13)


def test_waypoints_keep_their_own_numbers(manipulator: rbi.ArmModel) -> None:
    knots, times = np.array([np.zeros(6), np.ones(6)]), np.array([0.0, 1.0])
    trajectory = waypoints(manipulator, list(knots), times)  # type: ignore[arg-type]
    knots[...], times[...] = 9.0, [5.0, 6.0]
    assert_allclose(trajectory(0.5).q, np.full(6, 0.5), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"amplitude": [0.1, 0.2]}, rbi.DimensionError, r"^amplitude must be .*\(nv,\) = \(3,\)"),
        ({"amplitude": "wide"}, rbi.DimensionError, r"^amplitude must be .*dtype"),
        ({"amplitude": np.nan}, rbi.NonFiniteError, r"^amplitude must be finite"),
        ({"period": 0.0}, rbi.ParameterError, r"^period must be positive"),
        ({"period": [1.0, 2.0]}, rbi.DimensionError, r"^period must be .*\(nv,\) = \(3,\)"),
        ({"center": 0.5}, rbi.DimensionError, r"^center must be .*nq = 4 \(nv = 3\)"),
        ({"center": [0.0] * 3}, rbi.DimensionError, r"^center must be .*nq = 4 \(nv = 3\)"),
        ({"center": [0.5, 0.0, 0.0, 0.0]}, rbi.DimensionError, r"^center must be .*unit length"),
        ({"center": [1.0, 0.0, np.nan, 0.0]}, rbi.NonFiniteError, r"^center must be finite"),
    ],
)
def test_unusable_cosine_is_refused(
    spinner: rbi.ArmModel, arguments: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        cosine(spinner, **({"amplitude": 0.1, "period": 1.0} | arguments))


@pytest.mark.parametrize(
    ("configurations", "times", "error", "words"),
    [
        ([], [], rbi.DimensionError, r"^times must be one for each of at least two"),
        (TURNS[:1], [0.0], rbi.DimensionError, r"at least two configurations, got 1 for 1"),
        (TURNS, [0.0, 1.0], rbi.DimensionError, r"got 2 for 3"),
        (TURNS, 0.0, rbi.DimensionError, r"^times must be a vector"),
        (TURNS, [0.0, 1.0, 1.0], rbi.ParameterError, r"^times must be strictly increasing"),
        (TURNS, [0.0, np.nan, 1.0], rbi.NonFiniteError, r"^times must be finite; entry 1"),
        ([TURNS[0], [0.0]], [0.0, 1.0], rbi.DimensionError, r"^configurations\[1\] must be"),
    ],
)
def test_unusable_waypoints_are_refused(
    spinner: rbi.ArmModel, configurations: Any, times: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        waypoints(spinner, configurations, times)


def test_unusable_configuration_to_hold_is_refused(spinner: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DimensionError, match=r"^q must be .*nq = 4 \(nv = 3\)"):
        hold(spinner, np.zeros(3))
