"""Late ticks: filter and integral are where the time that has really passed puts them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.linalg import expm

import rbimpedance as rbi
from rbimpedance.control.baselines import ComputedTorqueImpedance
from rbimpedance.control.guards.reference_guard import ReferenceGuard
from rbimpedance.law.impedance import TargetImpedance
from rbimpedance.trajectories import hold

from .. import laws
from ..arms import manipulator

Array = NDArray[np.float64]
DT = 1e-3
ARM = manipulator()
REFERENCE = hold(ARM, ARM.neutral)(0.0)
STILL = np.zeros(ARM.nv)
PUSH = np.linspace(1.0, 2.0, ARM.nv)
M, D, K = 1.0, 10.0, 20.0


def _controller(impedance: TargetImpedance | None = None) -> rbi.ImpedanceController:
    return laws.controller(
        ARM,
        dt=DT,
        impedance=impedance or rbi.Impedance(M, D, K),
        reaching=rbi.SuperTwisting(15.0, 50.0, "explicit"),
    )


def _after(controller: Any, periods: list[float | None]) -> Any:
    """State after a tick at 0 and one at the end of every period, under PUSH."""
    state = controller.init()
    for period in [None, *periods]:
        _, state = controller.step(state, ARM.neutral, STILL, REFERENCE, PUSH, period)
    return state


def test_filter_is_where_the_exact_solution_is_at_the_measured_time() -> None:
    periods = [0.7e-3, 1.9e-3, 1e-3, 13e-3]
    state = _after(_controller(), [*periods])
    system = np.array([[0.0, 1.0, 0.0], [-K / M, -D / M, 1.0 / M], [0.0, 0.0, 0.0]])
    exact = expm(system * sum(periods)) @ np.vstack([STILL, STILL, PUSH])
    assert_allclose(state.q_e_before, exact[0], rtol=1e-12)
    assert_allclose(state.v_e_before, exact[1], rtol=1e-12)


COUPLED = np.array([[2.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 0.3]])
TARGETS: dict[str, TargetImpedance] = {
    "the paper's": rbi.Impedance(M, D, K),
    "coupled": rbi.Impedance(COUPLED, 10.0 * COUPLED[::-1, ::-1], stiffness=[3.0, 200.0, 9.0]),
    "hardly damped": rbi.Impedance(1.0, stiffness=400.0, damping_ratio=1e-3),
    "stiff and light": rbi.Impedance(0.05, 40.0, 8e3),
    "critically damped": rbi.Impedance(2.0, stiffness=50.0, damping_ratio=1.0),
    "nothing but mass": rbi.Impedance(1.0, 1e-9, 1e-9),
    "finite time": rbi.FiniteTimeImpedance(1.0, 5.0, 20.0, 0.6),
}


@pytest.mark.parametrize("period", [1e-5, 0.7e-3, 1.3e-3, 9e-3])
@pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
def test_step_of_another_length_is_that_of_a_filter_made_for_it(
    target: TargetImpedance, period: float, rng: np.random.Generator
) -> None:
    own, made = target.filter(3, DT), target.filter(3, period)
    for q_e, v_e, tau_ext in rng.normal(size=(10, 3, 3)):
        step, exact = own.advance(q_e, v_e, tau_ext, period), made.advance(q_e, v_e, tau_ext)
        assert_allclose(step[0], exact[0], rtol=0.0, atol=1e-14 * np.abs(exact[0]).max())
        assert_allclose(step[1], exact[1], rtol=0.0, atol=1e-13 * np.abs(exact[1]).max())


def test_late_tick_makes_no_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A matrix exponential in a loop waits for the cores that its linear algebra would like to have."""
    controller = _controller()
    monkeypatch.setattr("rbimpedance.law.impedance.ImpedanceFilter.__init__", None)
    monkeypatch.setattr("scipy.linalg.expm", None)
    assert np.abs(_after(controller, [1.2e-3, 0.9e-3]).q_e).min() > 0.0


def test_integral_of_the_sign_is_the_time_that_has_passed() -> None:
    controller = _controller()
    off = rbi.Reference(ARM.integrate(ARM.neutral, np.full(ARM.nv, 0.5)), STILL, STILL)
    state = controller.init()
    for period in (None, 2e-3, 0.5e-3, 4e-3):  # s > 0 all the time: ż = 1 (paper, eq. 8)
        _, state = controller.step(state, ARM.neutral, STILL, off, STILL, period)
    assert_allclose(state.z_before, 6.5e-3, rtol=1e-12)


@pytest.mark.parametrize("impedance", [None, rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.5)])
def test_punctual_tick_is_the_same_with_and_without_its_period(
    impedance: TargetImpedance | None,
) -> None:
    controller = _controller(impedance)
    for given, plain in zip(
        _after(controller, [DT, DT]), _after(controller, [None, None]), strict=True
    ):
        assert_array_equal(given, plain)


def test_one_late_tick_is_one_step_of_the_longer_period_for_a_nonlinear_target() -> None:
    impedance = rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.5)
    state = _after(_controller(impedance), [5e-3])
    expected = impedance.filter(ARM.nv, 5e-3).advance(STILL, STILL, PUSH)
    assert_array_equal(state.q_e_before, expected[0])
    assert_array_equal(state.v_e_before, expected[1])


def test_first_tick_has_nothing_before_it() -> None:
    controller = _controller()
    late, _ = controller.step(controller.init(), ARM.neutral, STILL, REFERENCE, PUSH, 5e-3)
    plain, _ = controller.step(controller.init(), ARM.neutral, STILL, REFERENCE, PUSH)
    assert_array_equal(late.tau, plain.tau)


@pytest.mark.parametrize("period", [0.0, -1e-3, np.nan, np.inf, 0.2, "late"])
def test_period_that_is_no_plausible_time_is_refused(period: Any) -> None:
    controller = _controller()
    with pytest.raises(rbi.InputError, match="period"):
        controller.step(controller.init(), ARM.neutral, STILL, REFERENCE, PUSH, period)


def test_guard_moves_its_reference_for_the_measured_time() -> None:
    fast = rbi.Reference(ARM.neutral, np.full(ARM.nv, 50.0), STILL)
    guard = ReferenceGuard(_controller(), velocity=1.0)
    state = guard.init()
    _, state = guard.step(state, ARM.neutral, STILL, fast, STILL)
    a_g, late = state.a_g, guard.elapsed(state, 3e-3)
    assert np.abs(a_g).min() > 0.0
    assert_allclose(late.q_g, a_g * 3e-3**2 / 2.0, rtol=1e-9)
    assert_allclose(late.v_g, a_g * 3e-3, rtol=1e-9)


def test_guard_says_where_it_holds_the_reference() -> None:
    fast = rbi.Reference(ARM.neutral, np.full(ARM.nv, 50.0), STILL)
    guard = ReferenceGuard(_controller(), velocity=1.0)
    held, state = guard.step(guard.init(), ARM.neutral, STILL, fast, STILL)
    free, _ = guard.step(guard.init(), ARM.neutral, STILL, REFERENCE, STILL)
    assert held.reference_limited.all()
    assert_array_equal(held.reference_limited, state.reference_limited)
    assert not free.reference_limited.any()


def test_baseline_takes_the_measured_period_as_the_law_does() -> None:
    """Its filter after periods of 2 ms and half a ms is the filter's own over these times."""
    controller = ComputedTorqueImpedance(ARM, rbi.Impedance(M, D, K), DT)
    state, push = controller.init(), np.linspace(-3.0, 3.0, ARM.nv)
    for period in (None, 2.0 * DT, 0.5 * DT):
        _, state = controller.step(state, ARM.neutral, STILL, REFERENCE, push, period)
    exact = rbi.Impedance(M, D, K).filter(ARM.nv, 3.5 * DT)
    q_e, v_e = exact.advance(STILL, STILL, push)
    assert_allclose(state.q_e, q_e, rtol=1e-10)
    assert_allclose(state.v_e, v_e, rtol=1e-10)
    with pytest.raises(rbi.InputError, match="period"):
        controller.step(state, ARM.neutral, STILL, REFERENCE, push, -1.0)
