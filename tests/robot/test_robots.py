"""`load_robot` against Pinocchio called directly, and what it refuses."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from example_robot_data.robots_loader import ROBOTS
from example_robot_data.utils import getModelPath
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.robot.loading.robot_sources import known_names

from ..arms import LIMIT, mimic_urdf, spinner_urdf, urdf, urdf_joint, urdf_link

Array = NDArray[np.float64]

CORPUS = Path(__file__).parents[3] / "shared" / "urdf_corpus"
FIXED_BASE = sorted(name for name, loader in ROBOTS.items() if not loader.free_flyer)
REFUSED = {
    "alex_psyonic_hands": "index_q1",  # mimics joints that are not there
    "bravo7_gripper": "bravo_finger1_joint",  # fingers without inertia
    "fanuc_m430ia2f_5dof.urdf": "joint_1",  # no inertia at all
}
FRICTION = '<dynamics damping="0.3" friction="0.1"/>'
MASSLESS = '<link name="{}"/>'


def example_urdf(name: str) -> Path:
    loader = ROBOTS[name]
    file = Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
    return Path(getModelPath(str(file)), file)


def same_dynamics(
    one: rbi.ArmModel, other: rbi.ArmModel, rng: np.random.Generator, atol: float = 1e-12
) -> None:
    assert one.joint_names == other.joint_names
    assert one.tool_frame == other.tool_frame
    for _ in range(5):
        q, v = one.random_configuration(rng), rng.normal(size=one.nv)
        assert_allclose(one.mass_matrix(q), other.mass_matrix(q), rtol=0.0, atol=atol)
        assert_allclose(one.bias(q, v), other.bias(q, v), rtol=0.0, atol=atol)
        assert_allclose(one.jacobian(q), other.jacobian(q), rtol=0.0, atol=atol)


# --- sources ----------------------------------------------------------------------------------------------------


def test_every_kind_of_source_gives_the_same_arm(tmp_path: Path, rng: np.random.Generator) -> None:
    text = spinner_urdf()
    path = tmp_path / "spinner.urdf"
    path.write_text(text)
    model = pin.buildModelFromXML(text)
    visual, collision = pin.GeometryModel(), pin.GeometryModel()
    sources: list[Any] = [
        path,
        str(path),
        f"\n  {text}",
        yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=False),
        model,
        pin.RobotWrapper(model, collision, visual),
    ]
    arm = rbi.load_robot(text)
    for source in sources:
        same_dynamics(rbi.load_robot(source), arm, rng)


def test_xacro_file_is_expanded(tmp_path: Path, rng: np.random.Generator) -> None:
    text = spinner_urdf()
    assert 'mass value="1.5"' in text
    xacro = text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    xacro = xacro.replace(">", '><xacro:property name="half" value="0.75"/>', 1)
    path = tmp_path / "spinner.urdf.xacro"
    path.write_text(xacro.replace('mass value="1.5"', 'mass value="${2*half}"'))
    same_dynamics(rbi.load_robot(path), rbi.load_robot(text), rng)


def test_model_given_by_the_user_is_not_changed() -> None:
    model = pin.buildModelFromXML(spinner_urdf())
    before = model.saveToString()
    rbi.load_robot(model, lock=("slide",), gravity=(0, 0, 0), armature=0.1)
    assert model.saveToString() == before


def test_bundled_robot_brings_its_gravity() -> None:
    assert_allclose(rbi.load_robot("two_link").model.gravity.linear, [0.0, 0.0, -9.8])
    assert_allclose(rbi.load_robot("ur5").model.gravity.linear, [0.0, 0.0, -9.81])


@pytest.mark.parametrize("name", ["ur5", "kinova", "talos_arm", "allegro_left_hand", "tiago"])
def test_example_robot_equals_what_pinocchio_reads_from_its_file(
    name: str, rng: np.random.Generator
) -> None:
    arm, model = rbi.load_robot(name), pin.buildModelFromUrdf(str(example_urdf(name)))
    assert arm.joint_names == tuple(model.names)[1:]
    data = model.createData()
    for _ in range(3):
        q, v = arm.random_configuration(rng), np.zeros(arm.nv)
        assert_allclose(arm.mass_matrix(q), pin.crba(model, data, q), rtol=0.0, atol=1e-12)
        gravity = pin.computeGeneralizedGravity(model, data, q)
        assert_allclose(arm.bias(q, v), gravity, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", FIXED_BASE)
def test_identities_hold_on_every_fixed_base_example_robot(
    name: str, rng: np.random.Generator
) -> None:
    if name in REFUSED:
        with pytest.raises(rbi.UnsupportedJointError, match=REFUSED[name]):
            rbi.load_robot(name)
    else:
        check_identities(rbi.load_robot(name), rng)


@pytest.mark.skipif(
    not CORPUS.is_dir(), reason="the corpus of URDF files is not beside the project"
)
@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.urdf")), ids=lambda path: path.name)
def test_identities_hold_on_every_file_of_the_corpus(path: Path, rng: np.random.Generator) -> None:
    if path.name in REFUSED:
        with pytest.raises(rbi.UnsupportedJointError, match=REFUSED[path.name]):
            rbi.load_robot(path)
        check_identities(rbi.load_robot(path, armature=0.1, massless=True), rng)
    else:
        check_identities(rbi.load_robot(path), rng)


def check_identities(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    """M a + bias = RNEA to 1e-10, ABA after RNEA is the identity to 1e-9, both relative."""
    for _ in range(3):
        q, v, a = arm.random_configuration(rng), rng.normal(size=arm.nv), rng.normal(size=arm.nv)
        tau = arm.inverse_dynamics(q, v, a)
        product = arm.mass_matrix(q) @ a + arm.bias(q, v)
        assert np.linalg.norm(product - tau) <= 1e-10 * np.linalg.norm(tau)
        back = arm.forward_dynamics(q, v, tau)
        assert np.linalg.norm(back - a) <= 1e-9 * np.linalg.norm(a)


def test_sdf_robot_is_refused_with_the_way_out() -> None:
    with pytest.raises(rbi.ModelError, match=r"'cassie' as SDF.*pinocchio\.Model"):
        rbi.load_robot("cassie")


def test_unknown_name_suggests_near_names() -> None:
    with pytest.raises(
        rbi.ModelError, match="no robot is called 'pandaa'; did you mean 'panda'"
    ) as e:
        rbi.load_robot("pandaa")
    assert "a path to a .urdf" in str(e.value)


def test_known_names_hold_bundled_and_example_robots() -> None:
    assert {"two_link", "panda", "ur5"} <= set(known_names())


def test_object_of_another_kind_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="cannot load a robot from a int; a source is a path"):
        rbi.load_robot(7)


# --- joints and locking -----------------------------------------------------------------------------------------


def test_locked_arm_is_the_full_arm_with_those_joints_held(rng: np.random.Generator) -> None:
    full = rbi.load_robot(spinner_urdf())
    arm = rbi.load_robot(spinner_urdf(), lock=("slide",), locked_configuration={"slide": 0.4})
    assert arm.joint_names == ("spin", "tilt")
    kept = [0, 2]
    for _ in range(5):
        q, v = arm.random_configuration(rng), rng.normal(size=2)
        full_q, full_v = np.array([*q[:2], 0.4, q[2]]), np.array([v[0], 0.0, v[1]])
        M = full.mass_matrix(full_q)[np.ix_(kept, kept)]
        assert_allclose(arm.mass_matrix(q), M, rtol=0.0, atol=1e-12)
        assert_allclose(arm.bias(q, v), full.bias(full_q, full_v)[kept], rtol=0.0, atol=1e-12)
        assert_allclose(arm.jacobian(q), full.jacobian(full_q)[:, kept], rtol=0.0, atol=1e-12)


def test_kept_joints_keep_limits_friction_and_armature() -> None:
    model = pin.buildModelFromXML(
        urdf(
            urdf_joint("one", "revolute", "base", "a", "0 1 0", LIMIT),
            urdf_link("a", 1.0),
            urdf_joint(
                "two",
                "revolute",
                "a",
                "b",
                "0 1 0",
                '<limit lower="-0.5" upper="0.7" effort="11" velocity="3"/>' + FRICTION,
            ),
            urdf_link("b", 1.0),
        )
    )
    model.armature = np.array([0.01, 0.02])
    arm = rbi.load_robot(model, lock=("one",))
    found = (arm.lower, arm.upper, arm.effort_limit, arm.velocity_limit)
    assert_allclose(np.concatenate(found), [-0.5, 0.7, 11.0, 3.0])
    assert_allclose(np.concatenate([arm.viscous, arm.coulomb, arm.armature]), [0.3, 0.1, 0.02])


def test_joints_and_lock_are_two_ways_to_say_the_same(rng: np.random.Generator) -> None:
    kept = rbi.load_robot("panda", joints=[f"panda_joint{i}" for i in (2, 4, 6)])
    locked = rbi.load_robot(
        "panda", lock=[*(f"panda_joint{i}" for i in (1, 3, 5, 7)), "panda_finger_joint1"]
    )
    same_dynamics(kept, locked, rng)


def test_joint_is_locked_inside_its_limits_by_default() -> None:
    limits = '<limit lower="0.3" upper="1" effort="1" velocity="1"/>'
    text = urdf(
        urdf_joint("one", "revolute", "base", "a", "0 1 0", limits),
        urdf_link("a", 1.0),
        urdf_joint("two", "revolute", "a", "b", "0 1 0", LIMIT),
        urdf_link("b", 1.0),
    )
    by_default = rbi.load_robot(text, lock="one").mass_matrix([0.2])
    at_limit = rbi.load_robot(text, lock="one", locked_configuration={"one": 0.3})
    assert_allclose(by_default, at_limit.mass_matrix([0.2]), rtol=0.0, atol=0.0)
    full_tool = rbi.load_robot(text).frame_placement([0.3, 0.2])[1]
    assert_allclose(at_limit.frame_placement([0.2])[1], full_tool, atol=1e-14)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"lock": "slid"}, "lock= names 'slid', which is no movable joint; did you mean 'slide'"),
        ({"joints": ["tlt"]}, "joints= names 'tlt'.*did you mean 'tilt'"),
        ({"joints": ["tool_joint"]}, "joints= names 'tool_joint', which is no movable joint"),
        ({"lock": ["spin", "slide", "tilt"]}, "no movable joint remains"),
        ({"joints": []}, "no movable joint remains"),
        ({"joints": ["spin"], "lock": ["spin"]}, "'spin' is both in joints= and in lock="),
        ({"locked_configuration": {"spin": 1.0}}, "'spin', which is not locked"),
        ({"lock": "spin", "locked_configuration": {"spin": np.nan}}, "'spin' takes one finite"),
        ({"tool_frame": "tol"}, "no frame 'tol'; did you mean 'tool'"),
    ],
)
def test_wrong_selection_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(rbi.ModelError, match=message):
        rbi.load_robot(spinner_urdf(), **arguments)


@pytest.mark.parametrize("name", ["hand", "carriage", "base"])
def test_joint_that_shares_its_name_with_a_link_can_be_locked(
    name: str, rng: np.random.Generator
) -> None:
    shared = rbi.load_robot(
        spinner_urdf().replace('joint name="tilt"', f'joint name="{name}"'), lock=name
    )
    same_dynamics(shared, rbi.load_robot(spinner_urdf(), lock="tilt"), rng)
    assert sorted(shared.frame_names) == sorted([*spinner_frames(without="tilt"), name])


def spinner_frames(without: str) -> list[str]:
    names = list(rbi.load_robot(spinner_urdf()).frame_names)
    names.remove(without)
    return names


@pytest.mark.parametrize(
    "arguments", [{"lock": "x"}, {"tool_frame": "x"}, {"joints": []}, {"locked_configuration": {"spin": 1.0}}]
)  # fmt: skip
def test_error_about_an_argument_names_the_file(arguments: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(spinner_urdf())
    with pytest.raises(rbi.ModelError, match=r"^'arm\.urdf': "):
        rbi.load_robot(path, **arguments)


def test_locking_a_fixed_joint_changes_nothing(rng: np.random.Generator) -> None:
    same_dynamics(
        rbi.load_robot(spinner_urdf(), lock="tool_joint"), rbi.load_robot(spinner_urdf()), rng
    )


# --- joints that cannot be controlled ---------------------------------------------------------------------------


def test_floating_example_robot_is_refused_and_loads_welded(rng: np.random.Generator) -> None:
    with pytest.raises(rbi.UnsupportedJointError, match=r'lock=\("root_joint",\)') as caught:
        rbi.load_robot("so100")
    assert caught.value.joints == ("root_joint",)
    welded = rbi.load_robot("so100", lock=("root_joint",))
    same_dynamics(welded, rbi.load_robot(example_urdf("so100")), rng)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_floating_and_planar_joints_are_refused_and_load_locked(kind: str) -> None:
    text = urdf(
        urdf_joint("loose", kind, "base", "a"),
        urdf_link("a", 1.0),
        urdf_joint("turn", "revolute", "a", "b", "0 1 0", LIMIT),
        urdf_link("b", 1.0),
    )
    with pytest.raises(rbi.UnsupportedJointError, match=r'lock=\("loose",\)') as caught:
        rbi.load_robot(text)
    assert caught.value.joints == ("loose",)
    assert rbi.load_robot(text, lock=("loose",)).joint_names == ("turn",)


@pytest.mark.parametrize(
    "joint",
    [
        pin.JointModelFreeFlyer(),
        pin.JointModelSpherical(),
        pin.JointModelTranslation(),
        pin.JointModelComposite(pin.JointModelRX()),
        pin.JointModelHX(0.1),
    ],
    ids=lambda joint: joint.shortname(),
)
def test_other_joints_of_a_model_are_refused_and_load_locked(joint: Any) -> None:
    model = pin.Model()
    first = model.addJoint(0, joint, pin.SE3.Identity(), "odd")
    second = model.addJoint(first, pin.JointModelRY(), pin.SE3.Identity(), "turn")
    for j in (first, second):
        model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.2), pin.SE3.Random())
    with pytest.raises(rbi.UnsupportedJointError, match=r'lock=\("odd",\)') as caught:
        rbi.load_robot(model)
    assert caught.value.joints == ("odd",)
    arm = rbi.load_robot(model, lock=("odd",))
    assert (arm.joint_names, arm.tool_frame) == (("turn",), "turn")


# --- mimicking joints -------------------------------------------------------------------------------------------


def chain(*joints: tuple[str, str, str], branch: bool = False) -> str:
    """A chain (or a star) of joints (name, kind, mimic) with a link of 1, 2, ... kg behind each."""
    elements, parent = [], "base"
    for i, (name, kind, mimic) in enumerate(joints, start=1):
        limit = "" if kind == "continuous" else LIMIT
        axis = "0 1 0" if i % 2 else "0.3 0.5 0.7"
        elements += [
            urdf_joint(name, kind, parent, f"link_{name}", axis, limit + FRICTION + mimic),
            urdf_link(f"link_{name}", float(i)),
        ]
        parent = "base" if branch else f"link_{name}"
    return urdf(*elements)


def follows(joint: str, multiplier: float = -1.5, offset: float = 0.3) -> str:
    return f'<mimic joint="{joint}" multiplier="{multiplier}" offset="{offset}"/>'


MIMICS = {
    "revolute": chain(("a", "revolute", ""), ("b", "revolute", follows("a"))),
    "with one between": chain(
        ("a", "revolute", ""), ("b", "revolute", ""), ("c", "revolute", follows("a"))
    ),
    "and one after": chain(
        ("a", "prismatic", ""), ("b", "prismatic", follows("a")), ("c", "revolute", "")
    ),
    "on another branch": chain(
        ("a", "prismatic", ""), ("b", "prismatic", follows("a")), ("c", "revolute", ""), branch=True
    ),
    "prismatic follows revolute": chain(("a", "revolute", ""), ("b", "prismatic", follows("a", 2))),
    "continuous": chain(("a", "continuous", ""), ("b", "continuous", follows("a", 2.0))),
    "mimic of a mimic": chain(
        ("a", "revolute", ""), ("b", "revolute", follows("a")), ("c", "revolute", follows("b", 0.5))
    ),
    "arms.mimic_urdf": mimic_urdf(),
}


@pytest.mark.parametrize("text", MIMICS.values(), ids=MIMICS.keys())
def test_mimicking_arm_is_the_free_arm_under_the_constraint(
    text: str, rng: np.random.Generator
) -> None:
    arm, free = rbi.load_robot(text), rbi.load_robot(pin.buildModelFromXML(text))
    lift, G = constraint(text, arm, free)
    assert arm.nv < free.nv
    for _ in range(4):
        q, v, a = arm.random_configuration(rng), rng.normal(size=arm.nv), rng.normal(size=arm.nv)
        full_q = lift(q)
        M = G.T @ free.mass_matrix(full_q) @ G
        assert_allclose(arm.mass_matrix(q), M, rtol=0.0, atol=1e-12)
        tau = G.T @ free.with_friction(coulomb=0.0).inverse_dynamics(full_q, G @ v, G @ a)
        without = arm.with_friction(coulomb=0.0)
        assert_allclose(without.inverse_dynamics(q, v, a), tau, rtol=0.0, atol=1e-11)
        assert_allclose(without.forward_dynamics(q, v, tau), a, rtol=0.0, atol=1e-9)
        J = free.jacobian(full_q, arm.tool_frame) @ G
        assert_allclose(arm.jacobian(q), J, rtol=0.0, atol=1e-12)
    assert_allclose(arm.coulomb, np.abs(G).T @ free.coulomb, rtol=0.0, atol=1e-15)


def constraint(
    text: str, arm: rbi.ArmModel, free: rbi.ArmModel
) -> tuple[Callable[[Array], Array], Array]:
    """The map q -> configuration of the free arm, and its derivative G, from the <mimic> elements."""
    robot = yourdfpy.URDF.load(
        io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False
    ).robot
    rules = {joint.name: joint.mimic for joint in robot.joints if joint.mimic is not None}

    def rule(name: str) -> tuple[int, float, float]:
        if name not in rules:
            return arm.joint_names.index(name), 1.0, 0.0
        i, k, o = rule(rules[name].joint)
        return i, rules[name].multiplier * k, rules[name].multiplier * o + rules[name].offset

    def lift(q: Array) -> Array:
        angles = arm.difference(pin.neutral(arm.model), q)
        step = np.array(
            [rule(name)[1] * angles[rule(name)[0]] + rule(name)[2] for name in free.joint_names]
        )
        return free.integrate(pin.neutral(free.model), step)

    G = np.zeros((free.nv, arm.nv))
    for j, name in enumerate(free.joint_names):
        i, G[j, i], _ = rule(name)
    return lift, G


def test_locked_primary_freezes_what_follows_it() -> None:
    text = chain(("a", "revolute", ""), ("b", "revolute", follows("a")), ("c", "revolute", ""))
    arm = rbi.load_robot(text, lock="a", locked_configuration={"a": 0.2})
    free = rbi.load_robot(pin.buildModelFromXML(text))
    assert arm.joint_names == ("c",)
    held = free.mass_matrix([0.2, -1.5 * 0.2 + 0.3, 0.7])[2:, 2:]
    assert_allclose(arm.mass_matrix([0.7]), held, rtol=0.0, atol=1e-13)


def test_mimicking_joint_can_be_frozen_alone() -> None:
    text = chain(("a", "revolute", ""), ("b", "revolute", follows("a")))
    free = rbi.load_robot(pin.buildModelFromXML(text))
    for given, position in (({}, 0.3), ({"b": -0.4}, -0.4)):
        arm = rbi.load_robot(text, lock="b", locked_configuration=given)
        held = free.mass_matrix([0.7, position])[:1, :1]
        assert_allclose(arm.mass_matrix([0.7]), held, rtol=0.0, atol=1e-13)


def test_keeping_a_joint_keeps_what_follows_it() -> None:
    arm = rbi.load_robot("panda", joints=["panda_joint1", "panda_finger_joint1"])
    assert arm.joint_names == ("panda_joint1", "panda_finger_joint1")
    assert len(arm.model.mimicking_joints) == 1
    with pytest.raises(rbi.ModelError, match="'panda_finger_joint2' follows 'panda_finger_joint1'"):
        rbi.load_robot("panda", joints=["panda_joint1", "panda_finger_joint2"])


def test_mimicking_joints_of_a_model_follow_their_locked_primary() -> None:
    text = chain(("a", "revolute", ""), ("b", "revolute", follows("a")), ("c", "revolute", ""))
    model = pin.buildModelFromXML(text, True)
    arm = rbi.load_robot(model, lock="a", locked_configuration={"a": 0.2})
    expected = rbi.load_robot(text, lock="a", locked_configuration={"a": 0.2})
    assert_allclose(arm.mass_matrix([0.7]), expected.mass_matrix([0.7]), rtol=0.0, atol=1e-13)
    with pytest.raises(rbi.ModelError, match="'b' follows 'a'; give that one's position"):
        rbi.load_robot(model, lock="b", locked_configuration={"b": 0.1})


@pytest.mark.parametrize(
    ("text", "names", "message"),
    [
        (
            chain(("a", "revolute", ""), ("b", "revolute", follows("aa"))),
            ("b",),
            "'b' mimics 'aa', which does not exist; did you mean 'a'",
        ),
        (
            chain(("a", "fixed", ""), ("b", "revolute", follows("a")), ("c", "revolute", "")),
            ("b",),
            r"'b' \(revolute\) mimics 'a' \(fixed\)",
        ),
        (
            chain(("a", "continuous", ""), ("b", "revolute", follows("a"))),
            ("b",),
            r"'b' \(revolute\) mimics 'a' \(continuous\)",
        ),
        (
            chain(("a", "revolute", follows("b")), ("b", "revolute", "")),
            ("a",),
            "'a' mimics 'b', which comes later",
        ),
        (
            chain(
                ("a", "revolute", follows("b")),
                ("b", "revolute", follows("a")),
                ("c", "revolute", ""),
            ),
            ("a", "b"),
            "in a circle",
        ),
        (
            chain(("a", "revolute", follows("a")), ("c", "revolute", "")),
            ("a",),
            "'a' mimics 'a' in a circle",
        ),
    ],
    ids=["missing", "fixed", "kind", "order", "circle", "itself"],
)
def test_mimic_that_cannot_be_modelled_is_refused_and_loads_locked(
    text: str, names: tuple[str, ...], message: str
) -> None:
    with pytest.raises(rbi.UnsupportedJointError, match=message) as caught:
        rbi.load_robot(text)
    assert caught.value.joints == names
    assert "lock=(" in str(caught.value)
    assert set(rbi.load_robot(text, lock=names).joint_names).isdisjoint(names)


# --- tool frame -------------------------------------------------------------------------------------------------


def test_tool_frame_is_the_link_behind_most_joints_fixed_ones_included() -> None:
    assert rbi.load_robot(spinner_urdf()).tool_frame == "tool"
    assert rbi.load_robot("ur5").tool_frame == "ee_link"


def test_more_movable_joints_break_a_tie_then_the_order_of_the_document() -> None:
    text = urdf(
        urdf_joint("j", "revolute", "base", "hub", "0 1 0", LIMIT),
        urdf_link("hub", 1.0),
        urdf_joint("f", "fixed", "hub", "welded"),
        '<link name="welded"/>',
        urdf_joint("z", "revolute", "hub", "zeta", "0 1 0", LIMIT),
        urdf_link("zeta", 1.0),
        urdf_joint("y", "revolute", "hub", "eta", "0 1 0", LIMIT),
        urdf_link("eta", 1.0),
    )
    assert rbi.load_robot(text).tool_frame == "zeta"
    assert rbi.load_robot(text, lock="z").tool_frame == "eta"
    assert rbi.load_robot(text, lock=["z", "y"]).tool_frame == "welded"


def test_tool_frame_is_a_link_that_moves() -> None:
    left_arm = [f"arm_left_{i}_joint" for i in range(1, 8)]
    assert "left" in rbi.load_robot("tiago_dual", joints=left_arm).tool_frame
    right_arm = [f"arm_right_{i}_joint" for i in range(1, 8)]
    assert "right" in rbi.load_robot("tiago_dual", joints=right_arm).tool_frame


def test_tool_frame_can_be_named() -> None:
    assert rbi.load_robot("panda", tool_frame="panda_hand_tcp").tool_frame == "panda_hand_tcp"


# --- inertia, limits, gravity, armature -------------------------------------------------------------------------


def hand_without_mass(mass: float = 0.0) -> str:
    return urdf(
        urdf_joint("good", "revolute", "base", "a", "0 1 0", LIMIT),
        urdf_link("a", 1.0),
        urdf_joint("bad", "revolute", "a", "b", "0 1 0", LIMIT),
        urdf_link("b", mass) if mass else MASSLESS.format("b"),
    )


@pytest.mark.parametrize("mass", [0.0, 1e-9])
@pytest.mark.parametrize("armature", [None, 0.1])
def test_joint_without_mass_is_refused_by_name_with_armature_too(
    mass: float, armature: float | None
) -> None:
    text = hand_without_mass(mass)
    words = r"have no mass.*lock=\(\"bad\",\).*massless=True.*armature="
    with pytest.raises(rbi.UnsupportedJointError, match=words) as caught:
        rbi.load_robot(text, armature=armature)
    assert caught.value.joints == ("bad",)
    assert rbi.load_robot(text, lock="bad").joint_names == ("good",)


def test_joint_without_mass_is_accepted_on_request_and_noted_first() -> None:
    arm = rbi.load_robot(hand_without_mass(), armature=[0.0, 0.2], massless=True)
    assert_allclose(arm.mass_matrix([0.1, 0.2])[1, 1], 0.2)
    assert arm.bias([0.1, 0.2], [0.0, 0.0])[1] == 0.0
    assert arm.notes[0].startswith("NO GRAVITY: the links that 'bad' move have no mass")
    assert arm.with_payload(1.0).notes == arm.notes


def test_body_without_mass_on_a_moving_link_is_noted_also_where_its_joint_is_frozen() -> None:
    shape = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    text = hand_without_mass().replace('<link name="b"/>', f'<link name="b">{shape}</link>')
    notes = rbi.load_robot(text, lock="bad").notes
    assert any("have a shape and no mass: 'b'" in note for note in notes)
    frames_only = rbi.load_robot(spinner_urdf()).notes  # `tool` has neither
    assert not any("no mass" in note for note in frames_only)


def test_model_of_pinocchio_without_mass_is_refused_although_it_has_armature() -> None:
    model = pin.buildModelFromXML(hand_without_mass())
    model.armature = np.array([0.1, 0.1])
    with pytest.raises(rbi.UnsupportedJointError, match=r"'bad'.*have no mass"):
        rbi.load_robot(model)


def test_leader_whose_follower_moves_mass_is_no_joint_without_mass() -> None:
    rule = '<mimic joint="lead" multiplier="2"/>'
    text = urdf(
        urdf_joint("lead", "revolute", "base", "a", "0 1 0", LIMIT),
        MASSLESS.format("a"),
        urdf_joint("with_it", "revolute", "base", "b", "0 1 0", LIMIT + rule),
        urdf_link("b", 1.0),
    )
    assert rbi.load_robot(text).joint_names == ("lead",)


def test_result_of_an_arm_without_mass_finds_its_robot_again(tmp_path: Path) -> None:
    path = tmp_path / "hand.urdf"
    path.write_text(hand_without_mass())
    arm = rbi.load_robot(path, armature=0.2, massless=True)
    assert arm.description is not None
    assert arm.description.recipe is not None
    recipe = dict(arm.description.recipe)
    again = rbi.load_robot(recipe.pop("source"), tool_frame=arm.tool_frame, **recipe)
    assert again.digest == arm.digest


def test_joint_that_is_frozen_while_its_leader_moves_is_noted() -> None:
    notes = rbi.load_robot(mimic_urdf(), lock=("follow",)).notes
    assert any("frozen by lock=" in note and "'follow'" in note for note in notes)
    assert not any("frozen by lock=" in note for note in rbi.load_robot(mimic_urdf()).notes)


def test_massless_link_between_heavy_ones_is_no_fault() -> None:
    text = urdf(
        urdf_joint("one", "revolute", "base", "a", "0 1 0", LIMIT),
        MASSLESS.format("a"),
        urdf_joint("two", "revolute", "a", "b", "1 0 0", LIMIT),
        urdf_link("b", 1.0),
    )
    assert rbi.load_robot(text).nv == 2


def test_two_joints_on_one_axis_without_mass_between_are_refused() -> None:
    def coaxial(name: str, parent: str, child: str) -> str:
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<axis xyz="0 0 1"/>{LIMIT}</joint>'
        )

    text = urdf(
        coaxial("one", "base", "a"),
        MASSLESS.format("a"),
        coaxial("two", "a", "b"),
        urdf_link("b", 1.0),
    )
    with pytest.raises(rbi.UnsupportedJointError, match="no usable inertia") as caught:
        rbi.load_robot(text)
    assert caught.value.joints == ("one", "two")


def test_model_with_negative_mass_is_refused() -> None:
    model = pin.buildModelFromXML(spinner_urdf())
    model.inertias[2] = pin.Inertia(-1.0, np.zeros(3), np.eye(3))
    with pytest.raises(rbi.ModelError, match="body of joint 'slide' has a negative mass"):
        rbi.load_robot(model)


def test_element_that_pinocchio_dropped_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    build = pin.buildModelFromXML

    def drops_an_inertial(text: str, *mimic: bool) -> pin.Model:
        model = build(text, *mimic)
        model.inertias[2] = pin.Inertia.Zero()
        return model

    monkeypatch.setattr(pin, "buildModelFromXML", drops_an_inertial)
    with pytest.raises(rbi.ModelError, match=r"joint 'slide' has a body of 1\.5 kg, but 0\.0 kg"):
        rbi.load_robot(spinner_urdf())


@pytest.mark.parametrize("shift", [(1e-5, 0.0), (0.0, 1e-5)])
def test_inertia_that_pinocchio_reads_differently_is_an_error(
    shift: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    build = pin.buildModelFromXML

    def misreads(text: str, *mimic: bool) -> pin.Model:
        model = build(text, *mimic)
        body = model.inertias[2]
        lever, inertia = body.lever + shift[0], body.inertia + shift[1] * np.eye(3)
        model.inertias[2] = pin.Inertia(body.mass, lever, inertia)
        return model

    monkeypatch.setattr(pin, "buildModelFromXML", misreads)
    with pytest.raises(rbi.ModelError, match="the body of joint 'slide' has a different inertia"):
        rbi.load_robot(spinner_urdf())


def test_limits_that_are_not_given_are_noted() -> None:
    arm = rbi.load_robot("two_link")
    assert np.isinf(arm.effort_limit).all()
    assert (
        "the effort limit is 0 or missing, taken as not given, at 'joint1', 'joint2'" in arm.notes
    )
    assert any(note.startswith("the velocity limit is 0") for note in arm.notes)
    assert not any("limit" in note for note in rbi.load_robot("ur5").notes)


def test_empty_position_range_is_noted() -> None:
    notes = rbi.load_robot("double_pendulum").notes
    assert "the lower position limit equals the upper one at 'joint1', 'joint2'" in notes


def test_rotors_that_a_robot_comes_with_are_noted() -> None:
    [note] = [note for note in rbi.load_robot("talos_arm").notes if "rotor" in note]
    assert note.endswith("armature=[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0]")


def test_given_gravity_wins_over_that_of_the_document() -> None:
    text = urdf(
        '<rbimpedance><gravity xyz="0 0 -1.62"/></rbimpedance>',
        urdf_joint("one", "revolute", "base", "a", "0 1 0", LIMIT),
        urdf_link("a", 1.0),
    )
    assert_allclose(rbi.load_robot(text).model.gravity.linear, [0, 0, -1.62])
    assert_allclose(rbi.load_robot(text, gravity=(1, 2, 3)).model.gravity.linear, [1, 2, 3])


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"gravity": (0, 0)}, rbi.DimensionError),
        ({"gravity": (0, 0, np.nan)}, rbi.NonFiniteError),
        ({"armature": -1.0}, rbi.ParameterError),
        ({"armature": [1.0, 2.0]}, rbi.DimensionError),
    ],
)
def test_wrong_gravity_and_armature_are_refused(
    arguments: dict[str, Any], error: type[rbi.RBImpedanceError]
) -> None:
    with pytest.raises(error):
        rbi.load_robot(spinner_urdf(), **arguments)


def test_armature_is_on_the_diagonal_of_the_mass_matrix() -> None:
    plain, geared = (
        rbi.load_robot(spinner_urdf()),
        rbi.load_robot(spinner_urdf(), armature=[1, 2, 3]),
    )
    q = plain.neutral
    assert_allclose(geared.mass_matrix(q) - plain.mass_matrix(q), np.diag([1, 2, 3]), atol=1e-15)


def test_friction_of_the_document_is_carried() -> None:
    arm = rbi.load_robot(chain(("a", "revolute", ""), ("b", "continuous", "")))
    assert_allclose([arm.viscous, arm.coulomb], [[0.3, 0.3], [0.1, 0.1]])


def test_loading_writes_nothing_to_standard_error(capfd: pytest.CaptureFixture[str]) -> None:
    rbi.load_robot(spinner_urdf())
    with pytest.raises(rbi.ModelError):
        rbi.load_robot(spinner_urdf('<link name="tool"/>'))
    assert capfd.readouterr() == ("", "")


def test_frames_of_locked_joints_have_their_parent_above_them() -> None:
    model = rbi.load_robot(spinner_urdf(), lock=("spin", "slide")).model
    assert all(frame.parentFrame < i for i, frame in enumerate(model.frames) if i > 0)


def test_meshes_that_are_not_there_matter_for_pictures_only(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    visual = (
        '<link name="extra"><visual><geometry><mesh filename="package://toy/hand.stl"/></geometry>'
        "</visual></link>"
    )
    text = spinner_urdf(urdf_joint("e", "fixed", "base", "extra"), visual)
    arm = rbi.load_robot(text)
    same_dynamics(arm, rbi.load_robot(spinner_urdf()), rng)
    [note] = [note for note in arm.notes if "mesh" in note]
    assert "package://toy/hand.stl" in note
    assert "package_dirs=" in note
    mesh = tmp_path / "toy" / "hand.stl"
    mesh.parent.mkdir()
    mesh.touch()
    assert (
        rbi.load_robot(text, package_dirs=[tmp_path]).notes == rbi.load_robot(spinner_urdf()).notes
    )


def test_inertia_of_a_real_file_that_is_not_quite_physical_can_be_scaled() -> None:
    arm = rbi.load_robot("icub_reduced", lock=("root_joint",))
    heavier = arm.with_scaled_inertia(1.5)
    np.testing.assert_allclose(
        heavier.mass_matrix(arm.neutral), 1.5 * arm.mass_matrix(arm.neutral), rtol=1e-9
    )
