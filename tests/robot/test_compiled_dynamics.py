"""Compiled RNEA, ABA and CRBA against Pinocchio, and against identities that need no second library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.robot.compiled import dynamics as compiled
from rbimpedance.robot.compiled.dynamics import CompiledDynamics
from rbimpedance.robot.compiled.tables import arm_tables, axes_with_z_along

from .. import arms

Array = NDArray[np.float64]

AXES = ("1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1", "1 2 -1")
KINDS = ("revolute", "prismatic", "continuous")


def of_every_kind_and_axis() -> rbi.ArmModel:
    """A chain with every kind of joint about every axis, Pinocchio's own joints for ±x, ±y, ±z and the oblique ones."""
    elements, parent = [], "base"
    for i, (kind, axis) in enumerate((kind, axis) for axis in AXES for kind in KINDS):
        limit = "" if kind == "continuous" else arms.LIMIT
        elements += [
            arms.urdf_joint(f"j{i}", kind, parent, f"l{i}", axis, limit),
            arms.urdf_link(f"l{i}", 1.0 + 0.1 * i),
        ]
        parent = f"l{i}"
    return arms.arm_from_urdf(arms.urdf(*elements), parent).with_armature(0.1)


def tree() -> rbi.ArmModel:
    """Two branches on one link."""
    elements = []
    for i, parent in enumerate(("base", "l0", "l1", "l1", "l3", "l0")):
        elements += [
            arms.urdf_joint(f"j{i}", KINDS[i % 3], parent, f"l{i}", AXES[i], arms.LIMIT),
            arms.urdf_link(f"l{i}", 2.0 - 0.2 * i),
        ]
    arm = arms.arm_from_urdf(arms.urdf(*elements), "l5")
    return arm.with_friction(np.linspace(0.1, 0.6, 6), np.linspace(0.0, 0.5, 6))


FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
ARMS: dict[str, Callable[[], rbi.ArmModel]] = {
    "every kind and axis": of_every_kind_and_axis,
    "tree": tree,
    "manipulator": arms.manipulator,
    "spinner": arms.spinner,
    "pendulum": arms.pendulum,
    "panda": lambda: rbi.load_robot("panda", lock=FINGERS, armature=0.1),
    "two_link": lambda: rbi.load_robot("two_link"),
}


@pytest.fixture(scope="module", params=ARMS)
def arm(request: pytest.FixtureRequest) -> rbi.ArmModel:
    return ARMS[request.param]()


def states(arm: rbi.ArmModel, rng: np.random.Generator, count: int) -> list[tuple[Array, ...]]:
    return [(arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))) for _ in range(count)]


def assert_relative(mine: Array, truth: Array) -> None:
    assert_allclose(mine, truth, rtol=0.0, atol=1e-12 * np.abs(truth).max())


def test_results_are_those_of_pinocchio(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    dynamics = CompiledDynamics(arm)
    model, friction = arm.model, arm.raw_dynamics.friction
    data = model.createData()
    for q, v, x in states(arm, rng, 200):
        assert_relative(
            dynamics.inverse_dynamics(q, v, x), pin.rnea(model, data, q, v, x) + friction(v)
        )
        assert_relative(
            dynamics.forward_dynamics(q, v, x), pin.aba(model, data, q, v, x - friction(v))
        )
        assert_relative(dynamics.mass_matrix(q), np.array(pin.crba(model, data, q)))


def test_forward_dynamics_inverts_inverse_dynamics(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    dynamics = CompiledDynamics(arm)
    for q, v, a in states(arm, rng, 50):
        tau = dynamics.inverse_dynamics(q, v, a)
        again = dynamics.forward_dynamics(q, v, tau)
        inverse_size = np.linalg.norm(np.linalg.inv(dynamics.mass_matrix(q)))
        rounding = float(1e-14 * inverse_size * np.linalg.norm(tau))
        assert_allclose(again, a, rtol=0.0, atol=rounding)


def test_inverse_dynamics_is_mass_times_acceleration_plus_bias(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    dynamics = CompiledDynamics(arm)
    for q, v, a in states(arm, rng, 50):
        bias = dynamics.inverse_dynamics(q, v, np.zeros(arm.nv))
        assert_relative(dynamics.inverse_dynamics(q, v, a), dynamics.mass_matrix(q) @ a + bias)


def test_pendulum_obeys_its_closed_form(rng: np.random.Generator) -> None:
    """m·l²·a + m·g·l·sin q = tau."""
    dynamics = CompiledDynamics(arms.pendulum())
    for q, v, a in rng.normal(size=(20, 3, 1)):
        expected = 2.0 * 0.5**2 * a + 2.0 * 9.81 * 0.5 * np.sin(q)
        assert_allclose(dynamics.inverse_dynamics(q, v, a), expected, rtol=1e-14, atol=1e-14)


def test_base_far_from_the_origin_changes_nothing(rng: np.random.Generator) -> None:
    """Forward dynamics works in world axes: a distance of 10 m must not cost digits that matter."""
    near = arms.manipulator()
    model = near.model
    model.jointPlacements[1] = (
        pin.SE3(np.eye(3), np.array([10.0, -10.0, 3.0])) * model.jointPlacements[1]
    )
    far = rbi.ArmModel(model, name="far", tool_frame=near.tool_frame)
    there, here = CompiledDynamics(far), CompiledDynamics(near)
    for q, v, tau in states(near, rng, 50):
        assert_relative(there.forward_dynamics(q, v, tau), here.forward_dynamics(q, v, tau))


def test_mimic_joints_are_refused() -> None:
    with pytest.raises(rbi.UnsupportedJointError, match="follow"):
        CompiledDynamics(arms.follower())


def test_screw_joints_are_refused() -> None:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelHZ(0.1), pin.SE3.Identity(), "screw")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    with pytest.raises(rbi.UnsupportedJointError, match="screw"):
        CompiledDynamics(rbi.ArmModel(model, name="screw", tool_frame="tip"))


def test_tables_that_do_not_fit_the_arm_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    heavier = arms.manipulator().with_scaled_inertia(1.0 + 1e-9)
    wrong = arm_tables(heavier)
    monkeypatch.setattr(compiled, "arm_tables", lambda _: wrong)
    with pytest.raises(rbi.ModelError, match="differs from Pinocchio"):
        CompiledDynamics(arms.manipulator())


@pytest.mark.parametrize("axis", AXES)
def test_axes_are_turned_to_z(axis: str) -> None:
    z = np.array(axis.split(), dtype=np.float64)
    z /= np.linalg.norm(z)
    R = axes_with_z_along(z)
    assert_allclose(R.T @ R, np.eye(3), rtol=0.0, atol=1e-15)
    assert np.linalg.det(R) > 0.0
    assert (R[:, 2] == z).all()
    if np.count_nonzero(z) == 1:
        assert set(np.abs(R).ravel()) == {0.0, 1.0}
