"""The second engine: it is the same arm as Pinocchio's, keeps the mechanics' laws, and is pure."""

from __future__ import annotations

import importlib
import json
import pickle
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.interaction import as_interaction
from rbimpedance.robot.description import Description
from rbimpedance.simulation.plants import EngineAgreement, Motion, Plant
from rbimpedance.simulation.plants.mujoco_plant import MujocoState

from .. import laws
from ..arms import LIMIT, mimic_urdf, spinner_urdf, urdf, urdf_joint, urdf_link

mujoco = pytest.importorskip("mujoco")

ROOT = Path(__file__).parents[2]
LOCKED = {"panda": ("panda_finger_joint1", "panda_finger_joint2"), "z1": ("jointGripper",)}
ARMS = ("panda", "ur5", "z1", "xarm7", "kinova", "talos_arm", "two_link")
EXACT = EngineAgreement(mass_matrix=1e-9, bias=1e-9, jacobian=1e-9, motion=1e-6)
NOTHING = as_interaction(None)
H = 2.5e-4  # s
WEIGHT = 9.81 * 2.0  # N, of the slider

SLIDER = """<robot name="slider"><link name="base"/>
<link name="box"><inertial><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="box"/><axis xyz="0 0 1"/>
<limit lower="-0.4" upper="0.5" effort="50" velocity="3"/></joint>
<link name="tip"/><joint name="glue" type="fixed"><parent link="box"/><child link="tip"/>
<origin xyz="0 0 -0.1"/></joint></robot>"""

FLOOR = '<mujoco><worldbody><geom type="plane" size="1 1 1" pos="0 0 {z}"/></worldbody></mujoco>'


def load(name: str) -> rbi.ArmModel:
    return rbi.load_robot(name, lock=LOCKED.get(name, ()))


def slider(weightless: bool = True) -> rbi.ArmModel:
    """A box of 2 kg on a vertical rail, its tool frame 0.1 m below."""
    arm = rbi.load_robot(SLIDER)
    return arm.with_gravity((0.0, 0.0, 0.0)) if weightless else arm


def moved(
    plant: Plant[Any], steps: int, *, tau: float = 0.0, z: float = 0.0, v: float = 0.0, h: float = H
) -> Any:
    """State of a plant with one joint under a constant torque."""
    state = plant.begin(np.array([z]), np.array([v]), h)
    for k in range(steps):
        state = plant.step(state, np.array([tau]), NOTHING, k * h, h)
    return state


def bits(state: Any) -> tuple[bytes, ...]:
    return tuple(array.tobytes() for array in state)


def is_within(agreement: EngineAgreement) -> bool:
    return all(share <= bound for share, bound in zip(agreement, EXACT, strict=True))


# --- the same arm -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ARMS)
def test_engines_agree_on_an_arm_as_loaded(name: str) -> None:
    arm = load(name)
    assert is_within(rbi.simulation.plants.engine_agreement(arm, duration=0.2))
    assert rbi.MujocoPlant(arm).replaced == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "kinova"])
def test_engines_agree_for_a_second_of_free_motion(name: str) -> None:
    assert rbi.simulation.plants.engine_agreement(load(name), states=1, duration=1.0).motion <= 1e-6


CHANGES = {
    "payload": lambda arm: arm.with_payload(1.5, (0.02, -0.01, 0.05), 0.01 * np.eye(3)),
    "scaled": lambda arm: arm.with_scaled_inertia(1.3),
    "viscous": lambda arm: arm.with_friction(viscous=2.0),
    "coulomb": lambda arm: arm.with_friction(viscous=1.0, coulomb=1.0),
    "armature": lambda arm: arm.with_armature(0.2),
    "gravity": lambda arm: arm.with_gravity((1.0, -2.0, -5.0)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_engines_agree_on_what_the_urdf_does_not_have(change: str) -> None:
    arm = CHANGES[change](load("kinova"))
    assert is_within(rbi.simulation.plants.engine_agreement(arm, states=2, duration=0.2))
    carrying = {"payload": arm.joint_names[-1:], "scaled": arm.joint_names}
    assert rbi.MujocoPlant(arm).replaced == carrying.get(change, ())


def test_engines_agree_on_a_joint_that_is_locked_off_its_zero() -> None:
    arm = rbi.load_robot(
        "panda",
        lock=(*LOCKED["panda"], "panda_joint4"),
        locked_configuration={"panda_joint4": -1.5},
    )
    assert is_within(rbi.simulation.plants.engine_agreement(arm, duration=0.1))
    assert rbi.MujocoPlant(arm).replaced == ("panda_joint3", "panda_joint5")


def test_engines_agree_on_oblique_axes_and_sliding_joints() -> None:
    assert is_within(
        rbi.simulation.plants.engine_agreement(rbi.load_robot(spinner_urdf()), duration=0.2)
    )


def test_engines_agree_on_a_tree_whose_joints_they_order_differently() -> None:
    tree = urdf(
        urdf_joint("trunk", "revolute", "base", "hub", "0 1 0", LIMIT),
        urdf_link("hub", 2.0),
        urdf_joint("z_arm", "revolute", "hub", "z_hand", "1 0 0", LIMIT),
        urdf_link("z_hand", 1.5),
        urdf_joint("a_arm", "revolute", "hub", "a_hand", "0 0 1", LIMIT),
        urdf_link("a_hand", 0.5),
    )
    arm = rbi.load_robot(tree)
    plant = rbi.MujocoPlant(arm)
    assert arm.joint_names == ("trunk", "a_arm", "z_arm")
    assert plant._built.dofs.tolist() == [0, 2, 1]
    assert is_within(rbi.simulation.plants.engine_agreement(arm, duration=0.2))


def test_load_on_a_lone_joint_joins_its_mass() -> None:
    arm = slider().with_payload(3.0, (0.1, 0.2, 0.3))
    plant = rbi.MujocoPlant(arm)
    assert plant.replaced == ("rail",)
    state = moved(plant, 100, tau=10.0)
    np.testing.assert_allclose(state.velocity, 10.0 / 5.0 * 100 * H, rtol=1e-12)


def test_inertia_that_mujoco_would_mend_is_the_arms() -> None:
    thin = SLIDER.replace('ixx="0.1"', 'ixx="0.5"').replace("prismatic", "revolute")
    arm = rbi.load_robot(thin.replace('xyz="0 0 1"', 'xyz="1 0 0"'))
    plant = rbi.MujocoPlant(arm)
    assert plant.replaced == ("rail",)
    np.testing.assert_allclose(plant.mass_matrix(np.zeros(1)), [[0.5]], rtol=1e-12)


def test_other_arm_than_the_urdfs_is_refused_by_the_joint() -> None:
    chain = [
        urdf_joint("j1", "revolute", "base", "a", "0 1 0", LIMIT),
        urdf_link("a", 2.0),
        urdf_joint("j2", "revolute", "a", "b", "0 1 0", LIMIT),
        urdf_link("b", 2.0),
    ]
    arm = rbi.load_robot(urdf(*chain))
    fork = urdf(*chain).replace('<parent link="a"/>', '<parent link="base"/>')
    other = rbi.ArmModel(
        arm.model, name="arm", tool_frame=arm.tool_frame, description=Description(fork)
    )
    with pytest.raises(rbi.ModelError, match=r"their mass matrix differs by .* joint 'j[12]'"):
        rbi.MujocoPlant(other)


def test_plant_shares_no_model_with_its_arm() -> None:
    arm = slider()
    plant = rbi.MujocoPlant(arm)
    assert plant.arm is not arm
    assert plant.arm.raw_dynamics.model is not arm.raw_dynamics.model
    assert isinstance(plant, Plant)


# --- the laws of mechanics --------------------------------------------------------------------------------------


def test_step_is_the_one_of_mj_step() -> None:
    arm = slider(weightless=False).with_friction(viscous=3.0, coulomb=2.0)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{H}" gravity="0 0 -9.81"/><worldbody><body>
        <inertial mass="2" pos="0 0 0" diaginertia="0.1 0.1 0.1"/>
        <joint type="slide" axis="0 0 1" range="-0.4 0.5" limited="true" damping="3" frictionloss="2"/>
        <geom type="sphere" size="0.02" pos="0 0 -0.1"/></body>
        <geom type="plane" size="1 1 1" pos="0 0 -0.3"/></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    plant = rbi.MujocoPlant(arm, scene=FLOOR.format(z=-0.3), tool_radius=0.02)
    state = moved(plant, 0)
    for k in range(2000):
        mujoco.mj_step(model, data)
        state = plant.step(state, np.zeros(1), NOTHING, k * H, H)
    assert data.ncon == 1
    np.testing.assert_allclose(state.position, data.qpos, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(state.velocity, data.qvel, rtol=0.0, atol=1e-12)


def test_viscous_friction_is_that_of_implicit_euler() -> None:
    damping = 4000.0  # h·d/m = 0.5: stiff
    state = moved(rbi.MujocoPlant(slider().with_friction(viscous=damping)), 5, v=1.0)
    np.testing.assert_allclose(state.velocity, 1.0 / (1.0 + H * damping / 2.0) ** 5, rtol=1e-12)


def test_coulomb_friction_holds_a_small_force_and_takes_its_share_of_a_large_one() -> None:
    plant = rbi.MujocoPlant(slider().with_friction(coulomb=5.0))
    assert abs(moved(plant, 4000, tau=4.0).position[0]) < 0.05 * 4.0 / 2.0 / 2.0  # of free motion
    fast = moved(plant, 400, tau=9.0, v=1.0)
    np.testing.assert_allclose(fast.velocity, 1.0 + (9.0 - 5.0) / 2.0 * 400 * H, rtol=1e-9)


def test_armature_joins_the_mass() -> None:
    state = moved(rbi.MujocoPlant(slider().with_armature(3.0)), 100, tau=10.0)
    np.testing.assert_allclose(state.velocity, 10.0 / 5.0 * 100 * H, rtol=1e-12)


@pytest.mark.parametrize(("limits", "force"), [(True, 50.0), (False, 80.0)])
def test_effort_limit_clips_the_motor_and_nothing_else(limits: bool, force: float) -> None:
    plant = rbi.MujocoPlant(slider(), limits=limits)
    state = moved(plant, 100, tau=80.0)
    np.testing.assert_allclose(state.velocity, force / 2.0 * 100 * H, rtol=1e-12)
    pushed = rbi.MujocoPlant(slider(), limits=limits)
    start = moved(pushed, 0)
    a = pushed.acceleration(start, np.zeros(1), np.array([80.0]))
    np.testing.assert_allclose(a, 40.0, rtol=1e-12)


def test_position_limit_holds_a_joint_unless_limits_are_left_out() -> None:
    falling = slider(weightless=False)
    assert abs(moved(rbi.MujocoPlant(falling), 8000).position[0] + 0.4) < 2e-3
    free = moved(rbi.MujocoPlant(falling, limits=False), 4000)
    np.testing.assert_allclose(free.position, -9.81 / 2.0 * H**2 * 4000 * 4001, rtol=1e-9)


@pytest.mark.slow
def test_resting_tool_is_pushed_by_the_weight_of_the_arm() -> None:
    plant = rbi.MujocoPlant(
        slider(weightless=False), limits=False, scene=FLOOR.format(z=-0.5), tool_radius=0.05
    )
    state = moved(plant, 12000)
    pushed = plant.external_torque(state, NOTHING, 0.0)
    np.testing.assert_allclose(pushed, WEIGHT, rtol=1e-6)
    assert abs(state.position[0] + 0.35) < 1e-3  # the sphere's lowest point on the floor
    a = plant.acceleration(state, np.zeros(1), pushed)
    np.testing.assert_allclose(a, 0.0, atol=1e-5)


def test_only_contacts_are_part_of_the_external_torque() -> None:
    arm = slider(weightless=False).with_friction(coulomb=5.0)
    at_its_end = rbi.MujocoPlant(arm, scene=FLOOR.format(z=-1.0), tool_radius=0.05)
    state = moved(at_its_end, 8000)
    assert np.abs(at_its_end._data.qfrc_constraint).max() > 10.0
    assert at_its_end.external_torque(state, NOTHING, 0.0).tolist() == [0.0]


@pytest.mark.slow
def test_environment_and_contact_add_up() -> None:
    plant = rbi.MujocoPlant(slider(weightless=False), scene=FLOOR.format(z=-0.15), tool_radius=0.05)
    push, state = rbi.JointTorque([7.0]), moved(plant, 400)
    alone = plant.external_torque(state, NOTHING, 0.0)
    assert alone[0] > 1.0
    np.testing.assert_allclose(plant.external_torque(state, push, 0.0), alone + 7.0, rtol=1e-12)
    lighter = plant.begin(np.zeros(1), np.zeros(1), H)
    for k in range(8000):
        lighter = plant.step(lighter, np.zeros(1), push, k * H, H)
    np.testing.assert_allclose(lighter.contact, WEIGHT - 7.0, rtol=1e-6)


def test_continuous_joint_turns_on_and_on() -> None:
    arm = rbi.load_robot(SLIDER.replace("prismatic", "continuous")).with_gravity(np.zeros(3))
    plant = rbi.MujocoPlant(arm)
    state = plant.begin(np.array([0.0, 1.0]), np.array([20.0]), 1e-3)
    for k in range(1000):
        state = plant.step(state, np.zeros(1), NOTHING, k * 1e-3, 1e-3)
    turned = np.pi / 2.0 + 20.0
    np.testing.assert_allclose(state.position, turned, rtol=1e-12)
    q = plant.motion(state).q
    np.testing.assert_allclose(q, [np.cos(turned), np.sin(turned)], rtol=0.0, atol=1e-12)


# --- pure -------------------------------------------------------------------------------------------------------


def contact_plant() -> rbi.MujocoPlant:
    """An arm above a table that it falls on, with dry friction: the solver has work to do."""
    arm = load("two_link").with_friction(viscous=0.5, coulomb=0.2)
    _, tool = arm.frame_placement(arm.neutral)
    return rbi.MujocoPlant(arm, scene=FLOOR.format(z=tool[2] - 0.06), tool_radius=0.05)


def fallen(plant: rbi.MujocoPlant, steps: int) -> MujocoState:
    state = plant.begin(plant.arm.neutral, np.zeros(2), H)
    for k in range(steps):
        state = plant.step(state, np.full(2, 0.5), NOTHING, k * H, H)
    return state


def test_step_is_the_same_to_the_bit_whatever_was_computed_before() -> None:
    plant, other = contact_plant(), contact_plant()
    middle = fallen(plant, 700)
    assert middle.contact.any()
    first = plant.step(middle, np.zeros(2), NOTHING, 0.0, H)
    plant.acceleration(fallen(plant, 3), np.ones(2), np.ones(2))
    plant.mass_matrix(plant.arm.neutral)
    again = plant.step(middle, np.zeros(2), NOTHING, 0.0, H)
    assert bits(again) == bits(first) == bits(other.step(middle, np.zeros(2), NOTHING, 0.0, H))
    assert bits(fallen(other, 701)) == bits(fallen(plant, 701))


def test_pickled_plant_makes_the_same_steps() -> None:
    plant = contact_plant()
    copy = pickle.loads(pickle.dumps(plant))
    assert (copy.limits, copy.scene, copy.tool_radius) == (True, plant.scene, 0.05)
    assert bits(fallen(copy, 700)) == bits(fallen(plant, 700))


class Killed(BaseException):
    """What ends a run in the middle."""


def two_link_run(kill_at: int | None = None, **more: Any) -> rbi.SimulationResult:
    arm = load("two_link")

    def on_tick(done: int, total: int) -> None:
        assert total == 300
        if done == kill_at:
            raise Killed

    controller = laws.controller(arm, 15.0, 40.0)
    plant = arm.with_payload(0.3)
    return rbi.simulate(
        controller,
        more.pop("plant", rbi.MujocoPlant(plant.with_friction(coulomb=0.2))),
        rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0),
        environment=rbi.interaction.Push([3.0, 0.0, 2.0, 0.0, 0.0, 0.0], 0.1, 0.1),
        q0=arm.neutral,
        duration=0.3,
        on_tick=on_tick,
        **more,
    )


@pytest.mark.slow
def test_killed_run_goes_on_from_its_checkpoint_to_the_same_bytes(tmp_path: Path) -> None:
    path, times = tmp_path / "run", iter(np.arange(1000.0))
    kept = rbi.Checkpoint(path, every=1.0, clock=lambda: float(next(times)))
    with pytest.raises(Killed):
        two_link_run(150, checkpoint=kept)
    resumed = two_link_run(checkpoint=rbi.Checkpoint(path, resume=True))
    whole = two_link_run()
    for channel in ("q", "v", "tau", "tau_ext", "e_im"):
        assert getattr(resumed, channel).tobytes() == getattr(whole, channel).tobytes()


@pytest.mark.slow
def test_controller_does_the_same_on_both_engines() -> None:
    arm = load("two_link").with_payload(0.3)
    ours, theirs = two_link_run(plant=arm), two_link_run(plant=rbi.MujocoPlant(arm))
    for name, figure in ours.metrics().items():
        np.testing.assert_allclose(theirs.metrics()[name], figure, rtol=1e-3, err_msg=name)


@pytest.mark.slow
def test_result_says_which_engine_moved_the_arm() -> None:
    arm = load("two_link")
    for plant in (rbi.MujocoPlant(arm), rbi.DrivenPlant(rbi.MujocoPlant(arm))):
        engine = two_link_run(plant=plant).provenance["engine"]
        engine = engine.get("links", engine)
        assert (engine["type"], engine["version"]) == ("MujocoPlant", version("mujoco"))


def test_diverging_run_ends_with_its_error_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arm = slider()
    wild = rbi.baselines.ComputedTorqueImpedance(arm, rbi.Impedance(1.0, 10.0, 20.0), 1e-3)
    with pytest.raises(rbi.DivergenceError, match="rail"):
        rbi.simulate(
            wild,
            rbi.MujocoPlant(arm, limits=False),
            rbi.trajectories.hold(arm),
            environment=Repelling(),
            duration=1.0,
        )
    assert list(tmp_path.iterdir()) == []


class Repelling:
    """Pushes the harder, the farther away the arm is."""

    def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
        del arm, t, v
        torque: Array = 1e9 * (q + 1e-3)
        return torque


# --- what is refused --------------------------------------------------------------------------------------------


def test_missing_mujoco_is_an_error_that_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(rbi.MissingExtraError, match=r'MujocoPlant .*pip install -e "\.\[mujoco\]"'):
        rbi.MujocoPlant(slider())


def test_arm_without_urdf_is_refused_with_the_way_out() -> None:
    bare = rbi.ArmModel(slider().model, name="bare", tool_frame="tip")
    with pytest.raises(rbi.ModelError, match=r"'bare' has no URDF.* load it from a file"):
        rbi.MujocoPlant(bare)


def test_mimicking_joint_is_refused_by_name_with_the_way_out() -> None:
    with pytest.raises(rbi.UnsupportedJointError, match=r"'follow': .* load with lock=") as refused:
        rbi.MujocoPlant(rbi.load_robot(mimic_urdf()))
    assert refused.value.joints == ("follow",)


SCENES = {
    '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>': "moving bodies",
    "<mujoco><option timestep='1'/></mujoco>": "<option> is not supported",
    "<mujoco><worldbody><geom/></worldbody></mujoco>": "MuJoCo does not read 'slider'",
    "<robot/>": "must be MJCF",
    "<mujoco>": "scene",
}


@pytest.mark.parametrize("scene", SCENES)
def test_scene_that_is_none_is_refused(scene: str) -> None:
    with pytest.raises(rbi.ModelError, match=SCENES[scene]):
        rbi.MujocoPlant(slider(), scene=scene, tool_radius=0.05)


@pytest.mark.parametrize(
    "given",
    [{"scene": FLOOR.format(z=0)}, {"tool_radius": 0.1}, {"scene": "<x/>", "tool_radius": -1.0}],
)
def test_scene_and_radius_are_given_together(given: dict[str, Any]) -> None:
    with pytest.raises(rbi.ParameterError, match="tool_radius"):
        rbi.MujocoPlant(slider(), **given)


def test_motion_that_begins_is_the_one_that_was_given() -> None:
    plant = rbi.MujocoPlant(load("kinova"))
    rng = np.random.default_rng(3)
    q, v = plant.arm.random_configuration(rng), rng.standard_normal(6)
    state = plant.begin(q, v, H)
    told: Motion = plant.measured(state)
    np.testing.assert_allclose(told.q, q, rtol=0.0, atol=1e-15)
    assert told.v.tolist() == v.tolist()


# --- its page ---------------------------------------------------------------------------------------------------


def test_tables_of_the_page_are_those_of_the_measured_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    page = (ROOT / "docs" / "engines.md").read_text("utf-8")
    figures = json.loads((ROOT / "docs" / "figures" / "engines.json").read_text("utf-8"))
    for name, table in (
        importlib.import_module("benchmarks.simulation.engines").tables(figures).items()
    ):
        assert f"<!-- {name} -->\n\n{table}\n\n<!-- end of {name} -->" in page
