"""The baselines at the tool: what each does to the tool's acceleration, with an exact model and without."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rbimpedance as rbi

Array = NDArray[np.float64]
AXES = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
MASS, STIFFNESS = np.array([3.0, 2.0, 4.0, 0.2, 0.1, 0.3]), np.array([900.0, 500, 200, 30, 20, 10])
IMPEDANCE = rbi.CartesianImpedance(MASS, STIFFNESS, axes=AXES)
Q = np.array([0.0, -1.2, 1.6, -1.9, -1.57, 0.3])
V = np.array([0.1, -0.2, 0.05, 0.3, -0.1, 0.2])
F = np.array([3.0, -2.0, 5.0, 0.2, 0.1, -0.3])


@pytest.fixture(scope="module")
def ur5() -> rbi.ArmModel:
    return rbi.load_robot("ur5", armature=0.1)


def desired(arm: rbi.ArmModel) -> rbi.CartesianReference:
    R, p = arm.frame_placement(Q)
    turn = Rotation.from_rotvec([0.02, -0.01, 0.03]).as_matrix()
    pose = rbi.Pose(turn @ R, p + np.array([0.01, -0.02, 0.03]))
    return rbi.CartesianReference(pose, 0.1 * np.arange(6.0), 0.2 * np.arange(6.0)[::-1])


def acceleration_of_tool(arm: rbi.ArmModel, output: Any, wrench: Array) -> Array:
    """Ẍ under a torque, by finite differences of the tool's velocity."""
    a, h = arm.forward_dynamics(Q, V, output.tau, output.jacobian.T @ wrench), 1e-6
    velocities = [
        arm.jacobian(Q + step * V + step**2 / 2.0 * a) @ (V + step * a) for step in (-h, h)
    ]
    return np.asarray((velocities[1] - velocities[0]) / (2.0 * h))


def feedback(arm: rbi.ArmModel, wrench: Array) -> Array:
    """a_d + M_d⁻¹[K e + D ė + f] in the compliance axes."""
    R, p = arm.frame_placement(Q)
    there = desired(arm)
    turn = Rotation.from_matrix(there.pose.rotation @ R.T).as_rotvec()
    e = np.r_[there.pose.translation - p, turn]
    both = np.kron(np.eye(2), AXES)
    force = STIFFNESS * (both.T @ e) + 2.0 * np.sqrt(MASS * STIFFNESS) * (
        both.T @ (there.v - arm.jacobian(Q) @ V)
    )
    return np.asarray(there.a + both @ ((force + both.T @ wrench) / MASS))


def test_hogan_gives_the_tool_the_target_impedance_where_the_model_is_exact(
    ur5: rbi.ArmModel,
) -> None:
    law = rbi.baselines.CartesianHogan(ur5, IMPEDANCE)
    output, _ = law.step(law.init(), Q, V, desired(ur5), F)
    assert_allclose(acceleration_of_tool(ur5, output, F), feedback(ur5, F), rtol=2e-3, atol=2e-2)


def test_operational_space_yields_with_the_arms_own_inertia(ur5: rbi.ArmModel) -> None:
    law = rbi.baselines.OperationalSpace(ur5, IMPEDANCE)
    output, _ = law.step(law.init(), Q, V, desired(ur5), F)
    J, M = output.jacobian, ur5.mass_matrix(Q)
    yields = J @ np.linalg.inv(M) @ J.T @ F
    wanted = feedback(ur5, np.zeros(6)) + yields
    assert_allclose(acceleration_of_tool(ur5, output, F), wanted, rtol=2e-3, atol=2e-2)


def test_spring_and_damper_are_torques_through_the_jacobian(ur5: rbi.ArmModel) -> None:
    law = rbi.baselines.CartesianPD(ur5, IMPEDANCE)
    still = desired(ur5)._replace(v=np.zeros(6))
    output, _ = law.step(law.init(), Q, np.zeros(6), still, F)
    both = np.kron(np.eye(2), AXES)
    force = both @ (STIFFNESS * (both.T @ output.e1))
    assert_allclose(output.tau, output.jacobian.T @ force + ur5.bias(Q, np.zeros(6)), atol=1e-9)


def test_integrator_of_the_pid_removes_what_the_model_misses(ur5: rbi.ArmModel) -> None:
    start = rbi.Pose(*ur5.frame_placement(Q))
    hold, plant = rbi.trajectories.cartesian.hold(start), ur5.with_payload(1.0)
    largest = []
    for law in (
        rbi.baselines.CartesianPID(ur5, IMPEDANCE, 40.0),
        rbi.baselines.CartesianHogan(ur5, IMPEDANCE),
    ):
        run = rbi.simulate(law, plant, hold, q0=Q, duration=0.5, substeps=2)
        assert run.tool is not None
        largest.append(float(np.abs(run.tool.e1[-1]).max()))
    assert largest[0] < 1e-4 < 1e-3 < largest[1]


def test_integrator_rests_where_the_torque_is_limited(ur5: rbi.ArmModel) -> None:
    far = desired(ur5)
    far = far._replace(pose=rbi.Pose(far.pose.rotation, far.pose.translation + 0.2))
    law = rbi.baselines.CartesianPID(ur5, IMPEDANCE, 40.0, limits=20.0)
    state = law.init()
    for _ in range(200):
        output, state = law.step(state, Q, np.zeros(6), far, np.zeros(6))
    assert (np.abs(output.tau) <= 20.0).all()
    assert output.saturated.any()
    grown = np.abs(state.integral) > 0.99 * 0.2 * np.abs(output.e1)
    assert not grown[:3].all()


def test_late_ticks_advance_target_and_integral(ur5: rbi.ArmModel) -> None:
    law = rbi.baselines.CartesianPID(ur5, IMPEDANCE, 40.0)
    _, state = law.step(law.init(), Q, V, desired(ur5), F)
    late = law.elapsed(state, 3e-3)
    assert_allclose(late.integral, 3.0 * state.integral, rtol=1e-12)
    assert np.linalg.norm(late.displacement.xi) > np.linalg.norm(state.displacement.xi)


@pytest.mark.parametrize("name", ["CartesianPD", "OperationalSpace", "CartesianHogan"])
def test_redundant_arm_is_drawn_to_its_first_posture_without_moving_the_tool(name: str) -> None:
    fingers = "panda_finger_joint1", "panda_finger_joint2"
    arm = rbi.load_robot("panda", lock=fingers, armature=0.1).with_friction(0.0, 0.0)
    law = getattr(rbi.baselines, name)(arm, rbi.CartesianImpedance((3.0, 0.15), (900.0, 30.0)))
    hold = rbi.trajectories.cartesian.hold(arm)
    _, state = law.step(law.init(), arm.ready, np.zeros(7), hold(0.0), np.zeros(6))
    null = np.linalg.svd(arm.jacobian(arm.ready))[2][6]
    away = state._replace(posture=arm.ready + 0.1 * null)
    outputs = [
        law.step(s, arm.ready, np.zeros(7), hold(0.0), np.zeros(6))[0] for s in (state, away)
    ]
    gained = outputs[1].a - outputs[0].a
    assert gained @ null > 0.1
    if name != "CartesianPD":  # whose projection is not consistent with the inertia
        assert_allclose(arm.jacobian(arm.ready) @ gained, 0.0, atol=1e-5)
