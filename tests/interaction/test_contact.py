"""Walls and pushes, against Pinocchio's kinematics, closed forms of impact, and virtual work."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

import rbimpedance as rbi
from rbimpedance.interaction import (
    FrameInteraction,
    FrameWrench,
    Interaction,
    JointTorque,
    Push,
    Sum,
    Wall,
)

Array = NDArray[np.float64]
NORMAL = np.array([1.0, -2.0, 2.0]) / 3.0


def kinematics(arm: rbi.ArmModel, q: Array, v: Array, frame: str) -> tuple[Array, Array]:
    """Position and velocity of a frame's origin in the world, by Pinocchio alone."""
    model = arm.model
    data, frame_id = model.createData(), model.getFrameId(frame)
    pin.forwardKinematics(model, data, q, v)
    position = pin.updateFramePlacement(model, data, frame_id).translation
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.array(position), np.array(pin.getFrameVelocity(model, data, frame_id, axes).linear)


def slider(mass: float) -> rbi.ArmModel:
    """A mass on a rail along x and a rail along z, without gravity: q = (x, z)."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    along = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "along")
    up = model.addJoint(along, pin.JointModelPZ(), pin.SE3.Identity(), "up")
    inertia = pin.Inertia(mass, np.zeros(3), np.eye(3))
    model.appendBodyToJoint(up, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("mass", up, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return rbi.ArmModel(model, name="slider", tool_frame="mass")


@pytest.mark.parametrize("frame", ["tool", "carriage"])
def test_wall_pushes_with_spring_and_damper_along_its_normal(
    arm: rbi.ArmModel, q: Array, rng: np.random.Generator, frame: str
) -> None:
    v = rng.normal(size=3)
    position, velocity = kinematics(arm, q, v, frame)
    beside = np.cross(NORMAL, [0.3, 0.1, 0.7])  # the point of the plane does not matter
    wall = Wall(position + 0.04 * NORMAL + beside, 5.0 * NORMAL, 1000.0, 3.0, frame=frame)
    expected = 1000.0 * 0.04 - 3.0 * NORMAL @ velocity
    assert expected > 0.0
    assert wall.force(arm, 0.0, q, v) == pytest.approx(expected, rel=1e-12)
    ((name, wrench),) = wall.wrenches(arm, 0.0, q, v)
    assert name == frame
    assert_allclose(wrench, [*(expected * NORMAL), 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-12)


def test_wall_never_pulls_and_does_not_reach_out(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    leaving = touching = 0
    for _ in range(200):
        q, v = arm.random_configuration(rng), 3.0 * rng.normal(size=3)
        position, velocity = kinematics(arm, q, v, "tool")
        wall = Wall(rng.uniform(-0.5, 0.5, 3), NORMAL, 100.0, 50.0)
        depth = NORMAL @ (wall.point - position)
        spring_damper = 100.0 * depth - 50.0 * NORMAL @ velocity
        expected = max(0.0, spring_damper) if depth > 0.0 else 0.0
        force = wall.force(arm, 0.0, q, v)
        assert force == pytest.approx(expected, rel=1e-9, abs=1e-9)
        leaving += int(depth > 0.0 and force == 0.0)
        touching += int(force > 0.0)
    assert leaving > 10
    assert touching > 10


def test_torque_of_a_wall_does_the_work_of_its_force(
    arm: rbi.ArmModel, q: Array, rng: np.random.Generator
) -> None:
    v = rng.normal(size=3)
    position, velocity = kinematics(arm, q, v, "tool")
    wall = Wall(position + 0.1 * NORMAL, NORMAL, 500.0, 2.0)
    power = wall.torque(arm, 0.0, q, v) @ v
    assert power == pytest.approx(wall.force(arm, 0.0, q, v) * NORMAL @ velocity, rel=1e-12)
    assert abs(power) > 1e-3
    free = Wall(position - 0.1 * NORMAL, NORMAL, 500.0, 2.0)
    assert_array_equal(free.torque(arm, 0.0, q, v), np.zeros(3))


def test_moving_wall_is_a_still_one_seen_from_a_moving_arm() -> None:
    arm, start, speed = slider(2.0), 0.3, -0.7
    moving = Wall(np.zeros(3), [0, 0, 1], 800.0, 20.0, displacement=lambda t: start + speed * t)
    still = Wall(np.zeros(3), [0, 0, 1], 800.0, 20.0)
    t, z, v = 0.1, 0.15, 0.05
    force = moving.force(arm, t, [0.3, z], [-0.1, v])
    assert force > 0.0
    relative = still.force(arm, 0.0, [0.0, z - start - speed * t], [0.0, v - speed])
    assert force == pytest.approx(relative, rel=1e-8)
    assert moving.penetration(arm, t, [0.0, z]) == pytest.approx(start + speed * t - z)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5])
def test_mass_bounces_off_the_wall_as_the_closed_form_says(ratio: float) -> None:
    mass, stiffness, speed = 2.0, 1e4, 0.2
    arm, omega = slider(mass), np.sqrt(stiffness / mass)
    wall = Wall(np.zeros(3), [0, 0, 1], stiffness, 2.0 * ratio * np.sqrt(stiffness * mass))

    def rates(t: float, x: Array) -> Array:
        a = wall.torque(arm, t, x[:2], x[2:]) / mass
        return np.array([*x[2:], *a])

    # It leaves where spring and damper cancel, at zero acceleration.
    damped = np.sqrt(1.0 - ratio**2)
    leaves = np.arctan2(2.0 * ratio * damped, 2.0 * ratio**2 - 1.0) / (omega * damped)
    rebound = speed * np.exp(-ratio * omega * leaves)
    run = solve_ivp(rates, (0.0, 2.0 * leaves), [0.0, 0.0, 0.0, -speed], max_step=1e-4)
    assert run.y[3, -1] == pytest.approx(rebound, rel=1e-3)


def test_push_swells_and_fades_smoothly() -> None:
    push = Push([0, 0, 10, 0, 0, 0], 1.0, 0.8, 0.2)
    times = np.array([0.0, 1.0, 1.1, 1.2, 1.5, 1.6, 1.7, 1.8, 3.0])
    shares = [push.share(float(t)) for t in times]
    assert_allclose(shares, [0, 0, 0.5, 1, 1, 1, 0.5, 0, 0], atol=1e-12)
    fine = np.linspace(0.9, 1.9, 10_001)
    rate = np.gradient([push.share(float(t)) for t in fine], fine)
    assert np.abs(rate).max() == pytest.approx(np.pi / (2.0 * 0.2), rel=1e-4)
    assert np.abs(np.diff(rate)).max() < 0.02  # no jump of the rate


def test_whole_of_a_bell_shaped_push_is_half_of_force_times_duration() -> None:
    push = Push([0, 0, 10, 0, 0, 0], 0.5, 0.6)
    impulse, _ = quad(lambda t: 10.0 * float(push.share(t)), 0.5, 1.1)
    assert impulse == pytest.approx(10.0 * 0.6 / 2.0, rel=1e-9)


@pytest.mark.parametrize("expected_in", ["world", "local"])
def test_push_acts_as_a_wrench_of_its_size_at_that_time(
    arm: rbi.ArmModel, q: Array, expected_in: str
) -> None:
    wrench = np.array([1.0, -2.0, 3.0, 0.4, 0.5, -0.6])
    push = Push(wrench, 0.0, 1.0, frame="carriage", expressed_in=expected_in)
    whole = FrameWrench(push.share(0.3) * wrench, "carriage", expected_in)
    torque = push.torque(arm, 0.3, q, np.zeros(3))
    assert np.abs(torque).max() > 0.1
    assert_allclose(torque, whole.torque(arm, 0.3, q, np.zeros(3)), rtol=1e-13)


@pytest.mark.parametrize(
    "build",
    [
        lambda p: Wall(p + 0.05 * NORMAL, NORMAL, 300.0, 2.0),
        lambda p: Wall(p + 0.05 * NORMAL, NORMAL, 300.0, displacement=lambda t: 0.1 * t),
        lambda p: Push([1.0, -2.0, *p, 0.5], 0.0, 1.0, expressed_in="local"),
        lambda p: FrameWrench([1.0, *p, 0.4, 0.5], "carriage", "local"),
        lambda p: Sum(Wall(p + 0.05 * NORMAL, NORMAL, 300.0), Push([1, 2, 3, 4, 5, 6], 0.0, 1.0)),
    ],
    ids=["wall", "moving wall", "push", "wrench", "sum"],
)
def test_wrenches_that_are_shown_make_the_torque(
    arm: rbi.ArmModel,
    q: Array,
    rng: np.random.Generator,
    build: Callable[[Array], FrameInteraction],
) -> None:
    v = rng.normal(size=3)
    position, _ = kinematics(arm, q, v, "tool")
    interaction = build(position)
    assert isinstance(interaction, FrameInteraction)
    shown = interaction.wrenches(arm, 0.4, q, v)
    total = sum(arm.jacobian(q, frame).T @ wrench for frame, wrench in shown)
    torque = interaction.torque(arm, 0.4, q, v)
    assert np.abs(torque).max() > 0.1
    assert_allclose(total, torque, rtol=1e-12, atol=1e-12)


def test_torques_of_a_sum_add_up_and_what_has_no_frame_is_not_shown(
    arm: rbi.ArmModel, q: Array
) -> None:
    parts: tuple[Interaction, ...] = (JointTorque([1.0, 2.0, 3.0]), FrameWrench(np.ones(6)))
    total = Sum(*parts)
    expected = parts[0].torque(arm, 0.0, q, q) + parts[1].torque(arm, 0.0, q, q)
    assert_allclose(total.torque(arm, 0.0, q, q), expected, rtol=1e-14)
    assert [frame for frame, _ in total.wrenches(arm, 0.0, q, q)] == ["tool"]
    assert not isinstance(parts[0], FrameInteraction)
    assert_array_equal(Sum().torque(arm, 0.0, q, q), np.zeros(3))


@pytest.mark.parametrize(
    ("build", "error", "words"),
    [
        (lambda: Wall([0, 0], [0, 0, 1], 1.0), rbi.DimensionError, r"^point must be"),
        (lambda: Wall([0, 0, 0], [0, 0, 0], 1.0), rbi.ParameterError, r"^normal must be"),
        (lambda: Wall([0, 0, 0], [0, 0, np.nan], 1.0), rbi.NonFiniteError, r"^normal must be"),
        (lambda: Wall([0, 0, 0], [0, 0, 1], 0.0), rbi.ParameterError, r"^stiffness must be"),
        (lambda: Wall([0, 0, 0], [0, 0, 1], 1.0, -1.0), rbi.ParameterError, r"^damping must be"),
        (lambda: Wall([0, 0, 0], [0, 0, 1], 1.0, [1.0]), rbi.ParameterError, r"^damping .*single"),  # type: ignore[arg-type]
        (lambda: Push(np.ones(5), 0.0, 1.0), rbi.DimensionError, r"^wrench must be"),
        (lambda: Push(np.ones(6), 0.0, 0.0), rbi.ParameterError, r"^duration must be"),
        (lambda: Push(np.ones(6), 0.0, 1.0, 0.6), rbi.ParameterError, r"^rise must be .*0\.5 s"),
        (lambda: Push(np.ones(6), -1.0, 1.0), rbi.ParameterError, r"^start must be"),
        (
            lambda: Push(np.ones(6), 0.0, 1.0, expressed_in="tool"),
            rbi.ParameterError,
            r"^expressed_in must",
        ),
        (lambda: Sum(np.ones(6)), rbi.ParameterError, r"^parts\[0\] must be an Interaction"),  # type: ignore[arg-type]
    ],
)
def test_unusable_environment_is_refused_when_it_is_made(
    build: Callable[[], object], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        build()
