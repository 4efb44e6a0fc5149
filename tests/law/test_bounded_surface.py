"""Bounded errors: constant approach speed from far away, the surface itself near by."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.law.surfaces import Surface
from rbimpedance.trajectories import hold

from .. import laws
from ..arms import manipulator

FAST = rbi.FastTerminalSurface(2.0, 3.0, 0.6)
EACH_SURFACE = pytest.mark.parametrize(
    "surface",
    [FAST, rbi.PowerSurface(10.0, 1.6), rbi.NonsingularTerminalSurface(2.0, 1.6)],
    ids=lambda surface: type(surface).__name__,
)
E = 0.3


@EACH_SURFACE
def test_within_the_bound_nothing_changes(surface: Surface) -> None:
    bounded = rbi.BoundedSurface(surface, E)
    rng = np.random.default_rng(1)
    e1, e2 = rng.uniform(-E, E, 50), rng.normal(size=50)
    assert_array_equal(bounded.value(e1, e2), surface.value(e1, e2))
    assert_array_equal(bounded.feedforward(e1, e2), surface.feedforward(e1, e2))
    assert_array_equal(bounded.zoh_gain(e1, 1e-3), surface.zoh_gain(e1, 1e-3))
    assert_array_equal(bounded.speed(e1), surface.speed(e1))
    assert_array_equal(bounded.time_to(1e-2, e1), surface.time_to(1e-2, e1))
    assert not bounded.clipped(e1).any()


@EACH_SURFACE
def test_speed_is_that_of_the_sliding_motion(surface: Surface) -> None:
    e1 = np.array([0.05, 0.2, 1.0])
    assert_allclose(surface.value(e1, -surface.speed(e1)), 0.0, atol=1e-12)


@EACH_SURFACE
def test_time_is_that_of_the_sliding_motion_integrated_numerically(surface: Surface) -> None:
    bounded = rbi.BoundedSurface(surface, E)

    def down_to_tolerance(_: float, e1: np.ndarray) -> float:
        return float(e1[0]) - 1e-2

    down_to_tolerance.terminal = True  # type: ignore[attr-defined]
    motion = solve_ivp(
        lambda _, e1: -bounded.speed(e1),
        (0.0, 20.0),
        [2.0],
        events=down_to_tolerance,
        rtol=1e-9,
        max_step=1e-2,
    )
    end = float(motion.t[-1])  # of the terminal event
    assert end < 20.0
    assert_allclose(float(bounded.time_to(1e-2, 2.0)), end, rtol=1e-5)


def test_sliding_time_adds_the_way_to_the_bound() -> None:
    bounded = rbi.BoundedSurface(FAST, E)
    expected = (2.0 - E) / FAST.speed(E) + FAST.sliding_time(E)
    assert_allclose(bounded.sliding_time(2.0), expected, rtol=1e-12)
    assert bounded.sliding_time(2.0) > FAST.sliding_time(2.0)


def test_arm_far_away_comes_at_the_bounded_speed_and_settles() -> None:
    arm = manipulator()
    speeds, flags = {}, {}
    for name, surface in (("free", FAST), ("bounded", rbi.BoundedSurface(FAST, E))):
        controller = laws.controller(arm, 15.0, 50.0, surface=surface)
        start = arm.integrate(arm.neutral, np.full(arm.nv, 1.2))
        trajectory = hold(arm, arm.neutral)
        result = rbi.simulate(
            controller, arm.copy(), trajectory, q0=start, duration=2.5, substeps=1
        )
        speeds[name] = float(np.abs(result.v).max())
        assert np.abs(result.e1[-1]).max() < 1e-5
        assert_array_equal(result.clipped, (np.abs(result.e1) > E) & (name == "bounded"))
        still, state = np.zeros(arm.nv), controller.init()
        flags[name], _ = controller.step(state, start, still, trajectory(0.0), still)
    assert speeds["free"] > 1.5 * float(FAST.speed(E))
    assert speeds["bounded"] < 1.05 * float(FAST.speed(E))
    assert flags["bounded"].clipped.all()
    assert not flags["free"].clipped.any()


@pytest.mark.parametrize("error", [0.0, -1.0, np.inf, np.nan])
def test_bound_that_is_not_positive_is_refused(error: float) -> None:
    with pytest.raises(rbi.ParameterError, match="error"):
        rbi.BoundedSurface(FAST, error)


def test_surface_that_is_bounded_already_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match="bounded already"):
        rbi.BoundedSurface(rbi.BoundedSurface(FAST, 1.0), 0.5)


def test_bound_for_another_number_of_joints_is_refused() -> None:
    arm = manipulator()
    surface = rbi.BoundedSurface(FAST, np.ones(arm.nv + 1))
    with pytest.raises(rbi.DimensionError, match=r"BoundedSurface\.max_error"):
        rbi.ImpedanceController(
            arm, rbi.Impedance(1.0, 10.0, 20.0), surface, rbi.SuperTwisting(15.0, 50.0), 1e-3
        )
