"""A start without a jump: what the torque is at the first tick, how fast it changes, and where the reference goes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.baselines import PDGravity
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.guards.reference_guard import ReferenceGuard
from rbimpedance.control.guards.soft_start import SoftStart
from rbimpedance.trajectories import cosine, hold

from .. import laws

Array = NDArray[np.float64]
DT, RATE = 1e-3, 1000.0
PANDA = rbi.load_robot("panda", lock=("panda_finger_joint1", "panda_finger_joint2"), armature=0.1)
Q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.5])


def law(arm: rbi.ArmModel = PANDA, k1: float = 50.0, k2: float = 500.0) -> rbi.ImpedanceController:
    limits = rbi.Limits(effort=arm.effort_limit, rate=RATE)
    return laws.controller(arm, k1, k2, dt=DT, impedance=laws.STIFF, limits=limits)


def run(
    controller: Any, trajectory: Any, q: Array, ticks: int, state: Any = None, start: int = 0
) -> tuple[list[Any], Array, Array, Any]:
    """Outputs, configurations and velocities of a closed loop, and the last state."""
    arm, v = controller.arm, np.zeros(controller.arm.nv)
    state = controller.init() if state is None else state
    outputs, configurations, velocities = [], [], []
    for k in range(start, start + ticks):
        output, state = controller.step(state, q, v, trajectory(k * DT), np.zeros(arm.nv))
        outputs.append(output)
        configurations.append(q)
        velocities.append(v)
        v = v + DT * arm.raw_dynamics.forward_dynamics(q, v, output.tau)
        q = arm.raw_dynamics.integrate(q, DT * v)
    return outputs, np.array(configurations), np.array(velocities), state


def gravity(arm: rbi.ArmModel, q: Array) -> Array:
    return arm.bias(q, np.zeros(arm.nv))


WRAPPED = {
    "law": SoftStart,
    "reference guard": lambda c: SoftStart(ReferenceGuard(c)),
    "energy tank": lambda c: SoftStart(rbi.EnergyTank(c)),
    "encoders": lambda c: SoftStart(rbi.QuantizedEncoders(c)),
    "inside a fault guard": lambda c: FaultGuard(SoftStart(c)),
    "around a fault guard": lambda c: SoftStart(FaultGuard(c)),
}


@pytest.mark.slow
@pytest.mark.parametrize("wrap", WRAPPED.values(), ids=WRAPPED)
def test_torque_begins_at_gravity_and_keeps_the_rate(wrap: Any) -> None:
    """0.01 rad off the reference, which moves and accelerates: 49 N·m at once without a soft start."""
    moving = cosine(PANDA, center=Q, amplitude=0.1, period=2.0)
    outputs, *_ = run(wrap(law()), moving, Q + 0.01, 300)
    tau = np.array([output.tau for output in outputs])
    assert_allclose(tau[0], gravity(PANDA, Q + 0.01), atol=1e-9)
    assert np.abs(np.diff(tau, axis=0)).max() <= RATE * DT * (1.0 + 1e-9)


def test_without_a_soft_start_the_first_torque_is_a_step() -> None:
    """The premise of the others."""
    outputs, *_ = run(law(), hold(PANDA, Q), Q + 0.01, 1)
    assert np.abs(outputs[0].tau - gravity(PANDA, Q + 0.01)).max() > 20.0


def test_torque_that_the_motors_give_is_where_it_begins() -> None:
    controller = SoftStart(law())
    measured = gravity(PANDA, Q) + np.array([3.0, -8.0, 1.0, 5.0, 0.0, 1.0, -0.5])
    outputs, *_ = run(controller, hold(PANDA, Q), Q, 2, controller.init(measured))
    assert_allclose(outputs[0].tau, measured, atol=1e-9)


def test_baseline_without_limits_starts_at_gravity_too() -> None:
    controller = SoftStart(PDGravity(PANDA, rbi.Impedance(1.0, 20.0, 100.0), DT))
    outputs, *_ = run(controller, hold(PANDA, Q), Q + 0.3, 2)
    assert_allclose(outputs[0].tau, gravity(PANDA, Q + 0.3), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.01, 0.5, -1.0])
def test_reference_goes_from_the_arm_to_the_trajectory_within_the_bounds(off: float) -> None:
    """Position, velocity and acceleration are continuous: their differences are those of the next derivative."""
    controller = SoftStart(law(), 0.5, acceleration=4.0)
    outputs, q, _, state = run(controller, hold(PANDA, Q), Q + off, 3000)
    q_r = np.array([output.q_r for output in outputs])
    v_r, a_r = (np.gradient(q_r, DT, axis=0), np.array([output.a_r for output in outputs]))
    assert_allclose(q_r[0], Q + off, atol=1e-12)
    assert_allclose(outputs[0].v_r, 0.0, atol=1e-12)
    assert np.abs(v_r).max() <= 1.001 * controller.velocity.max()
    assert np.abs(a_r).max() <= 1.001 * 4.0
    assert np.abs(np.diff(a_r, axis=0)).max() < 60.0 * DT * max(abs(off), 0.05) / 0.5**3
    assert state.clock >= state.length >= 0.5
    assert np.abs(q[-1] - Q).max() < 1e-3


def test_once_the_start_is_over_the_torque_is_the_controllers_to_the_bit() -> None:
    controller = law()
    soft, moving = SoftStart(controller, 0.05), cosine(PANDA, center=Q, amplitude=0.1, period=2.0)
    _, q, v, state = run(soft, moving, moving(0.0).q, 80)
    inner = state.inner
    for k in range(80, 90):
        zero = np.zeros(7)
        output, state = soft.step(state, q[-1], v[-1], moving(k * DT), zero)
        alone, inner = controller.step(inner, q[-1], v[-1], moving(k * DT), zero)
        assert_array_equal(output.tau, alone.tau)


PAUSES: dict[str, tuple[float | None, float, float]] = {
    "told by the period": (30.0, 0.0, 0.0),
    "told by q": (None, 0.2, 0.2),
    "told by the period and q": (30.0, 0.2, -0.2),
}


@pytest.mark.parametrize(("period", "moved", "reference"), PAUSES.values(), ids=PAUSES)
def test_after_a_long_pause_it_starts_anew(
    period: float | None, moved: float, reference: float
) -> None:
    controller = SoftStart(law(), 0.1)
    _, q, _, state = run(controller, hold(PANDA, Q), Q + 0.01, 300)
    there, desired = q[-1] + moved, hold(PANDA, Q + reference)(0.0)
    output, state = controller.step(state, there, np.zeros(7), desired, np.zeros(7), period)
    assert_allclose(output.tau, gravity(PANDA, there), atol=1e-9)
    assert_allclose(output.q_r, there, atol=1e-12)
    assert state.clock < state.length


@pytest.mark.slow
@pytest.mark.parametrize("wrap", WRAPPED.values(), ids=WRAPPED)
def test_reference_that_has_jumped_is_blended_to_and_the_torque_does_not_jump(wrap: Any) -> None:
    controller = wrap(law())
    outputs, q, _, state = run(controller, hold(PANDA, Q), Q, 300)
    after, *_ = run(controller, hold(PANDA, Q + 0.3), q[-1], 300, state, 300)
    tau = np.array([output.tau for output in outputs[-1:] + after])
    assert np.abs(np.diff(tau, axis=0)).max() <= RATE * DT * (1.0 + 1e-9)
    assert np.abs(after[0].q_r - q[-1]).max() < 1e-3


def test_fast_motion_and_late_ticks_are_no_pause() -> None:
    """A reference at the speed limit, every fifth tick late by 9 periods."""
    speed = 0.9 * PANDA.velocity_limit
    controller = SoftStart(law(), 0.01)
    state, time, started = controller.init(), 0.0, 0
    for k in range(200):
        period = 10.0 * DT if k % 5 == 4 else DT
        time += period
        desired = rbi.Reference(Q + speed * time, speed, np.zeros(7))
        _, state = controller.step(state, desired.q, speed, desired, np.zeros(7), period)
        started += state.clock == DT
    assert started == 1


@pytest.mark.parametrize("given", [{"duration": 0.0}, {"velocity": -1.0}, {"acceleration": 0.0}])
def test_settings_that_cannot_be_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(rbi.ParameterError, match=next(iter(given))):
        SoftStart(law(), **given)


def test_message_for_a_long_pause_says_who_takes_the_arm_over() -> None:
    controller = law()
    _, state = controller.step(controller.init(), Q, np.zeros(7), hold(PANDA, Q)(0.0), np.zeros(7))
    with pytest.raises(rbi.InputError, match="SoftStart"):
        controller.step(state, Q, np.zeros(7), hold(PANDA, Q)(0.0), np.zeros(7), 1.0)
