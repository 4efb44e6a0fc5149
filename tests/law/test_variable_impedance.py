"""Changing impedances: the storage function along trajectories, a pumped spring, and the torque at the change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.law.impedance_changes import blend, check_variation
from rbimpedance.trajectories import Reference

from .. import laws
from ..arms import manipulator

Array = NDArray[np.float64]
T = np.linspace(0.0, 4.0, 801)
DT = float(T[1])


def spring(K: Callable[[float], float], M: float = 1.0, D: float = 2.0) -> list[rbi.Impedance]:
    return [rbi.Impedance(M, D, K(float(t))) for t in T]


def test_blend_is_the_straight_line_between_the_matrices() -> None:
    first = rbi.Impedance([1.0, 2.0], 10.0, [[30.0, 5.0], [5.0, 20.0]])
    second = rbi.Impedance(3.0, damping_ratio=0.7, stiffness=80.0)
    for share in (0.0, 0.25, 1.0):
        for a, b, c in zip(
            first.matrices(2),
            second.matrices(2),
            blend(first, second, share, 2).matrices(2),
            strict=True,
        ):
            assert_allclose(c, (1.0 - share) * a + share * b, rtol=1e-12)
    with pytest.raises(rbi.ParameterError, match=r"^share must be"):
        blend(first, second, 1.1, 2)


def test_constant_and_softening_springs_are_passive() -> None:
    for stiffness in (lambda _: 50.0, lambda t: 50.0 - 10.0 * t):
        report = check_variation(spring(stiffness), DT, 2)
        assert report.stable
        assert report.passive


def test_slow_stiffening_is_stable_but_not_passive() -> None:
    report = check_variation(spring(lambda t: 20.0 + 10.0 * t), DT, 2)
    assert report.stable
    assert not report.passive
    assert 0.0 < report.alpha <= 2.0  # D/M
    assert (report.margin >= 0.0).all()


def test_largest_rate_of_stiffening_is_that_of_the_closed_form() -> None:
    # M = 1, D = 2: α ≤ D/M = 2, and K̇ ≤ 2αK allows exp(4t) and no more.
    assert check_variation(spring(lambda t: 10.0 * np.exp(3.9 * t)), DT, 1).stable
    assert not check_variation(spring(lambda t: 10.0 * np.exp(4.1 * t)), DT, 1).stable


def test_spring_that_is_pumped_grows_and_is_not_called_stable() -> None:
    # Parametric resonance: the stiffness at twice the natural frequency, against little damping.
    damping, omega = 0.2, 5.0

    def stiffness(t: float) -> float:
        return float(omega**2 * (1.0 + 0.5 * np.sin(2.0 * omega * t)))

    run = solve_ivp(
        lambda t, x: [x[1], -damping * x[1] - stiffness(t) * x[0]], (0.0, 20.0), [1.0, 0.0]
    )
    assert np.abs(run.y[0, -50:]).max() > 10.0
    assert not check_variation(spring(stiffness, D=damping), DT, 1).stable


def changing(t: float) -> tuple[float, float, float]:
    """M_d, D_d and K_d that all swing."""
    return 1.0 + 0.2 * np.sin(t), 6.0 + np.cos(0.7 * t), 30.0 + 15.0 * np.sin(0.9 * t)


def test_storage_never_grows_faster_than_the_power_that_goes_in() -> None:
    impedances = [rbi.Impedance(*changing(t)) for t in T]
    report = check_variation(impedances, DT, 1)
    assert report.stable
    alpha = report.alpha

    def rates(t: float, x: Array) -> list[float]:
        q, v, _ = x
        M, D, K = changing(t)
        torque = 3.0 * np.sin(4.0 * t)
        return [v, (torque - D * v - K * q) / M, (v + alpha * q) * torque]

    run = solve_ivp(rates, (0.0, 4.0), [0.3, -1.0, 0.0], t_eval=T, rtol=1e-10, atol=1e-12)
    q, v, supplied = run.y
    M, D, K = np.array([changing(t) for t in T]).T
    beta = K + alpha * (D - alpha * M - 0.2 * np.cos(T))
    stored = 0.5 * M * (v + alpha * q) ** 2 + 0.5 * beta * q**2
    assert (beta > 0.0).all()
    assert (np.diff(stored) <= np.diff(supplied) + 1e-9).all()


def test_unusable_sequence_is_refused() -> None:
    one = rbi.Impedance(1.0, 1.0, 1.0)
    with pytest.raises(rbi.DimensionError, match="at least three"):
        check_variation([one, one], DT, 1)
    with pytest.raises(rbi.ParameterError, match=r"^dt must be"):
        check_variation([one] * 3, 0.0, 1)
    with pytest.raises(rbi.DimensionError, match="stiffness"):
        check_variation([rbi.Impedance(1.0, 1.0, [1.0, 2.0])] * 3, DT, 3)


@pytest.fixture
def controller() -> rbi.ImpedanceController:
    return laws.controller(manipulator(), 15.0, 50.0, limits=500.0)


def pressed(controller: rbi.ImpedanceController) -> tuple[rbi.ControllerState, tuple[Array, ...]]:
    """A state in which the impedance filter is stretched and moves, and the inputs of the next tick."""
    rest, torque = np.zeros(6), np.linspace(-4.0, 6.0, 6)
    q, state = np.array(controller.arm.neutral), controller.init()
    for _ in range(200):
        _, state = controller.step(state, q, rest, Reference(q, rest, rest), torque)
        q = controller.arm.integrate(controller.arm.neutral, state.q_e)
    v = state.v_e.copy()
    return state, (q, v, torque)


def test_change_of_impedance_jumps_the_torque_by_the_targets_own_jump(
    controller: rbi.ImpedanceController,
) -> None:
    arm, rest = controller.arm, np.zeros(6)
    state, (q, v, torque) = pressed(controller)
    hold = Reference(np.array(arm.neutral), rest, rest)
    before, _ = controller.step(state, q, v, hold, torque)
    after, _ = controller.with_impedance(rbi.Impedance(2.0, 15.0, 90.0)).step(
        state, q, v, hold, torque
    )
    for name in ("q_r", "v_r", "e1", "e2", "s"):
        assert_array_equal(getattr(before, name), getattr(after, name))
    old = torque - 10.0 * state.v_e - 20.0 * state.q_e
    new = (torque - 15.0 * state.v_e - 90.0 * state.q_e) / 2.0
    jump = arm.mass_matrix(q) @ (new - old)
    assert np.abs(jump).max() > 1.0
    assert_allclose(after.tau - before.tau, jump, rtol=1e-8, atol=1e-9)


def test_ramp_jumps_less_in_proportion_to_its_ticks(controller: rbi.ImpedanceController) -> None:
    rest, target = np.zeros(6), rbi.Impedance(2.0, 15.0, 90.0)
    state, (q, v, torque) = pressed(controller)
    hold = Reference(np.array(controller.arm.neutral), rest, rest)
    before, _ = controller.step(state, q, v, hold, torque)
    jumps = []
    for share in (1e-2, 1e-3):
        changed = controller.with_impedance(blend(rbi.Impedance(1.0, 10.0, 20.0), target, share, 6))
        after, _ = changed.step(state, q, v, hold, torque)
        jumps.append(np.abs(after.tau - before.tau).max())
    assert jumps[0] / jumps[1] == pytest.approx(10.0, rel=0.02)
    assert jumps[1] < 0.2


def test_controller_with_another_impedance_is_otherwise_the_same(
    controller: rbi.ImpedanceController,
) -> None:
    other = controller.with_impedance(rbi.Impedance(2.0, 15.0, 90.0))
    for name in ("arm", "surface", "reaching", "dt", "model", "limits"):
        assert getattr(other, name) is getattr(controller, name)
    assert float(controller.impedance.stiffness) == 20.0  # type: ignore[attr-defined]
