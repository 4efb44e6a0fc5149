"""Position and velocity limits of the reference, against the ends themselves and the unguarded controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.guards.reference_guard import ReferenceGuard
from rbimpedance.interaction import JointTorque
from rbimpedance.trajectories import cosine, hold

from .. import laws
from ..arms import ARMS, manipulator, spinner

Array = NDArray[np.float64]
DT = 1e-3


def controller(arm: rbi.ArmModel) -> rbi.ImpedanceController:
    return laws.controller(arm, 15.0, 50.0, dt=DT)


def swing(guard: Any, amplitude: float, torque: Any = 0.0) -> rbi.SimulationResult:
    arm = guard.arm
    trajectory = cosine(
        arm, center=arm.neutral, amplitude=amplitude, period=2.0, check_limits=False
    )
    push = JointTorque(np.broadcast_to(torque, (arm.nv,)))
    start = trajectory(1.0 / 2.0)  # at the centre
    return rbi.simulate(
        guard,
        arm,
        lambda t: trajectory(t + 0.5),
        environment=push,
        q0=start.q,
        v0=start.v,
        duration=2.0,
        substeps=1,
    )


def reach(result: rbi.SimulationResult, arm: rbi.ArmModel, name: str) -> Array:
    """Way of q or q_r from neutral, shape (N, nv)."""
    return np.array([arm.difference(arm.neutral, q) for q in getattr(result, name)])


def jerk(result: rbi.SimulationResult) -> float:
    """Largest jerk of the reference of an unguarded run, by second differences of v_r."""
    return float(np.abs(np.diff(result.e2 + result.v, n=2, axis=0)).max()) / DT**2


@pytest.mark.slow
def test_reference_that_stays_inside_is_left_alone() -> None:
    arm = spinner()
    bare, guarded = swing(controller(arm), 0.2), swing(ReferenceGuard(controller(arm)), 0.2)
    for name in ("q", "v", "tau", "q_r"):
        expected = getattr(bare, name)
        scale = np.abs(expected).max()
        assert_allclose(getattr(guarded, name), expected, rtol=0.0, atol=1e-10 * scale)
    assert not guarded.reference_limited.any()


@pytest.mark.slow
@pytest.mark.parametrize("torque", [0.0, 30.0, -30.0])
def test_reference_stays_within_the_ends_whatever_drives_it(torque: float) -> None:
    arm = spinner()  # the slide and the tilt go from -1.5 to 2, the spin has no end
    guard = ReferenceGuard(controller(arm), margin=[0.0, 0.1, 0.3], velocity=20.0)
    result = swing(guard, 2.5, torque)
    q_r = reach(result, arm, "q_r")
    late = jerk(swing(controller(arm), 2.5, torque)) * DT * 0.1**2 / 8.0  # what a period brings
    assert late < 1e-3
    assert q_r[:, 0].max() > 2.4 or q_r[:, 0].min() < -2.4
    for joint, margin in ((1, 0.1), (2, 0.3)):
        assert q_r[:, joint].max() <= 2.0 - margin + late
        assert q_r[:, joint].min() >= -1.5 + margin - late
        assert result.reference_limited[:, joint].any()
        near = np.minimum(2.0 - margin - q_r[:, joint], q_r[:, joint] + 1.5 - margin)
        assert near.min() < 1e-2  # it does get there


@pytest.mark.slow
def test_arm_passes_an_end_by_its_tracking_error_at_most() -> None:
    arm = spinner()
    result = swing(ReferenceGuard(controller(arm), velocity=20.0), 2.5)
    late = jerk(swing(controller(arm), 2.5)) * DT * 0.1**2 / 8.0
    q = reach(result, arm, "q")[:, 1:]
    beyond = np.maximum(q - 2.0, -1.5 - q).max(axis=0)
    assert (beyond <= np.abs(result.e1[:, 1:]).max(axis=0) + late).all()
    assert np.abs(result.e1).max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0.5, 2.0])
def test_speed_of_the_reference_stays_below_the_limit(limit: float) -> None:
    arm = manipulator()
    result = swing(ReferenceGuard(controller(arm), velocity=limit), 0.3, [9, -8, 7, -6, 5, -4])
    bare = swing(controller(arm), 0.3, [9, -8, 7, -6, 5, -4])
    v_r, v_bare = result.e2 + result.v, bare.e2 + bare.v
    held = np.abs(v_bare).max(axis=0) > limit
    started = result.t > 0.3  # a reference that starts too fast is slowed within the horizon
    assert np.abs(v_r[started]).max() <= limit + jerk(bare) * DT * 0.1 / 8.0
    assert held.any() == (limit == 0.5)


@pytest.mark.slow
def test_reference_comes_back_once_nothing_holds_it() -> None:
    arm = manipulator()
    guard = ReferenceGuard(controller(arm), margin=0.0, velocity=0.4, horizon=0.05)
    state, rest = guard.init(), np.zeros(6)
    q = np.array(arm.neutral)
    fast = rbi.trajectories.Reference(q, np.full(6, 0.8), rest)
    for k in range(100):
        moved = fast._replace(q=arm.integrate(q, k * DT * fast.v))
        _, state = guard.step(state, moved.q, moved.v, moved, rest)
    assert state.reference_limited.all()
    assert (np.abs(state.q_g) > 0.01).all()
    still = hold(arm, moved.q, check_limits=False)(0.0)
    for _ in range(1000):
        _, state = guard.step(state, moved.q, rest, still, rest)
    assert not state.reference_limited.any()
    assert_allclose(state.q_g, 0.0, atol=1e-9)


@pytest.mark.slow
def test_repulsion_is_smooth() -> None:
    arm = spinner()
    guard = ReferenceGuard(controller(arm), velocity=20.0, horizon=0.2)
    result = swing(guard, 2.5)
    v_r = (result.e2 + result.v)[:, 1]
    # The deceleration is bounded by that of the spring where it takes hold, not by one period.
    largest = np.abs(v_r).max()
    assert np.abs(np.diff(v_r)).max() / DT < 4.0 / 0.2 * largest


@pytest.mark.parametrize("name", ARMS)
def test_step_is_pure_and_the_baselines_can_be_guarded(name: str, rng: np.random.Generator) -> None:
    arm = ARMS[name]()
    guard = ReferenceGuard(
        rbi.baselines.PDPlus(arm, rbi.Impedance(1.0, 10.0, 20.0), DT), velocity=0.3
    )
    inputs = (arm.neutral, rng.normal(size=arm.nv), hold(arm)(0.0), rng.normal(size=arm.nv))
    _, state = guard.step(guard.init(), *inputs)
    first, after = guard.step(state, *inputs)
    second, again = guard.step(state, *inputs)
    assert_array_equal(first.tau, second.tau)
    assert_array_equal(after.q_g, again.q_g)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda c: ReferenceGuard(c, margin=-0.1), r"^margin must be"),
        (lambda c: ReferenceGuard(c, margin=2.0), r"^margin must be less than half"),
        (lambda c: ReferenceGuard(c, velocity=0.0), r"^velocity must be"),
        (lambda c: ReferenceGuard(c, horizon=2e-3), r"^horizon must be at least 5 control periods"),
    ],
)
def test_unusable_guard_is_refused(
    build: Callable[[rbi.ImpedanceController], object], words: str
) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        build(controller(spinner()))
