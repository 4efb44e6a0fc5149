"""`CartesianController`: torques equal to those of a second implementation, invariances, limits, singularities."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.control.cartesian_defaults import tool_surface
from rbimpedance.law.damped_inverse import Damping

from ..oracles import operational_space as oracle

Array = NDArray[np.float64]
DT = 1e-3
MASS, STIFFNESS = [3.0, 3, 3, 0.15, 0.15, 0.15], [1000.0, 1000, 200, 30, 30, 10]
TURNED = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
AXES: dict[str, Any] = {"world": "world", "reference": "reference", "turned": TURNED}


def panda() -> rbi.ArmModel:
    fingers = "panda_finger_joint1", "panda_finger_joint2"
    return rbi.load_robot("panda", lock=fingers, armature=0.1).with_friction(0.0, 0.0)


def ur5() -> rbi.ArmModel:
    return rbi.load_robot("ur5", armature=0.1)


def with_panda_links(model: pin.Model, kinds: list[Any], name: str) -> rbi.ArmModel:
    """The panda's links on joints of these kinds without limits, after those that the model has."""
    links, before = panda().model, model.njoints - 1
    model.gravity = links.gravity
    for j, kind in enumerate(kinds, 1):
        parent, place = links.parents[j] + before, links.jointPlacements[j]
        at = model.addJoint(parent, kind, place, links.names[j])
        model.appendBodyToJoint(at, links.inertias[j], pin.SE3.Identity())
    tool = links.frames[links.getFrameId("panda_hand_tcp")]
    model.addFrame(pin.Frame("tool", tool.parentJoint + before, 0, tool.placement, tool.type))
    model.armature = np.full(model.nv, 0.1)
    return rbi.ArmModel(model, name=name, tool_frame="tool")


def seven_with_continuous_joints() -> rbi.ArmModel:
    kinds = [pin.JointModelRUBZ() if j % 2 else pin.JointModelRZ() for j in range(1, 8)]
    return with_panda_links(pin.Model(), kinds, "free")


ARMS: dict[str, Callable[[], rbi.ArmModel]] = {
    "panda": panda,
    "ur5": ur5,
    "continuous": seven_with_continuous_joints,
}
ANGLES = {
    "panda": [0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8],
    "ur5": [0.0, -1.2, 1.6, -1.9, -1.57, 0.3],
    "continuous": [3.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8],
}


class Setting(NamedTuple):
    arm: rbi.ArmModel
    q: Array
    controller: rbi.CartesianController
    law: oracle.ToolLaw


def setting(name: str, axes: str = "world", angles: Any = None) -> Setting:
    """The same law twice, with the same numbers."""
    arm = ARMS[name]()
    q = arm.integrate(arm.zero, ANGLES[name] if angles is None else angles)
    n = arm.nv - 6
    base, slow = rbi.FastTerminalSurface(5.0, 3.0, 0.6, 1e-3), rbi.FastTerminalSurface(2.0, 1.0)
    k1, k2 = np.repeat([18.0, 35.0], 3), np.repeat([60.0, 200.0], 3)
    controller = rbi.CartesianController(
        arm,
        rbi.CartesianImpedance(MASS, STIFFNESS, axes=AXES[axes]),
        tool_surface(base),
        rbi.SuperTwisting(k1, k2, "matched", 1.2),
        DT,
        posture=rbi.Posture(q, slow, rbi.SuperTwisting(15.0, 40.0, "matched", 1.2)),
        joint_limits=False,
    )
    surface = tool_surface(base)
    gains = oracle.Gains(
        np.r_[np.full(6, 5.0), np.full(n, 2.0)],
        np.r_[surface.gamma, np.full(n, 1.0)],
        np.r_[surface.smoothing, np.full(n, 1e-3)],
        np.r_[k1, np.full(n, 15.0)],
        np.r_[k2, np.full(n, 40.0)],
        0.6,
        1.2,
    )
    R_c = {"world": np.eye(3), "reference": None, "turned": TURNED}[axes]
    target = oracle.Target(np.diag(MASS), np.diag(STIFFNESS), DT, R_c)
    frame = arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
    if frame == arm.model.nframes:
        frame = arm.model.getFrameId(arm.tool_frame)
    return Setting(arm, q, controller, oracle.ToolLaw(arm.model, frame, target, gains, DT, q))


def motion(arm: rbi.ArmModel, q: Array, t: float) -> rbi.CartesianReference:
    """A circle with a turn, from the pose of q."""
    R, p = arm.frame_placement(q)
    w, axis = 1.5, np.array([0.0, 0.6, 0.8])
    f, df, ddf = 0.3 * (1.0 - np.cos(w * t)), 0.3 * w * np.sin(w * t), 0.3 * w * w * np.cos(w * t)
    turn = Rotation.from_rotvec(f * axis).as_matrix()
    out = 0.1 * np.array([0.0, np.sin(w * t), np.cos(w * t) - 1.0])
    v = 0.1 * w * np.array([0.0, np.cos(w * t), -np.sin(w * t)])
    a = -0.1 * w * w * np.array([0.0, np.sin(w * t), np.cos(w * t)])
    return rbi.CartesianReference(
        rbi.Pose(turn @ R, p + out), np.r_[v, df * axis], np.r_[a, ddf * axis]
    )


def wrench_at(t: float) -> Array:
    return np.array([12.0, 3.0, -16.0, 0.5, -0.8, 0.6]) * float(np.sin(7.0 * t))


def largest_difference(case: Setting, ticks: int, *, plant: rbi.ArmModel) -> tuple[float, float]:
    """Largest difference of torques along a run of the plant, and the smallest σ on the way."""
    arm, q, controller, law = case
    v, state, apart, sigma = np.zeros(arm.nv), controller.init(), 0.0, np.inf
    for k in range(ticks):
        (pose, v_d, a_d), f = motion(arm, case.q, k * DT), wrench_at(k * DT)
        output, state = controller.step(state, q, v, rbi.CartesianReference(pose, v_d, a_d), f)
        other = law.torque(q, v, oracle.Motion(*pose, v_d, a_d), f)
        apart, sigma = max(apart, float(np.abs(output.tau - other).max())), min(sigma, output.sigma)
        tau_ext = output.jacobian.T @ f
        v = v + DT * plant.forward_dynamics(q, v, output.tau, tau_ext)
        q = arm.integrate(q, DT * v)
    return apart, sigma


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("name", ARMS)
def test_torques_are_those_of_a_second_implementation(name: str, axes: str) -> None:
    case = setting(name, axes)
    plant = case.arm.with_scaled_inertia(1.1).with_payload(1.0)
    apart, sigma = largest_difference(case, 150, plant=plant)
    assert sigma > 0.1
    assert apart < 1e-9


@pytest.mark.parametrize(
    ("name", "angles"),
    [
        ("ur5", [0.0, -1.2, 1.6, -1.9, -0.03, 0.3]),  # wrist nearly straight
        ("panda", [0.0, 0.5, 1.5, -0.1, 1.5, 0.05, 0.0]),  # wrist nearly straight
    ],
)
def test_torques_are_equal_near_singularities_too(name: str, angles: Any) -> None:
    case = setting(name, angles=angles)
    apart, sigma = largest_difference(case, 100, plant=case.arm.with_payload(1.0))
    assert sigma < Damping().threshold
    assert apart < 1e-9


def test_step_is_pure_and_survives_pickling() -> None:
    arm, q, controller, _ = setting("panda")
    copy: rbi.CartesianController = pickle.loads(pickle.dumps(controller))
    state, v, answers = controller.init(), np.full(7, 0.1), []
    _, state = controller.step(state, q, v, motion(arm, q, 0.0), wrench_at(0.3))
    for one in (controller, controller, copy):
        output, following = one.step(state, q, v, motion(arm, q, DT), wrench_at(0.3))
        answers.append((output.tau.tobytes(), following.tool.z.tobytes()))
    assert len(set(answers)) == 1


def test_turning_the_tool_frame_changes_no_torque() -> None:
    """Errors and compliance are in world axes: a frame that is turned in the tool has the same law."""
    arm, Q = panda(), Rotation.from_rotvec([0.5, 1.0, -0.7]).as_matrix()
    model = arm.model
    tool = model.frames[model.getFrameId("panda_hand_tcp")]
    turn = pin.SE3(Q, np.zeros(3))
    model.addFrame(pin.Frame("turned", tool.parentJoint, 0, tool.placement * turn, tool.type))
    both = rbi.ArmModel(model, name="panda", tool_frame="panda_hand_tcp")
    q = np.array(ANGLES["panda"])
    impedance = rbi.CartesianImpedance(MASS, STIFFNESS)
    outputs = []
    for frame, turned in (("panda_hand_tcp", np.eye(3)), ("turned", Q)):
        controller = rbi.CartesianController(both, impedance, frame=frame)
        state = controller.init()
        for k in range(20):
            (R, p), v, a = motion(both, q, 0.5 + k * DT)
            there = rbi.CartesianReference(rbi.Pose(R @ turned, p), v, a)
            output, state = controller.step(state, q, np.full(7, 0.05), there, wrench_at(0.4))
        outputs.append(output.tau)
    assert_allclose(outputs[0], outputs[1], rtol=1e-10, atol=1e-9)


def turned_world(arm: rbi.ArmModel, Q: Array) -> rbi.ArmModel:
    """The same arm with its base and gravity turned."""
    model = arm.model
    for j in range(1, model.njoints):
        if model.parents[j] == 0:
            model.jointPlacements[j] = pin.SE3(Q, np.zeros(3)) * model.jointPlacements[j]
    model.gravity.linear = Q @ model.gravity.linear
    return rbi.ArmModel(model, name=arm.name, tool_frame=arm.tool_frame)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_turning_the_world_by_quarter_turns_changes_no_torque(name: str) -> None:
    """Surfaces act per axis, so the axes have to be axes again; gains and compliance are turned with them."""
    Q = Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0]).as_matrix()
    arm, q, controller, _ = setting(name, "turned")
    impedance = rbi.CartesianImpedance(MASS, STIFFNESS, axes=Q @ TURNED)
    other = rbi.CartesianController(
        turned_world(arm, Q),
        impedance,
        controller.surface,
        controller.reaching,
        DT,
        posture=controller.posture,
        joint_limits=False,
    )
    both, taus, v = np.kron(np.eye(2), Q), [], np.full(arm.nv, 0.05)
    for each, turn, pair in ((controller, np.eye(3), np.eye(6)), (other, Q, both)):
        state = each.init()
        for k in range(20):
            (R, p), v_d, a_d = motion(arm, q, 0.5 + k * DT)
            there = rbi.CartesianReference(rbi.Pose(turn @ R, turn @ p), pair @ v_d, pair @ a_d)
            output, state = each.step(state, q, v, there, pair @ wrench_at(0.4))
        taus.append(output.tau)
    assert_allclose(taus[0], taus[1], rtol=1e-10, atol=1e-8)


def gantry() -> rbi.ArmModel:
    """Three sliding joints along x, y and z: the Jacobian of the tool is the identity."""
    model, at = pin.Model(), 0
    for i, kind in enumerate((pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ())):
        at = model.addJoint(at, kind, pin.SE3.Identity(), f"slide{i}")
        body = pin.Inertia(2.0 - 0.5 * i, np.array([0.1, 0.0, 0.05]), 0.01 * np.eye(3))
        model.appendBodyToJoint(at, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", at, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return rbi.ArmModel(model, name="gantry", tool_frame="tool")


def test_gantry_gets_the_torques_of_the_joint_space_law() -> None:
    arm, limits = gantry(), rbi.Limits(effort=60.0, rate=4e3)
    mass, stiffness = np.array([2.0, 3.0, 1.0]), np.array([200.0, 100.0, 50.0])
    surface, reaching = rbi.FastTerminalSurface(2.0, 3.0, 0.6, 1e-3), rbi.SuperTwisting(8.0, 10.0)
    joint = rbi.ImpedanceController(
        arm, rbi.Impedance(mass, stiffness=stiffness), surface, reaching, DT, limits=limits
    )
    impedance = rbi.CartesianImpedance(np.r_[mass, 1, 1, 1], np.r_[stiffness, 1, 1, 1])
    tool = rbi.CartesianController(arm, impedance, surface, reaching, DT, limits=limits)
    plant, q, v = arm.with_payload(1.0), np.array([0.3, -0.2, 0.1]), np.zeros(3)
    state, at_tool, saturated = joint.init(), tool.init(), 0
    for k in range(600):
        f = np.array([4.0, -6.0, 3.0]) * np.sin(9.0 * k * DT)
        x, dx, ddx = (
            np.sin(3.0 * k * DT + i * np.pi / 2) * 0.1 * 3.0**i * np.ones(3) for i in range(3)
        )
        wanted, state = joint.step(state, q, v, rbi.Reference(x, dx, ddx), f)
        zero, pose = np.zeros(3), rbi.Pose(np.eye(3), x)
        there = rbi.CartesianReference(pose, np.r_[dx, zero], np.r_[ddx, zero])
        output, at_tool = tool.step(at_tool, q, v, there, np.r_[f, zero])
        assert_allclose(output.tau, wanted.tau, atol=1e-9)
        assert_allclose(output.s[:3], wanted.s, atol=1e-12)
        assert (output.premise_holds[:3] == wanted.premise_holds).all()
        saturated += int(wanted.saturated.any() or wanted.rate_limited.any())
        assert output.lost.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
        v = v + DT * plant.forward_dynamics(q, v, output.tau, f)
        q = q + DT * v
    assert 0 < saturated < 300


def test_a_late_tick_is_the_sum_of_the_ticks_it_stands_for() -> None:
    """The target filter is exact over the measured time."""
    arm, q, controller, _ = setting("ur5")
    v, there, f = np.zeros(6), motion(arm, q, 0.0), wrench_at(0.2)
    _, state = controller.step(controller.init(), q, v, there, f)
    late = controller.elapsed(state, 5 * DT)
    flt, now = controller.impedance.filter(DT), state.displacement_before
    for _ in range(5):
        now = flt.advance(now, state.pulled)
    assert_allclose(late.displacement.xi, now.xi, rtol=1e-9)
    assert_allclose(late.tool.z, 5.0 * state.tool.z, rtol=1e-12)
    a, _ = controller.step(state, q, v, there, f, period=5 * DT)
    b, _ = controller.step(late, q, v, there, f)
    assert a.tau.tobytes() == b.tau.tobytes()
    with pytest.raises(rbi.InputError, match="period"):
        controller.elapsed(state, 0.0)


def test_wrench_from_joint_torques_is_the_one_at_the_tool(rng: np.random.Generator) -> None:
    arm, q, controller, _ = setting("panda")
    wrench = rng.normal(size=6)
    found = controller.wrench_from_torque(q, arm.external_torque(q, wrench))
    assert_allclose(found, wrench, atol=1e-12)


def test_torque_of_the_environment_is_taken_off_as_it_is_measured(rng: np.random.Generator) -> None:
    arm, q, controller, _ = setting("panda")
    v, there, f = np.zeros(7), motion(arm, q, 0.0), wrench_at(0.2)
    elbow = rng.normal(size=7)
    usual, _ = controller.step(controller.init(), q, v, there, f)
    more, _ = controller.step(controller.init(), q, v, there, f, usual.jacobian.T @ f + elbow)
    assert_allclose(usual.tau - more.tau, elbow, atol=1e-12)


def test_saturated_torque_is_flagged_and_does_not_wind_up() -> None:
    arm, q, controller, _ = setting("panda")
    limited = rbi.CartesianController(
        arm, controller.impedance, controller.surface, controller.reaching, DT, limits=30.0
    )
    far = motion(arm, q, 0.0)
    far = far._replace(
        pose=rbi.Pose(far.pose.rotation, far.pose.translation + np.array([0.0, 0.0, 0.3]))
    )
    state, v = limited.init(), np.zeros(7)
    for _ in range(300):
        output, state = limited.step(state, q, v, far, np.zeros(6))
    assert (np.abs(output.tau) <= 30.0).all()
    assert output.saturated.any()
    assert not output.premise_holds.all()
    k2_z = limited.reaching.k2 * np.abs(state.tool.z)
    assert (k2_z <= np.abs(output.s) * 1e3 + 2.0 * np.abs(output.u) + 1.0).all()


def test_impedance_error_is_zero_where_the_plant_is_the_model_and_the_errors_are_zero() -> None:
    arm, q, controller, _ = setting("panda")
    there, f = motion(arm, q, 0.0)._replace(v=np.zeros(6)), np.zeros(6)
    output, _ = controller.step(controller.init(), q, np.zeros(7), there, f)
    a = arm.forward_dynamics(q, np.zeros(7), output.tau)
    assert_allclose(output.a, a, atol=1e-9)
    assert_allclose(controller.impedance_error(output, a), 0.0, atol=1e-8)
    pushed = controller.tool_impedance_error(
        output, a + np.linalg.pinv(output.jacobian) @ np.eye(6)[2]
    )
    assert_allclose(pushed, [0.0, 0.0, -MASS[2], 0.0, 0.0, 0.0], atol=1e-8)


@pytest.mark.parametrize("name", ["panda", "ur5", "two_link"])
def test_controller_of_an_arm_alone_holds_its_pose(name: str) -> None:
    arm = rbi.load_robot(name, armature=0.1)
    if name == "panda":
        arm = panda()
    controller = rbi.CartesianController(arm)
    hold = rbi.trajectories.cartesian.hold(arm)
    output, _ = controller.step(
        controller.init(), arm.ready, np.zeros(arm.nv), hold(0.0), np.zeros(6)
    )
    assert_allclose(output.tau, arm.bias(arm.ready, np.zeros(arm.nv)), atol=1e-6)
    assert controller.frame == arm.tool_frame


BAD: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"dt": 0.0}, rbi.ParameterError, "dt"),
    ({"frame": "hand"}, rbi.ModelError, "no frame 'hand'"),
    ({"reaching": rbi.SuperTwisting(np.ones(7), 1.0)}, rbi.DimensionError, "k1"),
    ({"posture": np.zeros(3)}, rbi.DimensionError, "posture"),
    ({"limits": np.ones(3)}, rbi.DimensionError, "effort"),
]


@pytest.mark.parametrize(("given", "error", "words"), BAD, ids=[words for *_, words in BAD])
def test_construction_refuses_what_does_not_fit(
    given: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        rbi.CartesianController(ur5(), **given)


def test_step_refuses_bad_inputs_by_name() -> None:
    arm, q, controller, _ = setting("ur5")
    state, v, there, f = controller.init(), np.zeros(6), motion(arm, q, 0.0), np.zeros(6)
    nan = np.full(6, np.nan)
    cases: list[tuple[tuple[Any, ...], type[Exception], str]] = [
        ((q[:3], v, there, f), rbi.DimensionError, "q"),
        ((q, nan, there, f), rbi.NonFiniteError, "v"),
        ((q, v, there, f[:3]), rbi.DimensionError, "wrench"),
        ((q, v, there, nan), rbi.NonFiniteError, "wrench"),
        ((q, v, there, f, nan), rbi.NonFiniteError, "tau_ext"),
        ((q, v, rbi.Reference(q, v, v), f), rbi.DimensionError, "Pose"),
        ((q, v, there._replace(v=nan), f), rbi.NonFiniteError, "reference.v"),
    ]
    for given, error, words in cases:
        with pytest.raises(error, match=words):
            controller.step(state, *given)


def test_damping_length_is_that_of_the_translations() -> None:
    arm, q, controller, _ = setting("panda")
    longer = rbi.CartesianController(
        arm, controller.impedance, dt=DT, posture=q, damping=Damping(length=0.6)
    )
    for each, length in ((controller, 0.3), (longer, 0.6)):
        output, _ = each.step(each.init(), q, np.zeros(7), motion(arm, q, 0.0), np.zeros(6))
        scaled = np.repeat([1.0 / length, 1.0], 3)[:, None] * arm.jacobian(q)
        assert_allclose(output.sigma, np.linalg.svd(scaled, compute_uv=False)[-1], rtol=1e-9)


def test_guard_of_the_joints_reference_refuses_a_controller_at_the_tool() -> None:
    """When it is made, with what a controller at the tool has instead; not at the first tick of an arm."""
    guard: Any = rbi.ReferenceGuard
    target = rbi.CartesianImpedance(mass=MASS, stiffness=STIFFNESS, damping_ratio=1.0)
    with pytest.raises(rbi.ParameterError, match="joint_limits=, got 'CartesianController'"):
        guard(rbi.CartesianController(ur5(), target, backend="numpy"))
    with pytest.raises(rbi.ParameterError, match="joint_limits=, got 'CartesianController'"):
        rbi.ReferenceGuard(
            rbi.QuantizedEncoders(rbi.CartesianController(ur5(), target, backend="numpy"))
        )
