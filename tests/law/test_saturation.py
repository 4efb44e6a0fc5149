"""Torque limits: what the joints that have room keep, and integrators that do not wind up."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import ArrayLike, NDArray

import rbimpedance as rbi
from rbimpedance.law.limits import Limits, as_limits
from rbimpedance.law.super_twisting import ReachingState, Scheme
from rbimpedance.simulation.scenarios import Scenario, paper

from ..laws import with_law

Array = NDArray[np.float64]

K1, K2 = 16.0, 40.0
LIMITS = (36.0, 12.0)
EACH_SCHEME = pytest.mark.parametrize("scheme", ["explicit", "matched", "implicit"])


class WindingUp(rbi.SuperTwisting):
    """The same law, with integrators that know nothing of the limits."""

    def anti_windup(
        self, state: ReachingState, following: ReachingState, missing: Array, dt: float
    ) -> ReachingState:
        del state, missing, dt
        return following


def _scenario(
    limits: ArrayLike | None,
    *,
    scheme: Scheme = "matched",
    duration: float = 3.0,
    known: Any = "inertia",
    law: type[rbi.SuperTwisting] = rbi.SuperTwisting,
) -> Scenario:
    scenario = paper(known=known, surface="fast-terminal", scheme=scheme, duration=duration)
    controller = with_law(scenario.controller, law(K1, K2, scheme=scheme), limits=limits)
    return replace(scenario, controller=controller)


def _overshoot(result: rbi.SimulationResult) -> float:
    """Largest e1 of opposite sign to its initial value, over the joints."""
    return float(np.maximum(0.0, -result.e1 * np.sign(result.e1[0])).max())


def _spd(rng: np.random.Generator, n: int) -> Array:
    root = rng.normal(size=(n, n))
    return np.asarray(root @ root.T + 0.1 * np.eye(n))


# --- allocation -----------------------------------------------------------------------------------


def test_allocated_torque_keeps_the_limits_and_the_free_joints_accelerations(
    rng: np.random.Generator,
) -> None:
    for _ in range(300):
        n = int(rng.integers(1, 8))
        M, tau = _spd(rng, n), rng.normal(0.0, 3.0, n)
        limit = rng.choice([0.5, 1.0, 4.0, np.inf], n)
        found = Limits(limit).allocate(tau, lambda M=M: M)  # type: ignore[misc]
        assert (np.abs(found.tau) <= limit).all()
        change = np.linalg.solve(M, found.tau - tau)  # of the accelerations
        assert_allclose(change[~found.saturated], 0.0, atol=1e-9)
        assert_allclose(-change, found.acceleration_deficit, rtol=1e-9, atol=1e-9)
        assert_array_equal(found.acceleration_deficit[~found.saturated], 0.0)
        assert_array_equal(found.saturated, np.abs(found.tau) == limit)


def test_single_joint_is_clipped(rng: np.random.Generator) -> None:
    for tau in rng.normal(0.0, 3.0, (100, 1)):
        found = Limits(2.0).allocate(tau, lambda: np.array([[0.5]]))
        assert_array_equal(found.tau, np.clip(tau, -2.0, 2.0))
        assert_allclose(found.acceleration_deficit, (tau - found.tau) / 0.5)


def test_mass_matrix_is_not_asked_for_while_nothing_saturates() -> None:
    def unneeded() -> Array:
        raise AssertionError

    tau = np.array([1.0, -2.0])
    found = Limits([1.5, np.inf]).allocate(tau, unneeded)
    assert_array_equal(found.tau, tau)
    assert not found.saturated.any()
    at_limit = Limits([1.0, 3.0]).allocate(tau, unneeded)
    assert_array_equal(at_limit.saturated, [True, False])
    assert_array_equal(at_limit.acceleration_deficit, 0.0)


@pytest.mark.parametrize("effort", [0.0, -1.0, np.nan, [1.0, 0.0], "strong", [[1.0]]])
def test_limit_that_is_not_positive_is_refused(effort: Any) -> None:
    with pytest.raises(rbi.ParameterError, match="effort must be positive"):
        Limits(effort)


def test_limits_for_another_number_of_joints_are_refused() -> None:
    with pytest.raises(rbi.DimensionError, match=r"Limits\.effort"):
        _scenario([36.0, 12.0, 5.0])


def test_array_means_torque_limits() -> None:
    limits = Limits(3.0)
    assert as_limits(limits, 2) is limits
    assert as_limits(None, 2) is None
    converted = as_limits([36.0, 12.0], 2)
    assert converted is not None
    assert_array_equal(converted.effort, LIMITS)
    assert not converted.effort.flags.writeable


# --- the law where nothing saturates --------------------------------------------------------------


@EACH_SCHEME
def test_limits_that_are_never_reached_change_nothing(scheme: Scheme) -> None:
    free = _scenario(None, scheme=scheme, duration=0.5).simulate()
    wide = _scenario(1e4, scheme=scheme, duration=0.5).simulate()
    for name in ("tau", "e1", "s", "saturated"):
        assert_array_equal(getattr(wide, name), getattr(free, name))
    assert not free.saturated.any()


# --- at the limit ---------------------------------------------------------------------------------


def test_limited_arm_hardly_overshoots_and_settles() -> None:
    result = _scenario(LIMITS, duration=10.0).simulate()
    assert _overshoot(result) <= 0.005
    assert np.abs(result.e1[result.t >= 1.0]).max() < 1e-4


@EACH_SCHEME
def test_other_schemes_hardly_overshoot_either(scheme: Scheme) -> None:
    result = _scenario(LIMITS, scheme=scheme).simulate()
    assert _overshoot(result) <= 0.005
    assert np.abs(result.e1[result.t >= 1.0]).max() < 1e-4


@pytest.mark.slow
def test_it_is_the_resting_integrator_that_does_it() -> None:
    assert _overshoot(_scenario(None).simulate()) == pytest.approx(0.011, abs=0.002)
    assert _overshoot(_scenario(LIMITS, law=WindingUp).simulate()) > 0.02


def test_flag_is_on_while_a_joint_is_at_its_limit_and_off_elsewhere() -> None:
    result = _scenario(LIMITS).simulate()
    assert (np.abs(result.tau) <= LIMITS).all()
    assert_array_equal(result.saturated, np.abs(result.tau) == LIMITS)
    assert (result.saturated.any(axis=0) & ~result.saturated.all(axis=0)).all()
    assert not result.saturated[result.t >= 1.0].any()


class Tick(NamedTuple):
    """One tick of a controller on its own arm, and the state before it."""

    q: Array
    v: Array
    output: rbi.ControllerOutput
    tau_ext: Array
    z: Array


def _ticks(scenario: Scenario, q: Array, v: Array, ticks: int) -> list[Tick]:
    """Run by hand from any state, so that the controller's own state can be seen."""
    controller, dynamics, h = scenario.controller, scenario.plant.raw_dynamics, 2.5e-4
    state, log = controller.init(), []
    for k in range(ticks):
        t = k * controller.dt
        tau_ext = scenario.environment.torque(scenario.plant, t, q, v)
        z = state.z
        output, state = controller.step(state, q, v, scenario.trajectory(t), tau_ext)
        log.append(Tick(q, v, output, tau_ext, z))
        for _ in range(4):
            v = v + h * dynamics.forward_dynamics(q, v, output.tau + tau_ext)
            q = dynamics.integrate(q, h * v)
    return log


def test_guaranteed_joint_accelerates_as_the_law_demands() -> None:
    """By ABA: where the model is right, the reaching law acts in full on guaranteed joints."""
    scenario = _scenario(LIMITS, known="full")
    controller, lost = scenario.controller, 0
    assert isinstance(controller, rbi.ImpedanceController)
    for q, v, output, tau_ext, _ in _ticks(scenario, np.zeros(2), np.zeros(2), 600):
        e1, e2, good = output.e1, output.e2, output.premise_holds
        a = controller.arm.forward_dynamics(q, v, output.tau, tau_ext)
        gain = controller.surface.zoh_gain(e1, controller.dt)
        demanded = output.a_r + (controller.surface.feedforward(e1, e2) + output.u) / gain
        assert_allclose(a, demanded, rtol=1e-9, atol=1e-9)  # u is what tau realises
        assert_array_equal(good, ~output.saturated)
        lost += int((~good).sum())
    assert lost > 100


def test_joint_that_cannot_hold_itself_does_not_disturb_the_others() -> None:
    """The elbow gives 4 of the 5.88 N·m that gravity asks of it: it swings, the shoulder tracks."""
    result = _scenario((np.inf, 4.0), duration=6.0).simulate()
    late = result.t >= 3.0
    assert np.abs(result.e1[late, 1]).max() > 1.0
    assert result.saturated[late, 1].any()
    assert np.abs(result.e1[late, 0]).max() < 2e-6


# --- no integrator winds up -----------------------------------------------------------------------


def _random_starts(count: int) -> list[tuple[Array, Array, Array]]:
    """q, v, and limits at least 20 % above the largest static torque of the two-link arm."""
    rng = np.random.default_rng(361_2)
    static = np.array([23.52, 5.88])  # (w4 + w5) g and w5 g: the arm stretched out, level
    return [
        (rng.uniform(-1.5, 1.5, 2), rng.uniform(-1.0, 1.0, 2), 1.2 * static * rng.uniform(1.0, 1.3))
        for _ in range(count)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "slack"), [("matched", 0.0), ("explicit", K2 * 1e-3)])
def test_integrator_stays_within_what_the_limits_let_it_realise(
    scheme: Scheme, slack: float
) -> None:
    """k2·z never passes the largest u of either sign that the torque has realised so far."""
    saturated = 0
    for q, v, limits in _random_starts(4):
        low = high = np.zeros(2)
        for tick in _ticks(_scenario(limits, scheme=scheme), q, v, 700):
            assert (K2 * tick.z <= high + slack + 1e-12).all()
            assert (K2 * tick.z >= low - slack - 1e-12).all()
            low, high = np.minimum(low, tick.output.u), np.maximum(high, tick.output.u)
            saturated += int(tick.output.saturated.sum())
    assert saturated > 500


@pytest.mark.slow
def test_no_integrator_leaves_the_range_that_the_disturbance_needs() -> None:
    """The range: what w takes along the motion, widened by the law's own swing without limits."""

    def excess(
        limits: Array | None, law: type[rbi.SuperTwisting], start: tuple[Array, Array]
    ) -> Any:
        scenario = _scenario(limits, law=law)
        ticks = _ticks(scenario, *start, 1000)
        w = np.array([-scenario.plant.drift(tick.q, tick.v) for tick in ticks])
        low, high = np.minimum(w.min(axis=0), 0.0), np.maximum(w.max(axis=0), 0.0)
        z = K2 * np.array([tick.z for tick in ticks])
        return np.maximum(z.max(axis=0) - high, low - z.min(axis=0)) / (high - low)

    starts = _random_starts(5)
    swing = np.max([excess(None, rbi.SuperTwisting, (q, v)) for q, v, _ in starts])
    limited = [excess(limits, rbi.SuperTwisting, (q, v)) for q, v, limits in starts]
    winding = [excess(limits, WindingUp, (q, v)) for q, v, limits in starts]
    assert np.max(limited) <= swing
    assert np.max(winding) > 2.0 * swing
