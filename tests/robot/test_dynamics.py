"""`ArmModel` against Pinocchio called directly, finite differences and energy balances."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.robot.pinocchio_dynamics import COULOMB_SMOOTHING

from .. import arms
from ..arms import ARMS

Array = NDArray[np.float64]


@pytest.fixture(scope="module", params=sorted(ARMS))
def arm(request: pytest.FixtureRequest) -> rbi.ArmModel:
    return ARMS[str(request.param)]()


@pytest.fixture(scope="module")
def spinner() -> rbi.ArmModel:
    return arms.spinner()


class Motion(NamedTuple):
    """A configuration, a velocity, and an acceleration or a torque."""

    q: Array
    v: Array
    a: Array


def draw(arm: rbi.ArmModel, rng: np.random.Generator) -> Motion:
    v, a = rng.normal(0.0, 1.5, arm.nv), rng.normal(0.0, 5.0, arm.nv)
    return Motion(arm.random_configuration(rng), v, a)


def friction(arm: rbi.ArmModel, v: Array) -> Array:
    result: Array = arm.viscous * v + arm.coulomb * np.tanh(v / 0.05)
    return result


def turn(angle: float) -> Array:
    """Configuration of `arms.spinner` with its continuous joint at an angle."""
    return np.array([np.cos(angle), np.sin(angle), 0.1, -0.2])


# --- dynamics ------------------------------------------------------------------------------------


def test_mass_matrix_is_symmetric_positive_definite(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(50):
        M = arm.mass_matrix(arm.random_configuration(rng))
        assert_array_equal(M, M.T)
        assert np.linalg.eigvalsh(M)[0] > 0.0


def test_columns_of_the_mass_matrix_are_the_torques_of_unit_accelerations(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    model = arm.with_gravity([0.0, 0.0, 0.0]).model
    data, rest = model.createData(), np.zeros(arm.nv)
    for _ in range(20):
        q = arm.random_configuration(rng)
        columns = [np.array(pin.rnea(model, data, q, rest, a)) for a in np.eye(arm.nv)]
        assert_allclose(arm.mass_matrix(q), np.transpose(columns), rtol=0.0, atol=1e-12)


def test_power_that_flows_in_is_the_rate_of_energy_plus_what_friction_takes(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    """Holds exactly when Ṁ - 2C is skew and the gravity torque is the gradient of the potential."""
    model, h = arm.model, 1e-5
    data = model.createData()

    def energy(q: Array, v: Array) -> float:
        pin.forwardKinematics(model, data, q)
        links = zip(model.inertias, data.oMi, strict=True)
        potential = -sum(link.mass * model.gravity.linear @ M.act(link.lever) for link, M in links)
        return float(v @ arm.mass_matrix(q) @ v / 2.0 + potential)

    for _ in range(20):
        q, v, tau = draw(arm, rng)
        tau_ext = rng.normal(0.0, 5.0, arm.nv)
        a = arm.forward_dynamics(q, v, tau, tau_ext)
        after = energy(arm.integrate(q, h * v + h**2 / 2.0 * a), v + h * a)
        before = energy(arm.integrate(q, -h * v + h**2 / 2.0 * a), v - h * a)
        power = float((tau + tau_ext - friction(arm, v)) @ v)
        assert (after - before) / (2.0 * h) == pytest.approx(power, rel=1e-6, abs=1e-5)


def test_forward_and_inverse_dynamics_are_inverses(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(50):
        q, v, a = draw(arm, rng)
        tau = arm.inverse_dynamics(q, v, a)
        assert_allclose(arm.forward_dynamics(q, v, tau), a, rtol=1e-9, atol=1e-9)
        tau_ext = rng.normal(0.0, 5.0, arm.nv)
        assert_allclose(arm.forward_dynamics(q, v, tau - tau_ext, tau_ext), a, rtol=1e-9, atol=1e-9)


def test_inverse_dynamics_is_mass_times_acceleration_plus_bias(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(50):
        q, v, a = draw(arm, rng)
        expected = arm.mass_matrix(q) @ a + arm.bias(q, v)
        assert_allclose(arm.inverse_dynamics(q, v, a), expected, rtol=0.0, atol=1e-11)


def test_bias_is_that_of_pinocchio_plus_viscous_and_smoothed_coulomb_friction(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    model = arm.model
    data = model.createData()
    assert COULOMB_SMOOTHING == 0.05
    for _ in range(50):
        q, v, _ = draw(arm, rng)
        expected = np.array(pin.nonLinearEffects(model, data, q, v)) + friction(arm, v)
        assert_allclose(arm.bias(q, v), expected, rtol=1e-14, atol=1e-14)


def test_fast_joints_feel_the_whole_coulomb_torque_and_resting_ones_none(
    spinner: rbi.ArmModel,
) -> None:
    smooth = spinner.with_friction(0.0, 0.0)
    dry = spinner.with_friction(0.0, [0.5, 0.4, 0.3])
    for direction in (-1.0, 1.0):
        v = np.full(3, 3.0 * direction)
        drag = dry.bias(turn(0.3), v) - smooth.bias(turn(0.3), v)
        assert_allclose(drag, direction * np.array([0.5, 0.4, 0.3]), rtol=1e-12)
    rest = np.zeros(3)
    assert_array_equal(dry.bias(turn(0.3), rest), smooth.bias(turn(0.3), rest))


def test_drift_is_minus_inverse_mass_times_bias(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(20):
        q, v, _ = draw(arm, rng)
        expected = -np.linalg.solve(arm.mass_matrix(q), arm.bias(q, v))
        assert_allclose(arm.drift(q, v), expected, rtol=1e-10, atol=1e-10)


def test_pendulum_is_the_textbook_one(rng: np.random.Generator) -> None:
    """m l² a + m g l sin q + d v = tau."""
    pendulum = arms.pendulum().with_friction(viscous=0.4)
    for _ in range(20):
        q, v, a = rng.uniform(-3.0, 3.0, (3, 1))
        torque = 2.0 * 0.25 * a + 2.0 * 9.81 * 0.5 * np.sin(q) + 0.4 * v
        assert_allclose(pendulum.inverse_dynamics(q, v, a), torque, rtol=1e-13, atol=1e-13)
        assert_allclose(pendulum.forward_dynamics(q, v, torque), a, rtol=1e-11, atol=1e-11)


# --- kinematics ----------------------------------------------------------------------------------


def test_jacobian_is_the_derivative_of_the_frame_placement(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    h = 1e-6
    for frame in (None, arm.frame_names[3]):
        for _ in range(5):
            q = arm.random_configuration(rng)
            J = arm.jacobian(q, frame)
            assert J.shape == (6, arm.nv)
            for i, direction in enumerate(np.eye(arm.nv)):
                R1, p1 = arm.frame_placement(arm.integrate(q, h * direction), frame)
                R0, p0 = arm.frame_placement(arm.integrate(q, -h * direction), frame)
                assert_allclose(J[:3, i], (p1 - p0) / (2.0 * h), rtol=0.0, atol=1e-8)
                assert_allclose(J[3:, i], pin.log3(R1 @ R0.T) / (2.0 * h), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("expressed_in", "axes"),
    [("world", pin.ReferenceFrame.LOCAL_WORLD_ALIGNED), ("local", pin.ReferenceFrame.LOCAL)],
)
def test_external_torque_does_the_work_of_the_wrench(
    arm: rbi.ArmModel, rng: np.random.Generator, expressed_in: str, axes: pin.ReferenceFrame
) -> None:
    model = arm.model
    data = model.createData()
    for _ in range(20):
        q, v, _ = draw(arm, rng)
        wrench = rng.normal(0.0, 5.0, 6)
        pin.forwardKinematics(model, data, q, v)
        twist = pin.getFrameVelocity(model, data, model.getFrameId(arm.tool_frame), axes).vector
        torque = arm.external_torque(q, wrench, expressed_in=expressed_in)
        assert float(torque @ v) == pytest.approx(float(wrench @ twist), rel=1e-11, abs=1e-11)


def test_continuous_joint_goes_the_short_way_round(spinner: rbi.ArmModel) -> None:
    step = spinner.difference(turn(3.1), turn(-3.1))
    assert_allclose(step, [2.0 * np.pi - 6.2, 0.0, 0.0], rtol=0.0, atol=1e-12)
    assert_allclose(spinner.integrate(turn(3.1), step), turn(-3.1), rtol=0.0, atol=1e-12)


@settings(max_examples=50)
@given(start=st.floats(-10.0, 10.0), angle=st.floats(-3.14, 3.14))
def test_difference_undoes_integrate(start: float, angle: float) -> None:
    spinner, step = arms.spinner(), np.array([angle, 0.3, -0.4])
    there = spinner.integrate(turn(start), step)
    assert_allclose(there[:2], turn(start + angle)[:2], rtol=0.0, atol=1e-12)
    assert_allclose(spinner.difference(turn(start), there), step, rtol=0.0, atol=1e-12)


def test_link_is_meant_where_a_joint_has_the_same_name(rng: np.random.Generator) -> None:
    """Joint "hand" is welded to the link "hand" with an offset: the names do not mean one place."""
    twin = arms.arm_from_urdf(arms.spinner_urdf(tool_joint="hand"))
    q = twin.random_configuration(rng)
    plain = arms.arm_from_urdf(arms.spinner_urdf())
    for ours, theirs in zip(
        twin.frame_placement(q, "hand"), plain.frame_placement(q, "hand"), strict=True
    ):
        assert_array_equal(ours, theirs)


def test_positions_in_place_of_a_configuration_are_told_the_way_to_one() -> None:
    arm = rbi.load_robot("kinova")  # three continuous joints: nq = 9, nv = 6
    angles = np.linspace(-0.3, 0.2, 6)
    with pytest.raises(rbi.DimensionError, match=r"arm\.integrate\(arm\.zero, q\) makes one"):
        arm.mass_matrix(angles)
    q = arm.integrate(arm.zero, angles)
    assert_allclose(arm.difference(arm.zero, q), angles, atol=1e-15)


# --- mimic joints --------------------------------------------------------------------------------


def mimic_tree(rng: np.random.Generator) -> tuple[rbi.ArmModel, rbi.ArmModel, Array, Array]:
    """An arm with mimicking joints, the same one with free joints, and q_full = G q + offset."""
    axes, kinds, rules = ("1 0 0", "0 1 0", "1 2 3"), ("revolute", "prismatic"), {}
    elements: list[str] = []
    for k in range(6):
        parent = "base" if k == 0 else f"l{rng.integers(max(0, k - 2), k)}"
        mimic = ""
        if k in (1, 3, 4):
            slope, offset = (float(x) for x in rng.normal(size=2))
            rules[f"j{k}"] = ("j0", slope, offset)
            mimic = f'<mimic joint="j0" multiplier="{slope}" offset="{offset}"/>'
        axis, kind = axes[rng.integers(3)], kinds[rng.integers(2)]
        more = arms.LIMIT + mimic
        elements += [
            arms.urdf_joint(f"j{k}", kind, parent, f"l{k}", axis, more),
            arms.urdf_link(f"l{k}", 1.0),
        ]
    text = arms.urdf(*elements)
    bound, free = (arms.arm_from_urdf(text, "l5", mimic=mimic) for mimic in (True, False))
    G, offsets = np.zeros((free.nv, bound.nv)), np.zeros(free.nv)
    for i, name in enumerate(free.joint_names):
        leader, slope, offsets[i] = rules.get(name, (name, 1.0, 0.0))
        G[i, bound.joint_names.index(leader)] = slope
    return bound, free, G, offsets


@pytest.mark.parametrize("seed", range(12))
def test_mimic_arm_is_the_free_arm_with_its_joints_bound(seed: int) -> None:
    """q_full = G q + offset gives M = Gᵀ M_full G, bias = Gᵀ bias_full, J = J_full G."""
    rng = np.random.default_rng(seed)
    bound, free, G, offset = mimic_tree(rng)
    assert (bound.nv, free.nv) == (3, 6)
    for _ in range(3):  # Pinocchio's CRBA is right at the first call only
        q, v, a = rng.normal(size=(3, bound.nv))
        q_full, v_full, a_full = G @ q + offset, G @ v, G @ a
        close = partial(assert_allclose, rtol=1e-11, atol=1e-10)
        close(bound.mass_matrix(q), G.T @ free.mass_matrix(q_full) @ G)
        close(bound.bias(q, v), G.T @ free.bias(q_full, v_full))
        torque = G.T @ free.inverse_dynamics(q_full, v_full, a_full)
        close(bound.inverse_dynamics(q, v, a), torque)
        for frame in ("l2", "l4", "l5"):
            close(bound.jacobian(q, frame), free.jacobian(q_full, frame) @ G)


FOLLOWERS = {
    "turning": ("revolute", "revolute", -0.7),
    "sliding after turning": ("revolute", "prismatic", 0.3),
    "turning after sliding": ("prismatic", "revolute", 2.0),
    "continuous": ("continuous", "continuous", -1.5),
    "standing still": ("revolute", "revolute", 0.0),
}


@pytest.mark.parametrize("kinds", FOLLOWERS.values(), ids=FOLLOWERS.keys())
def test_dynamics_of_followers_of_every_kind_are_those_of_pinocchios_rnea(
    kinds: tuple[str, str, float], rng: np.random.Generator
) -> None:
    leader, follower, multiplier = kinds
    rule = f'<mimic joint="lead" multiplier="{multiplier}" offset="0.2"/>'
    text = arms.urdf(
        arms.urdf_joint("lead", leader, "base", "first", "0 1 0", arms.LIMIT),
        arms.urdf_link("first", 2.0),
        arms.urdf_joint("middle", "revolute", "first", "second", "1 0 0", arms.LIMIT),
        arms.urdf_link("second", 1.0),
        arms.urdf_joint("then", follower, "second", "third", "1 -2 1", arms.LIMIT + rule),
        arms.urdf_link("third", 1.5),
    )
    arm = arms.arm_from_urdf(text, "third", mimic=True).with_armature([0.1, 0.2])
    model = arm.model
    data = model.createData()
    for _ in range(5):
        q, v, a = arm.random_configuration(rng), rng.normal(size=2), rng.normal(size=2)
        tau = pin.rnea(model, data, q, v, a).copy()
        assert_allclose(arm.mass_matrix(q) @ a + arm.bias(q, v), tau, rtol=0.0, atol=1e-11)
        assert_allclose(arm.forward_dynamics(q, v, tau), a, rtol=0.0, atol=1e-10)
        pin.forwardKinematics(model, data, q, v)
        frame = model.getFrameId("third")
        velocity = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector
        assert_allclose(arm.jacobian(q, "third") @ v, velocity, rtol=0.0, atol=1e-12)


# --- copies with changes -------------------------------------------------------------------------


def test_payload_equals_a_urdf_that_contains_it(rng: np.random.Generator) -> None:
    load = """<link name="load"><inertial><origin xyz="0.1 0.02 -0.03"/><mass value="1.7"/>
    <inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.002" ixz="0.001" iyz="-0.003"/></inertial></link>
    <joint name="grip" type="fixed"><parent link="{frame}"/><child link="load"/></joint>"""
    inertia = [[0.03, 0.002, 0.001], [0.002, 0.04, -0.003], [0.001, -0.003, 0.05]]
    bare = arms.arm_from_urdf(arms.spinner_urdf())
    for frame in ("tool", "carriage"):
        loaded = arms.arm_from_urdf(arms.spinner_urdf(load.format(frame=frame)))
        ours = bare.with_payload(1.7, [0.1, 0.02, -0.03], inertia, frame)
        for _ in range(20):
            q, v, _ = draw(bare, rng)
            assert_allclose(ours.mass_matrix(q), loaded.mass_matrix(q), rtol=0.0, atol=1e-12)
            assert_allclose(ours.bias(q, v), loaded.bias(q, v), rtol=0.0, atol=1e-12)


def test_payload_is_a_point_mass_at_the_tool_by_default(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    loaded = arm.with_payload(2.0)
    for _ in range(20):
        q = arm.random_configuration(rng)
        J = arm.jacobian(q)[:3]
        expected = arm.mass_matrix(q) + 2.0 * J.T @ J
        assert_allclose(loaded.mass_matrix(q), expected, rtol=0.0, atol=1e-12)


def test_no_payload_changes_nothing(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    q = arm.random_configuration(rng)
    assert_allclose(arm.with_payload(0.0).mass_matrix(q), arm.mass_matrix(q), rtol=1e-13)


def test_scaled_inertia_scales_links_and_spares_rotors_and_friction(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    heavy, rotors = arm.with_scaled_inertia(1.3), np.diag(arm.armature)
    q, v, _ = draw(arm, rng)
    links = arm.mass_matrix(q) - rotors
    assert_allclose(heavy.mass_matrix(q), 1.3 * links + rotors, rtol=1e-12, atol=1e-12)
    drag = friction(arm, v)
    expected = 1.3 * (arm.bias(q, v) - drag) + drag
    assert_allclose(heavy.bias(q, v), expected, rtol=1e-12, atol=1e-12)


def test_armature_enters_mass_matrix_and_both_dynamics_alike(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    rotors = rng.uniform(0.1, 0.5, arm.nv)
    geared, bare = arm.with_armature(rotors), arm.with_armature(0.0)
    q, v, a = draw(arm, rng)
    M = bare.mass_matrix(q) + np.diag(rotors)
    assert_allclose(geared.mass_matrix(q), M, rtol=0.0, atol=1e-13)
    expected = bare.inverse_dynamics(q, v, a) + rotors * a
    assert_allclose(geared.inverse_dynamics(q, v, a), expected, rtol=0.0, atol=1e-12)
    solved = np.linalg.solve(M, a - bare.bias(q, v))
    assert_allclose(geared.forward_dynamics(q, v, a), solved, rtol=1e-10, atol=1e-10)


def test_scalar_friction_and_armature_spread_over_the_joints(arm: rbi.ArmModel) -> None:
    changed = arm.with_friction(viscous=0.7, coulomb=0.2).with_armature(0.1)
    assert_array_equal(changed.viscous, np.full(arm.nv, 0.7))
    assert_array_equal(changed.coulomb, np.full(arm.nv, 0.2))
    assert_array_equal(changed.armature, np.full(arm.nv, 0.1))


def test_friction_that_is_not_given_stays(arm: rbi.ArmModel) -> None:
    assert_array_equal(arm.with_friction(viscous=0.7).coulomb, arm.coulomb)
    assert_array_equal(arm.with_friction(coulomb=0.7).viscous, arm.viscous)


def test_gravity_torque_is_linear_in_gravity(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    q, rest, g = arm.random_configuration(rng), np.zeros(arm.nv), np.array([1.0, -2.0, 3.0])
    once, thrice = arm.with_gravity(g).bias(q, rest), arm.with_gravity(3.0 * g).bias(q, rest)
    assert np.abs(once).max() > 0.1
    assert_allclose(thrice, 3.0 * once, rtol=1e-12, atol=1e-12)
    assert_array_equal(arm.with_gravity(np.zeros(3)).bias(q, rest), rest)


CHANGES: dict[str, Callable[[rbi.ArmModel], rbi.ArmModel]] = {
    "payload": lambda arm: arm.with_payload(1.0),
    "inertia": lambda arm: arm.with_scaled_inertia(2.0),
    "viscous": lambda arm: arm.with_friction(viscous=9.0),
    "coulomb": lambda arm: arm.with_friction(coulomb=9.0),
    "armature": lambda arm: arm.with_armature(9.0),
    "gravity": lambda arm: arm.with_gravity([0.0, 0.0, -1.62]),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_changed_copy_leaves_the_original_alone(
    arm: rbi.ArmModel, change: Callable[[rbi.ArmModel], rbi.ArmModel], rng: np.random.Generator
) -> None:
    q, v, a = draw(arm, rng)
    digest, torque = arm.digest, arm.inverse_dynamics(q, v, a)
    changed = change(arm)
    assert not np.array_equal(changed.inverse_dynamics(q, v, a), torque)
    assert changed.digest != digest
    assert arm.digest == digest
    assert_array_equal(arm.inverse_dynamics(q, v, a), torque)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_changed_copy_keeps_name_tool_and_notes(
    change: Callable[[rbi.ArmModel], rbi.ArmModel],
) -> None:
    model = pin.buildSampleModelManipulator()
    arm = rbi.ArmModel(model, name="x", tool_frame="wrist1_body", notes=("said",))
    changed = change(arm)
    assert (changed.name, changed.tool_frame, changed.notes) == ("x", "wrist1_body", ("said",))


# --- ownership -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_arm_shares_nothing_with_the_models_around_it(rng: np.random.Generator) -> None:
    source = pin.buildSampleModelManipulator()
    arm = rbi.ArmModel(source, name="x", tool_frame="effector_body")
    q, v, a = draw(arm, rng)
    torque, digest = arm.inverse_dynamics(q, v, a), arm.digest
    for model in (source, arm.model):
        model.gravity.linear = np.array([1.0, 2.0, 3.0])
        model.inertias[2] = pin.Inertia(9.0, np.ones(3), np.eye(3))
        model.armature = np.ones(6)
        model.upperPositionLimit = np.zeros(6)
    assert_array_equal(arm.inverse_dynamics(q, v, a), torque)
    assert arm.digest == digest


ARRAYS = ("neutral", "lower", "upper", "effort_limit", "velocity_limit")
FRICTIONS = ("viscous", "coulomb", "armature")


@pytest.mark.parametrize("name", ARRAYS + FRICTIONS)
def test_arrays_of_an_arm_are_read_only(arm: rbi.ArmModel, name: str) -> None:
    with pytest.raises(ValueError, match="read-only"):
        getattr(arm, name)[0] = 1.0


def test_attributes_of_an_arm_cannot_be_set(arm: rbi.ArmModel) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        arm.name = "other"  # type: ignore[misc]


CALLS: dict[str, Callable[[rbi.ArmModel, Motion], Array]] = {
    "mass_matrix": lambda arm, x: arm.mass_matrix(x.q),
    "bias": lambda arm, x: arm.bias(x.q, x.v),
    "drift": lambda arm, x: arm.drift(x.q, x.v),
    "inverse_dynamics": lambda arm, x: arm.inverse_dynamics(x.q, x.v, x.a),
    "forward_dynamics": lambda arm, x: arm.forward_dynamics(x.q, x.v, x.a, x.a),
    "jacobian": lambda arm, x: arm.jacobian(x.q),
    "rotation": lambda arm, x: arm.frame_placement(x.q)[0],
    "origin": lambda arm, x: arm.frame_placement(x.q)[1],
    "external_torque": lambda arm, x: arm.external_torque(x.q, np.ones(6)),
    "difference": lambda arm, x: arm.difference(arm.neutral, x.q),
    "integrate": lambda arm, x: arm.integrate(x.q, x.v),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_answers_are_the_callers_own(
    arm: rbi.ArmModel,
    call: Callable[[rbi.ArmModel, Motion], Array],
    rng: np.random.Generator,
) -> None:
    inputs = draw(arm, rng)
    before = [x.copy() for x in inputs]
    first = call(arm, inputs)
    kept = first.copy()
    call(arm, draw(arm, rng))
    assert_array_equal(first, kept)
    first[...] = np.nan
    assert_array_equal(call(arm, inputs), kept)
    for x, y in zip(inputs, before, strict=True):
        assert_array_equal(x, y)


@pytest.mark.parametrize(
    "duplicate",
    [lambda arm: pickle.loads(pickle.dumps(arm)), copy.copy, copy.deepcopy, rbi.ArmModel.copy],
    ids=["pickle", "copy", "deepcopy", "method"],
)
def test_duplicate_is_equal_to_the_bit(
    arm: rbi.ArmModel,
    duplicate: Callable[[rbi.ArmModel], rbi.ArmModel],
    rng: np.random.Generator,
) -> None:
    other = duplicate(arm)
    assert other.digest == arm.digest
    assert other.raw_dynamics is not arm.raw_dynamics
    assert (other.name, other.joint_names, other.notes) == (arm.name, arm.joint_names, arm.notes)
    q, v, a = draw(arm, rng)
    assert_array_equal(other.inverse_dynamics(q, v, a), arm.inverse_dynamics(q, v, a))
    assert_array_equal(other.forward_dynamics(q, v, a), arm.forward_dynamics(q, v, a))


# --- digest --------------------------------------------------------------------------------------


def test_equal_arms_have_equal_digests() -> None:
    for build in ARMS.values():
        assert build().digest == build().digest


def test_digest_tells_joint_axes_apart() -> None:
    one, other = (arms.arm_from_urdf(arms.spinner_urdf(oblique=x)) for x in ("1 2 -1", "1 2 -2"))
    assert one.digest != other.digest


def test_digest_tells_mimic_multipliers_apart() -> None:
    one, other = (arms.arm_from_urdf(arms.mimic_urdf(x), mimic=True) for x in (-0.5, -0.6))
    assert one.digest != other.digest


def test_digest_tells_tools_apart() -> None:
    one, other = (arms.arm_from_urdf(arms.spinner_urdf(), tool) for tool in ("tool", "hand"))
    assert one.digest != other.digest


def test_digest_tells_places_of_the_tool_apart() -> None:
    moved = arms.spinner_urdf().replace('name="tool_joint" type="fixed"><', "{}<")
    head, tail = moved.split("{}")
    tail = tail.replace('xyz="0.05 -0.02 0.3"', 'xyz="0.05 -0.02 0.4"', 1)
    moved = f'{head}name="tool_joint" type="fixed">{tail}'
    assert arms.arm_from_urdf(moved).digest != arms.arm_from_urdf(arms.spinner_urdf()).digest


# --- limits and random configurations ------------------------------------------------------------


def test_random_configurations_lie_within_the_limits(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    drawn = np.array([arm.random_configuration(rng) for _ in range(300)])
    assert (drawn >= arm.lower).all()
    assert (drawn <= arm.upper).all()
    bounded = np.isfinite(arm.upper)
    span = (arm.upper - arm.lower)[bounded]
    assert (np.ptp(drawn[:, bounded], axis=0) > 0.9 * span).all()


def test_random_configurations_turn_a_continuous_joint_all_the_way(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    drawn = np.array([spinner.random_configuration(rng) for _ in range(300)])
    assert_allclose(np.hypot(drawn[:, 0], drawn[:, 1]), 1.0, rtol=1e-12)
    assert np.ptp(np.arctan2(drawn[:, 1], drawn[:, 0])) > 0.9 * 2.0 * np.pi


def test_random_configurations_are_reproducible(arm: rbi.ArmModel) -> None:
    one, other = (arm.random_configuration(np.random.default_rng(5)) for _ in range(2))
    assert_array_equal(one, other)


def test_joint_without_limits_is_drawn_around_neutral(rng: np.random.Generator) -> None:
    """Pinocchio's default limit is the largest double, not infinity."""
    pendulum = arms.pendulum()
    assert (pendulum.lower[0], pendulum.upper[0]) == (-np.inf, np.inf)
    drawn = np.array([pendulum.random_configuration(rng) for _ in range(200)])
    assert np.abs(drawn).max() <= np.pi
    assert np.abs(drawn).max() > 0.9 * np.pi


def test_neutral_is_moved_into_the_limits() -> None:
    model = pin.buildSampleModelManipulator()
    model.lowerPositionLimit = np.array([0.5, -3.0, -3.0, -3.0, -3.0, -3.0])
    model.upperPositionLimit = np.array([3.0, -0.25, 3.0, 3.0, 3.0, 3.0])
    arm = rbi.ArmModel(model, name="x", tool_frame="effector_body")
    assert_array_equal(arm.neutral, [0.5, -0.25, 0.0, 0.0, 0.0, 0.0])


def test_joint_positions_count_from_the_zero_configuration(spinner: rbi.ArmModel) -> None:
    assert_allclose(spinner.integrate(spinner.zero, [0.7, 0.1, -0.2]), turn(0.7), atol=1e-15)
    assert_allclose(spinner.difference(spinner.zero, turn(-0.7)), [-0.7, 0.1, -0.2], atol=1e-15)


def test_zero_configuration_does_not_heed_the_limits() -> None:
    panda = rbi.load_robot("panda")
    assert panda.neutral[3] == panda.upper[3]
    assert panda.zero[3] == 0.0


def test_neutral_of_a_continuous_joint_is_angle_zero(spinner: rbi.ArmModel) -> None:
    assert_array_equal(spinner.neutral, [1.0, 0.0, 0.0, 0.0])


def test_limit_of_zero_or_none_is_no_limit() -> None:
    model = pin.buildSampleModelManipulator()
    model.upperEffortLimit = np.array([0.0, 5.0, 0.0, 1.0, 2.0, 3.0])
    model.upperVelocityLimit = np.array([1.0, 0.0, 2.0, 3.0, 4.0, 5.0])
    arm = rbi.ArmModel(model, name="x", tool_frame="effector_body")
    assert_array_equal(arm.effort_limit, [np.inf, 5.0, np.inf, 1.0, 2.0, 3.0])
    assert_array_equal(arm.velocity_limit, [1.0, np.inf, 2.0, 3.0, 4.0, 5.0])
    assert np.isposinf(arms.pendulum().effort_limit).all()
    assert np.isposinf(arms.pendulum().velocity_limit).all()


def test_order_of_joint_names_is_that_of_v(spinner: rbi.ArmModel) -> None:
    assert spinner.joint_names == ("spin", "slide", "tilt")


# --- refusals ------------------------------------------------------------------------------------


def test_floating_base_is_refused_by_name() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "floating_base")
    with pytest.raises(rbi.UnsupportedJointError, match=r"'floating_base'.*lock=") as caught:
        rbi.ArmModel(model, name="drone", tool_frame="universe")
    assert caught.value.joints == ("floating_base",)


def test_model_without_movable_joint_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="no movable joint"):
        rbi.ArmModel(pin.Model(), name="rock", tool_frame="universe")


@pytest.mark.parametrize(
    "use",
    [
        lambda arm: rbi.ArmModel(arm.model, name="arm", tool_frame="tol"),
        lambda arm: arm.jacobian(arm.neutral, "tol"),
        lambda arm: arm.frame_placement(arm.neutral, "tol"),
        lambda arm: arm.external_torque(arm.neutral, np.ones(6), "tol"),
        lambda arm: arm.with_payload(1.0, frame="tol"),
    ],
    ids=["ArmModel", "jacobian", "frame_placement", "external_torque", "with_payload"],
)
def test_unknown_frame_is_refused_with_near_names(
    spinner: rbi.ArmModel, use: Callable[[rbi.ArmModel], object]
) -> None:
    with pytest.raises(rbi.ModelError, match=r"no frame 'tol'; did you mean 'tool'"):
        use(spinner)


def test_configuration_of_wrong_size_is_told_nq_and_nv(spinner: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DimensionError, match=r"nq = 4 \(nv = 3\).*shape \(3,\)"):
        spinner.mass_matrix(np.zeros(3))


def test_configuration_off_the_unit_circle_is_refused(spinner: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DimensionError, match=r"\(cos, sin\) pairs of unit length"):
        spinner.mass_matrix([0.9, 0.0, 0.0, 0.0])


ZERO = np.zeros(3)
BAD_VECTORS: dict[str, tuple[object, type[rbi.InputError], str]] = {
    "short": (np.zeros(2), rbi.DimensionError, r"shape \(2,\)"),
    "scalar": (0.5, rbi.DimensionError, r"shape \(\)"),
    "matrix": (np.zeros((3, 1)), rbi.DimensionError, r"shape \(3, 1\)"),
    "ragged": ([[1.0], [1.0, 2.0], 3.0], rbi.DimensionError, "ragged"),
    "complex": (np.zeros(3, dtype=complex), rbi.DimensionError, "complex128"),
    "bool": (np.zeros(3, dtype=bool), rbi.DimensionError, "bool"),
    "text": (["1", "2", "3"], rbi.DimensionError, "<U1"),
    "object": (np.array([1.0, None, 2.0]), rbi.DimensionError, "object"),
    "nan": ([0.0, np.nan, 0.0], rbi.NonFiniteError, "entry 1"),
    "infinite": ([0.0, 0.0, -np.inf], rbi.NonFiniteError, "entry 2"),
}
USES: dict[str, tuple[str, Callable[[rbi.ArmModel, Array], object]]] = {
    "bias v": ("v", lambda arm, x: arm.bias(arm.neutral, x)),
    "drift v": ("v", lambda arm, x: arm.drift(arm.neutral, x)),
    "inverse v": ("v", lambda arm, x: arm.inverse_dynamics(arm.neutral, x, ZERO)),
    "inverse a": ("a", lambda arm, x: arm.inverse_dynamics(arm.neutral, ZERO, x)),
    "forward v": ("v", lambda arm, x: arm.forward_dynamics(arm.neutral, x, ZERO)),
    "forward tau": ("tau", lambda arm, x: arm.forward_dynamics(arm.neutral, ZERO, x)),
    "forward tau_ext": (
        "tau_ext",
        lambda arm, x: arm.forward_dynamics(arm.neutral, ZERO, ZERO, x),
    ),
    "integrate": ("step", lambda arm, x: arm.integrate(arm.neutral, x)),
    "com": ("com", lambda arm, x: arm.with_payload(1.0, x)),
    "gravity": ("gravity", lambda arm, x: arm.with_gravity(x)),
}


@pytest.mark.parametrize(("bad", "error", "words"), BAD_VECTORS.values(), ids=BAD_VECTORS)
@pytest.mark.parametrize(("name", "use"), USES.values(), ids=USES)
def test_unusable_vector_is_refused_by_name(
    spinner: rbi.ArmModel,
    name: str,
    use: Callable[[rbi.ArmModel, Array], object],
    bad: Array,
    error: type[rbi.InputError],
    words: str,
) -> None:
    with pytest.raises(error, match=rf"^{name} must be .*{words}"):
        use(spinner, bad)


BAD_CONFIGURATIONS: dict[str, tuple[object, type[rbi.InputError]]] = {
    "short": (np.zeros(3), rbi.DimensionError),
    "off the circle": ([1.0, 0.1, 0.0, 0.0], rbi.DimensionError),
    "complex": (np.zeros(4, dtype=complex), rbi.DimensionError),
    "nan": ([1.0, 0.0, np.nan, 0.0], rbi.NonFiniteError),
    "nan on the circle": ([np.nan, 0.0, 0.0, 0.0], rbi.NonFiniteError),
}


@pytest.mark.parametrize(
    ("bad", "error"), BAD_CONFIGURATIONS.values(), ids=list(BAD_CONFIGURATIONS)
)
@pytest.mark.parametrize("name", sorted(set(CALLS) - {"difference"}))
def test_unusable_configuration_is_refused(
    spinner: rbi.ArmModel, name: str, bad: Array, error: type[rbi.InputError]
) -> None:
    with pytest.raises(error, match=r"^q must be"):
        CALLS[name](spinner, Motion(bad, np.zeros(3), np.zeros(3)))


def test_unusable_end_of_a_difference_is_refused_by_name(spinner: rbi.ArmModel) -> None:
    q, bad = spinner.neutral, np.full(4, np.nan)
    with pytest.raises(rbi.NonFiniteError, match=r"^q0 must be finite"):
        spinner.difference(bad, q)
    with pytest.raises(rbi.NonFiniteError, match=r"^q1 must be finite"):
        spinner.difference(q, bad)


@pytest.mark.parametrize("axes", ["World", "", "tool"])
def test_unknown_axes_of_a_wrench_are_refused(spinner: rbi.ArmModel, axes: str) -> None:
    with pytest.raises(rbi.ParameterError, match=r'expressed_in must be "world" or "local"'):
        spinner.external_torque(spinner.neutral, np.ones(6), expressed_in=axes)


BAD_COEFFICIENTS = (
    -1.0,
    np.nan,
    np.inf,
    "1",
    True,
    1j,
    [1.0, -1.0, 1.0],
    np.ones((3, 3)),
    [[1.0], []],
)


@pytest.mark.parametrize("bad", BAD_COEFFICIENTS, ids=repr)
@pytest.mark.parametrize(
    ("name", "use"),
    [
        ("viscous", lambda arm, x: arm.with_friction(viscous=x)),
        ("coulomb", lambda arm, x: arm.with_friction(coulomb=x)),
        ("armature", lambda arm, x: arm.with_armature(x)),
    ],
    ids=FRICTIONS,
)
def test_unusable_coefficient_is_refused_by_name(
    spinner: rbi.ArmModel, name: str, use: Callable[[rbi.ArmModel, Array], object], bad: Array
) -> None:
    with pytest.raises(rbi.ParameterError, match=rf"^{name} must be non-negative"):
        use(spinner, bad)


def test_coefficients_for_another_number_of_joints_are_refused(spinner: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DimensionError, match=r"viscous must be .*\(nv,\) = \(3,\).*\(2,\)"):
        spinner.with_friction(viscous=[1.0, 2.0])


@pytest.mark.parametrize("bad", [-1.0, np.nan, [1.0, 2.0], "2", True])
def test_unusable_payload_mass_is_refused(spinner: rbi.ArmModel, bad: float) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^mass must be"):
        spinner.with_payload(bad)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.inf, [1.0, 2.0], "2"])
def test_unusable_inertia_factor_is_refused(spinner: rbi.ArmModel, bad: float) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^factor must be a positive"):
        spinner.with_scaled_inertia(bad)


BAD_INERTIAS: dict[str, tuple[object, str]] = {
    "vector": ([1.0, 1.0, 1.0], r"shape \(3,\)"),
    "text": ("heavy", "<U5"),
    "skew": ([[1.0, 0.5, 0.0], [-0.5, 1.0, 0.0], [0.0, 0.0, 1.0]], "symmetric"),
    "nan": (np.full((3, 3), np.nan), "finite"),
    "indefinite": (np.diag([1.0, 1.0, -0.1]), "semi-definite"),
}


@pytest.mark.parametrize(("bad", "words"), BAD_INERTIAS.values(), ids=BAD_INERTIAS)
def test_unusable_payload_inertia_is_refused(spinner: rbi.ArmModel, bad: Array, words: str) -> None:
    with pytest.raises(
        (rbi.ParameterError, rbi.DimensionError), match=rf"^inertia must be .*{words}"
    ):
        spinner.with_payload(1.0, inertia=bad)


# --- forms of input ------------------------------------------------------------------------------


FORMS: dict[str, Callable[[Array], Array]] = {
    "list": lambda x: x.tolist(),
    "big-endian": lambda x: x.astype(">f8"),
    "float32": lambda x: x.astype(np.float32),
    "non-contiguous": lambda x: np.repeat(x, 2)[::2],
    "reversed": lambda x: x[::-1].copy()[::-1],
    "read-only": lambda x: np.frombuffer(x.tobytes()),
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_form_of_the_input_does_not_matter(
    call: Callable[[rbi.ArmModel, Motion], Array], form: Callable[[Array], Array]
) -> None:
    arm = arms.manipulator()
    x = Motion(*(np.arange(18.0).reshape(3, 6) / 8.0 - 1.0))  # exact in float32
    assert_array_equal(call(arm, Motion(*map(form, x))), call(arm, x))


def test_integers_are_numbers() -> None:
    arm, q, v = arms.manipulator(), np.array([0, 1, -1, 2, 0, 1]), np.arange(6, dtype=np.uint8)
    assert_array_equal(arm.bias(q, v), arm.bias(q.astype(float), v.astype(float)))


def test_jacobian_of_a_single_joint_is_a_matrix_and_serves_its_wrenches() -> None:
    arm, q = arms.pendulum(), np.array([0.3])
    assert arm.jacobian(q).shape == (6, 1)
    _, bob = arm.frame_placement(q)
    force = np.array([2.0, 0.0, -1.0])
    moment_about_the_pivot = np.cross(bob, force)[1]
    torque = arm.external_torque(q, [*force, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(torque, [moment_about_the_pivot], atol=1e-14)
