"""Torque-rate limits: kept at every tick, shared out through the mass matrix, said in the output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.law.limits import Limits
from rbimpedance.law.super_twisting import Scheme
from rbimpedance.simulation.scenarios import paper

from ..laws import with_law

Array = NDArray[np.float64]

DT = 1e-3
EACH_SCHEME = pytest.mark.parametrize("scheme", ["explicit", "matched", "implicit"])


def _run(limits: Limits | None, *, scheme: Scheme = "matched") -> rbi.SimulationResult:
    scenario = paper(known="inertia", surface="fast-terminal", scheme=scheme, duration=2.5)
    law = rbi.SuperTwisting(16.0, 40.0, scheme=scheme)
    controller = with_law(scenario.controller, law, limits=limits)
    return replace(scenario, controller=controller).simulate()


def _largest_rate(result: rbi.SimulationResult) -> Array:
    rate: Array = np.abs(np.diff(result.tau, axis=0)).max(axis=0) / DT
    return rate


def _push_step(limits: Limits) -> tuple[rbi.ControllerOutput, rbi.ControllerOutput, Array]:
    """Two ticks of a controller; before the second, 30 N·m appear on the first joint. And M there."""
    scenario = paper(known="full", surface="fast-terminal", scheme="matched", duration=1.0)
    controller = with_law(scenario.controller, rbi.SuperTwisting(16.0, 40.0), limits=limits)
    q, still = np.array([0.3, -0.4]), np.zeros(2)
    reference = rbi.Reference(q, still, still)
    first, state = controller.step(controller.init(), q, still, reference, still)
    second, _ = controller.step(state, q, still, reference, np.array([30.0, 0.0]))
    return first, second, controller.arm.mass_matrix(q)


@EACH_SCHEME
def test_torque_never_changes_faster_than_the_limit_and_the_arm_still_settles(
    scheme: Scheme,
) -> None:
    free, limited = _run(None, scheme=scheme), _run(Limits(rate=[1000.0, 300.0]), scheme=scheme)
    assert (_largest_rate(free) > [1000.0, 300.0]).all()
    assert (_largest_rate(limited) <= np.array([1000.0, 300.0]) * (1.0 + 1e-12)).all()
    steps = np.abs(np.diff(limited.tau, axis=0)) / DT
    assert_array_equal(limited.rate_limited[1:], np.isclose(steps, [1000.0, 300.0], rtol=1e-9))
    assert np.abs(limited.e1[limited.t >= 2.0]).max() < 1e-5


def test_rate_that_is_never_reached_changes_nothing() -> None:
    free, wide = _run(None), _run(Limits(rate=1e6))
    for name in ("tau", "e1", "s"):
        assert_array_equal(getattr(wide, name), getattr(free, name))


def test_the_first_torque_is_free_of_the_rate() -> None:
    free, limited = _run(None), _run(Limits(rate=1000.0))
    assert_array_equal(limited.tau[0], free.tau[0])
    assert np.abs(free.tau[0]).max() > 1000.0 * DT


def test_joint_with_room_keeps_its_acceleration_while_the_other_may_not_follow() -> None:
    _, free, _ = _push_step(Limits())
    first, limited, M = _push_step(Limits(rate=[2000.0, np.inf]))
    assert abs(limited.tau[0] - first.tau[0]) == pytest.approx(2.0, rel=1e-12)
    assert_array_equal(limited.rate_limited, [True, False])
    assert not limited.saturated.any()
    assert_array_equal(limited.premise_holds, [False, True])
    change = np.linalg.solve(M, limited.tau - free.tau)
    assert abs(change[0]) > 1.0
    assert_allclose(change[1], 0.0, atol=1e-10)


def test_effort_decides_where_the_rate_would_leave_it() -> None:
    before, asked = np.array([9.0, -9.9]), np.array([50.0, -50.0])
    found = Limits(effort=10.0, rate=500.0).allocate(asked, lambda: np.eye(2), before=before, dt=DT)
    assert_allclose(found.tau, [9.5, -10.0], rtol=1e-15)
    assert_array_equal(found.saturated, [False, True])
    assert_array_equal(found.rate_limited, [True, False])


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, "fast"])
def test_rate_that_is_not_positive_is_refused(rate: object) -> None:
    with pytest.raises(rbi.ParameterError, match="rate"):
        Limits(rate=rate)  # type: ignore[arg-type]
