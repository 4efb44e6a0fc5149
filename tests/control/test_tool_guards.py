"""Guards around a controller at the tool hold what they hold in joint space: starts, faults, brakes, pushes."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.snapshot import dump, restore
from rbimpedance.control.telemetry import Situation

from .test_cartesian import AXES, motion, panda

Array = NDArray[np.float64]
DT, RATE = 1e-3, 1000.0
Q = np.array([0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8])
NAN = np.full(7, np.nan)


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return panda()


@pytest.fixture(scope="module")
def controller(arm: rbi.ArmModel) -> rbi.CartesianController:
    return rbi.CartesianController(arm, limits=rbi.Limits(arm.effort_limit, RATE), dt=DT)


def away(reference: rbi.CartesianReference, *way: float) -> rbi.CartesianReference:
    R, p = reference.pose
    return reference._replace(pose=rbi.Pose(R, p + np.array(way)))


def holding(arm: rbi.ArmModel) -> rbi.CartesianReference:
    pose = rbi.Pose(*arm.frame_placement(Q))
    return rbi.CartesianReference(pose, np.zeros(6), np.zeros(6))


class Run(NamedTuple):
    outputs: list[Any]
    q: Array
    v: Array
    state: Any

    @property
    def tau(self) -> Array:
        return np.array([output.tau for output in self.outputs])

    @property
    def responses(self) -> list[str]:
        return [output.response for output in self.outputs]


def run(
    guard: Any,
    trajectory: Callable[[float], Any],
    ticks: int,
    corrupt: Callable[[int, dict[str, Any]], None] | None = None,
    *,
    payload: float = 1.0,
    push: Any = 0.0,
    braked: range = range(0),
) -> Run:
    """A closed loop with a payload that nobody modelled, corrupted inputs, and brakes that hold the arm for a while."""
    plant = guard.arm.with_payload(payload)
    state, q, v = guard.init(), Q, np.zeros(7)
    outputs, configurations, velocities = [], [q], [v]
    for k in range(ticks):
        inputs = {"q": q, "v": v, "reference": trajectory(k * DT), "tau_ext": np.zeros(7)}
        if corrupt is not None:
            corrupt(k, inputs)
        output, state = guard.step(state, **inputs)
        v = v + DT * plant.forward_dynamics(q, v, output.tau + push)
        v = np.zeros(7) if k in braked else v
        q = plant.integrate(q, DT * v)
        outputs.append(output)
        configurations.append(q)
        velocities.append(v)
    return Run(outputs, np.array(configurations), np.array(velocities), state)


def between(start: int, stop: int, **given: Any) -> Callable[[int, dict[str, Any]], None]:
    def corrupt(k: int, inputs: dict[str, Any]) -> None:
        if start <= k < stop:
            inputs.update(given)

    return corrupt


def assert_within_limits(arm: rbi.ArmModel, tau: Array) -> None:
    assert np.isfinite(tau).all()
    assert (np.abs(tau) <= arm.effort_limit).all()
    assert np.abs(np.diff(tau, axis=0)).max() <= RATE * DT * (1.0 + 1e-12)


# --- taking over ----------------------------------------------------------------------------------


@pytest.mark.parametrize("axes", AXES)
def test_controller_takes_a_moving_arm_over_without_an_error(
    axes: str, controller: rbi.CartesianController
) -> None:
    arm, rng = controller.arm, np.random.default_rng(1)
    law = controller.with_impedance(rbi.CartesianImpedance((3.0, 0.15), (600, 20), axes=AXES[axes]))
    desired = away(motion(arm, Q, 0.4), 0.05, -0.03, 0.02)
    now = Situation(
        Q, rng.normal(0.0, 0.3, 7), np.zeros(7), desired, rng.normal(size=7), np.zeros(7)
    )
    for start in (law.init(), law.step(law.init(), Q, now.v, desired, np.zeros(6))[1]):
        output, _ = law.step(law.handover(start, now), now.q, now.v, desired, np.zeros(6))
        assert_allclose(output.e1, 0.0, atol=1e-14)
        assert_allclose(output.e2, 0.0, atol=1e-14)


def test_baseline_takes_a_moving_arm_over_without_an_error(arm: rbi.ArmModel) -> None:
    law = rbi.baselines.CartesianPID(arm, rbi.CartesianImpedance((3.0, 0.15), (600, 20)), 40.0)
    desired = away(motion(arm, Q, 0.4), 0.05, -0.03, 0.02)
    now = Situation(Q, np.full(7, 0.2), np.zeros(7), desired, np.zeros(7), np.zeros(7))
    output, _ = law.step(law.handover(law.init(), now), now.q, now.v, desired, np.zeros(6))
    assert_allclose([output.e1, output.e2], 0.0, atol=1e-14)


def test_target_with_other_gains_moves_on_from_where_it_is(
    controller: rbi.CartesianController,
) -> None:
    there, push = holding(controller.arm), np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    state, still = controller.init(), np.zeros(7)
    for _ in range(50):
        before, state = controller.step(state, Q, still, there, push)
    stiffer = controller.with_impedance(rbi.CartesianImpedance((3.0, 0.15), (900, 20)))
    usual, _ = controller.step(state, Q, still, there, push)
    changed, _ = stiffer.step(state, Q, still, there, push)
    assert abs(before.e1[2]) > 1e-3
    assert_array_equal(usual.e1, changed.e1)
    assert_array_equal(usual.e2, changed.e2)


def test_start_far_off_begins_at_gravity_keeps_the_rate_and_arrives(
    controller: rbi.CartesianController,
) -> None:
    """5 cm and 0.1 m beside it: the way is straight, no faster than asked for, and ends on the reference."""
    arm = controller.arm
    there = away(holding(arm), 0.05, 0.1, 0.0)
    soft: Any = rbi.SoftStart(controller, 0.4, velocity=0.3)
    ticks = run(soft, lambda _: there, 1400, payload=0.0)
    assert_allclose(ticks.tau[0], arm.bias(Q, np.zeros(7)), atol=1e-9)
    assert_within_limits(arm, ticks.tau)
    assert not any(output.saturated.any() for output in ticks.outputs)
    at_tool = [output.at_tool for output in ticks.outputs]
    speeds = [np.abs(x.reference.v).max() for x in at_tool]
    assert 0.2 < max(speeds) <= 0.3 * (1.0 + 1e-9)
    position = (
        np.array([x.reference.pose.translation for x in at_tool]) - at_tool[0].pose.translation
    )
    assert_allclose(position[:, 1], 2.0 * position[:, 0], atol=1e-6)
    assert (
        np.abs(
            np.concatenate([at_tool[-1].e1, at_tool[-1].pose.translation - there.pose.translation])
        ).max()
        < 1e-5
    )


def test_without_a_soft_start_the_first_torque_is_a_step(
    controller: rbi.CartesianController,
) -> None:
    there = away(holding(controller.arm), 0.05, 0.1, 0.0)
    guard: Any = rbi.FaultGuard(controller)
    output, _ = guard.step(guard.init(), Q, np.zeros(7), there, np.zeros(7))
    assert np.abs(output.tau - controller.arm.bias(Q, np.zeros(7))).max() > 10.0


def test_once_the_start_is_over_the_torque_is_the_controllers_to_the_bit(
    controller: rbi.CartesianController,
) -> None:
    soft: Any = rbi.SoftStart(controller, 0.02)
    there = holding(controller.arm)
    ticks = run(soft, lambda _: there, 60)
    state, q, v = ticks.state, ticks.q[-1], ticks.v[-1]
    output, _ = soft.step(state, q, v, there, np.zeros(7))
    own, _ = controller.step(state.inner, q, v, there, np.zeros(6), np.zeros(7))
    assert_array_equal(output.tau, own.tau)


def test_reference_that_has_jumped_is_blended_to(controller: rbi.CartesianController) -> None:
    """By 0.2 m in a tick, which no joint can: the torque goes on where it was."""
    there = holding(controller.arm)
    soft: Any = rbi.SoftStart(controller, 0.05)
    ticks = run(soft, lambda t: away(there, 0.0, 0.2, 0.0) if t >= 0.15 else there, 250)
    assert_within_limits(controller.arm, ticks.tau)
    assert np.abs(ticks.outputs[150].at_tool.e1).max() < 1e-3


# --- faults ---------------------------------------------------------------------------------------

FAULTS: dict[str, tuple[dict[str, Any], str, str]] = {
    "q is lost": ({"q": NAN}, "not finite", "q"),
    "v is lost": ({"v": NAN}, "not finite", "v"),
    "tau_ext is lost": ({"tau_ext": NAN}, "not finite", "tau_ext"),
    "short": ({"q": np.zeros(3)}, "malformed", "q"),
    "no reference": ({"reference": None}, "malformed", "reference"),
    "reference of joints": ({"reference": rbi.Reference(Q, NAN, NAN)}, "malformed", "reference"),
    "spike": ({"q": Q + 0.5}, "jump", "q"),
    "speed": ({"v": np.full(7, 300.0)}, "inconsistent", "v"),
    "torque": ({"tau_ext": np.full(7, 1e5)}, "out of range", "tau_ext"),
}


@pytest.mark.parametrize(("given", "kind", "name"), FAULTS.values(), ids=FAULTS)
def test_fault_is_named_met_and_overcome(
    given: dict[str, Any], kind: str, name: str, controller: rbi.CartesianController
) -> None:
    guard = rbi.FaultGuard(controller, "stop", patience=4)
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 80, between(50, 58, **given))
    assert_within_limits(guard.arm, ticks.tau)
    assert ticks.responses == ["run"] * 50 + ["stop"] * 11 + ["run"] * 19
    met = ticks.outputs[50:61]
    assert {(output.fault.kind, output.fault.name) for output in met} == {(kind, name)}
    assert not any(output.at_tool.premise_holds.any() for output in met)


def test_policy_that_raises_names_the_fault(controller: rbi.CartesianController) -> None:
    guard = rbi.FaultGuard(controller, "raise")
    with pytest.raises(rbi.FaultError, match="q must be finite"):
        run(guard, lambda t: motion(guard.arm, Q, t), 12, between(10, 11, q=NAN))


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["hold", "stop"])
def test_arm_whose_sensors_are_gone_comes_to_rest_on_its_model(
    policy: Any, controller: rbi.CartesianController
) -> None:
    guard = rbi.FaultGuard(controller, policy)
    corrupt = between(500, 10**9, q=NAN, v=NAN)
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 750, corrupt, payload=0.0)
    assert np.abs(ticks.v[500]).max() > 0.1
    assert np.abs(ticks.v[-1]).max() < 0.01
    assert_within_limits(guard.arm, ticks.tau)


@pytest.mark.slow
def test_blind_guard_asks_for_brakes_and_lets_its_torque_decay(
    controller: rbi.CartesianController,
) -> None:
    guard = rbi.FaultGuard(controller, "stop")
    corrupt = between(100, 10**9, q=NAN, v=NAN)
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 1500, corrupt, braked=range(400, 1500))
    asked = [k for k, output in enumerate(ticks.outputs) if output.brakes_requested]
    assert abs(asked[0] - 350) <= 2
    assert np.abs(ticks.tau[-1]).max() < 0.02 * np.abs(ticks.tau[350]).max()


@pytest.mark.slow
@pytest.mark.parametrize("told", [0.0, 8.0, -8.0])
def test_stopped_arm_rests_under_a_push_whatever_is_told_of_it(
    told: float, controller: rbi.CartesianController
) -> None:
    """20 N at the tool. Told right, wrong or not at all, the arm comes to rest, because the observer finds it."""
    arm, there = controller.arm, holding(controller.arm)
    guard = rbi.FaultGuard(controller, "stop")
    push = arm.jacobian(Q).T @ np.array([0.0, 12.0, 16.0, 0.0, 0.0, 0.0])

    def corrupt(k: int, inputs: dict[str, Any]) -> None:
        inputs.update(tau_ext=np.full(7, told))
        if k >= 100:
            inputs.update(reference=None)

    ticks = run(guard, lambda _: there, 1200, corrupt, push=push)
    assert ticks.responses[-1] == "stop"
    assert np.abs(ticks.v[-1]).max() < 1e-3
    assert np.abs(ticks.q[-1] - ticks.q[-200]).max() < 1e-3


@pytest.mark.slow
def test_brakes_are_found_and_their_release_is_slow_although_the_reference_has_moved_on(
    controller: rbi.CartesianController,
) -> None:
    """Brakes hold the arm for 0.4 s while the tool should follow a circle."""
    guard = rbi.FaultGuard(controller, "stop")
    braked = range(600, 1000)
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 1800, braked=braked)
    found = next(k for k in braked if ticks.responses[k] == "stop")
    assert ticks.outputs[found].fault.kind == "no effect"
    assert any(ticks.outputs[k].brakes_requested for k in braked)
    assert_within_limits(guard.arm, ticks.tau)
    limit = guard.arm.velocity_limit
    assert (np.abs(ticks.v[1000:]) < 0.5 * limit).all()
    assert ticks.responses[-1] == "run"


@pytest.mark.slow
def test_controller_comes_back_without_a_jump_and_returns_to_the_motion(
    controller: rbi.CartesianController,
) -> None:
    """Off for 0.3 s, the tool returns to its circle as its impedance lets it."""
    arm, guard = controller.arm, rbi.FaultGuard(controller, "stop")
    ticks = run(guard, lambda t: motion(arm, Q, t), 2600, between(500, 800, q=NAN))
    back = next(k for k in range(501, 2600) if ticks.responses[k] == "run")
    assert_within_limits(arm, ticks.tau)
    assert np.abs(ticks.outputs[back].at_tool.e1).max() < 1e-12
    off = np.array(
        [
            np.linalg.norm(arm.frame_placement(q)[1] - motion(arm, Q, k * DT).pose.translation)
            for k, q in enumerate(ticks.q)
        ]
    )
    assert off[back] > 0.02
    assert off[-1] < 0.05 * off[back]
    assert off[back:].max() < 1.5 * off[back]


@pytest.mark.slow
def test_load_that_the_controller_has_learnt_survives_a_fault(
    controller: rbi.CartesianController,
) -> None:
    guard = rbi.FaultGuard(controller, "hold", longest_hold=0.5)
    there = holding(guard.arm)
    disturbed = run(guard, lambda _: there, 700, between(600, 602, v=NAN))
    sound = run(guard, lambda _: there, 700)
    still = np.zeros(7)
    weight = guard.arm.with_payload(1.0).bias(Q, still) - guard.arm.bias(Q, still)
    assert np.abs(disturbed.tau - sound.tau)[600:].max() < 0.25 * np.abs(weight).max()


# --- around and inside other wrappers -------------------------------------------------------------


def test_guards_are_nested_as_in_joint_space(controller: rbi.CartesianController) -> None:
    encoders = rbi.QuantizedEncoders(controller, resolution=1e-6)
    guard = rbi.FaultGuard(rbi.SoftStart(encoders, 0.05))
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 150)
    assert ticks.responses == ["run"] * 150
    assert np.abs(ticks.outputs[-1].at_tool.e1).max() < 1e-2


def test_warm_up_of_a_controller_at_the_tool_and_of_its_guards_takes_poses(
    controller: rbi.CartesianController,
) -> None:
    """The first tick of a run is then no other than the later ones: the state is as it was."""
    guard = rbi.FaultGuard(rbi.SoftStart(controller, 0.05))
    guard.warm_up()
    controller.warm_up()
    assert guard.init().monitor.ticks == 0


@pytest.mark.parametrize("backend", ["numpy", "pinocchio"])
def test_late_tick_of_a_packed_state_is_that_of_a_plain_one(
    backend: Any, controller: rbi.CartesianController
) -> None:
    arm = controller.arm
    law = rbi.CartesianController(arm, dt=DT, posture=Q, backend=backend)
    plain = rbi.CartesianController(arm, dt=DT, posture=Q, backend="numpy")
    f, v = np.array([3.0, 0.0, 5.0, 0.1, 0.0, 0.2]), np.full(7, 0.1)
    states = [law.init(), plain.init()]
    for k in range(4):
        ticks = [
            each.step(state, Q, v, motion(arm, Q, k * DT), f, period=1.7e-3)
            for each, state in zip((law, plain), states, strict=True)
        ]
        states = [state for _, state in ticks]
        assert_allclose(ticks[0][0].tau, ticks[1][0].tau, atol=1e-9)
        assert_allclose(states[0].displacement, states[1].displacement, atol=1e-15)


def test_guarded_run_logs_the_tool(controller: rbi.CartesianController) -> None:
    arm, there = controller.arm, holding(controller.arm)
    guard = rbi.FaultGuard(rbi.SoftStart(controller, 0.05))
    result = rbi.simulate(guard, arm.with_payload(1.0), lambda _: there, q0=Q, duration=0.3)
    assert result.tool is not None
    assert np.abs(result.tool.e1[-1]).max() < 1e-3


def test_step_is_pure_and_late_ticks_are_handed_on(controller: rbi.CartesianController) -> None:
    guard: Any = rbi.FaultGuard(rbi.SoftStart(controller, 0.05))
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 40)
    given = ticks.q[-1], ticks.v[-1], motion(guard.arm, Q, 0.04), np.zeros(7)
    once, _ = guard.step(ticks.state, *given, 2e-3)
    again, _ = guard.step(ticks.state, *given, 2e-3)
    assert_array_equal(once.tau, again.tau)
    assert once.response == "run"


def test_state_survives_a_snapshot_and_an_output_pickling(
    controller: rbi.CartesianController,
) -> None:
    guard: Any = rbi.FaultGuard(rbi.SoftStart(controller, 0.05))
    ticks = run(guard, lambda t: motion(guard.arm, Q, t), 20, between(15, 16, v=NAN))
    kept = restore(dump(ticks.state, guard.init(), "id"), guard.init(), "id")
    given = ticks.q[-1], ticks.v[-1], motion(guard.arm, Q, 0.02), np.zeros(7)
    assert_array_equal(guard.step(kept, *given)[0].tau, guard.step(ticks.state, *given)[0].tau)
    output = ticks.outputs[15]
    copy = pickle.loads(pickle.dumps(output))
    assert (copy.response, copy.fault) == (output.response, output.fault)
