"""Gains for the law at the tool: against closed forms on a gantry, in simulation, and when there are none."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.law.damped_inverse import Damping
from rbimpedance.robot.tool_kinematics import ToolKinematics
from rbimpedance.trajectories import cartesian
from rbimpedance.tuning.tool_gains import joint_motion
from rbimpedance.tuning.tool_proposal import BLOCKS

Q = np.array([0.0, -1.2, 1.6, -1.9, -1.57, 0.3])
UNKNOWN = rbi.Uncertainty(payload=2.0, inertia_scale=(0.9, 1.1))
FEW: Any = {"samples": 6, "instants": 5, "duration": 0.7}
# too short for what is simulated: whoever takes it looks at the bounds alone
BOUNDS: Any = FEW | {"duration": 0.05}


@functools.cache
def ur5() -> rbi.ArmModel:
    return rbi.load_robot("ur5", armature=0.1)


def line() -> cartesian.CartesianTrajectory:
    start = rbi.Pose(*ur5().frame_placement(Q))
    return cartesian.line(start, [0.0, 0.1, 0.05], 1.0, rotation=[0.2, 0.0, 0.3])


@functools.cache
def proposal() -> rbi.CartesianGainProposal:
    return rbi.propose_gains(ur5(), UNKNOWN, line(), 1e-3, frame="ee_link", q0=Q, **FEW)


def bounds(uncertainty: rbi.Uncertainty, **options: Any) -> rbi.CartesianGainProposal:
    options = BOUNDS | options
    return rbi.propose_gains(ur5(), uncertainty, line(), 1e-3, frame="ee_link", q0=Q, **options)


def gantry() -> rbi.ArmModel:
    model, at = pin.Model(), 0
    for i, kind in enumerate((pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ())):
        at = model.addJoint(at, kind, pin.SE3.Identity(), f"slide{i}")
        body = pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3))
        model.appendBodyToJoint(at, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", at, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return rbi.ArmModel(model, name="gantry", tool_frame="tool")


def test_what_the_model_of_a_gantry_misses_is_the_weight_of_the_payload() -> None:
    """z moves 1 kg and the payload p, of which the model holds m: (p - m)·g/(1 + p), or m·g/1 without it."""
    arm, p = gantry(), 0.5
    hold = cartesian.hold(arm)
    still = rbi.MotionMargin(position=0.0, velocity=1e-9)
    found = rbi.propose_gains(
        arm,
        rbi.Uncertainty(payload=p),
        hold,
        1e-3,
        frame="tool",
        q0=np.zeros(3),
        spread=still,
        **BOUNDS,
    )
    m, g = found.payload, 9.81
    weight = max((p - m) * g / (1.0 + p), m * g)
    floor = 0.5  # N on the joint that weighs 1 kg, the least that gains are made for
    assert_allclose(found.missed[0], max(weight, floor), rtol=1e-6)
    assert_allclose(found.k2[0], 3.0 * found.missed[0], rtol=1e-6)


def test_joint_motion_follows_the_tool() -> None:
    arm = ur5()
    plan = joint_motion(arm, ToolKinematics(arm), line(), Q, 1.5, Damping())
    for t in (0.0, 0.3, 0.7, 1.4):
        assert_allclose(arm.frame_placement(plan(t).q)[1], line()(t).pose.translation, atol=2e-3)


def test_margin_is_the_one_of_the_joint_space() -> None:
    """The input gain at the tool is similar to that of the joints."""
    arm, found = ur5(), proposal()
    plan = joint_motion(arm, ToolKinematics(arm), line(), Q, 1.5, Damping())
    joints = rbi.propose_gains(arm, UNKNOWN, plan, 1e-3, q0=Q, **FEW)
    assert_allclose(found.margin, joints.margin[0], rtol=1e-9)
    assert_allclose(found.payload, joints.payload, rtol=1e-12)


def test_noise_lowers_the_gains_and_raises_the_error() -> None:
    quiet, noisy = bounds(UNKNOWN), bounds(UNKNOWN.but(velocity_noise=1e-3))
    assert (noisy.k2[:2] < quiet.k2[:2]).all()
    assert (noisy.noise_error[:2] > 1e-6).all()
    assert not quiet.noise_error.any()


def test_friction_counts() -> None:
    smooth, rough = bounds(UNKNOWN), bounds(UNKNOWN.but(coulomb=2.0))
    assert (rough.missed[:2] > smooth.missed[:2]).all()
    assert rough.missed[1] > 2.0 * smooth.missed[1]


def test_a_long_delay_is_refused_with_the_joint() -> None:
    found = bounds(UNKNOWN.but(delay=40))
    assert not found.feasible
    assert any(f"joint '{name}'" in found.reason for name in ur5().joint_names)
    assert found.explain().startswith("No gains: ")
    with pytest.raises(rbi.ParameterError, match="delay of 40 ticks"):
        found.controller()


def test_an_accuracy_below_the_noise_is_refused_with_the_block() -> None:
    found = bounds(UNKNOWN.but(velocity_noise=1e-2), accuracy=1e-6)
    assert not found.feasible
    assert found.block in BLOCKS
    assert f"the '{found.block}'" in found.reason
    assert not found.worst


def test_the_lightest_and_the_heaviest_plant_are_simulated() -> None:
    """Every case meets the accuracy that was demanded; the prediction by bounds is not exceeded."""
    cases = proposal().worst
    assert {0.0, 2.0} <= {case.sample.payload for case in cases}
    assert {0.9, 1.1} <= {float(case.sample.inertia_scale) for case in cases}
    for case in cases:
        assert not case.reason
        assert (case.error < [3e-4, 1e-3]).all()
    assert "in simulation of the worst plants" in proposal().explain()


def test_torque_limits_that_the_bounds_do_not_see_are_refused_by_simulation() -> None:
    found = bounds(UNKNOWN, duration=0.1, limits=20.0)
    assert not found.feasible
    assert "at their limits: " in found.reason
    assert found.worst[-1].result.saturated.any()
    assert np.abs(found.worst[-1].result.tau).max() <= 20.0


@pytest.mark.slow
def test_noise_and_delay_are_simulated_too() -> None:
    found = bounds(UNKNOWN.but(velocity_noise=3e-4, delay=1), duration=3.0)
    assert found.feasible, found.reason
    assert [case.noisy for case in found.worst] == sorted(case.noisy for case in found.worst)
    noisy = [case for case in found.worst if case.noisy]
    assert {0.0, 2.0} <= {case.sample.payload for case in noisy}
    for case in noisy:
        assert case.result.provenance["controller"]["delay"] == 1
        assert (case.error < 30.0 * found.noise_error[:2] + [3e-4, 1e-3]).all()


@pytest.mark.parametrize(
    "given", [{"surface": rbi.FastTerminalSurface()}, {"hardware": rbi.Hardware(delay=1)}]
)
def test_what_gains_at_the_tool_do_not_use_is_refused(given: dict[str, Any]) -> None:
    with pytest.raises(rbi.ParameterError, match="None with frame="):
        bounds(UNKNOWN, **given)


def test_a_frame_that_there_is_not_is_refused_with_a_near_name() -> None:
    with pytest.raises(rbi.ModelError, match="did you mean 'tool0'"):
        rbi.propose_gains(ur5(), UNKNOWN, line(), 1e-3, frame="tool_0")


def test_controller_has_the_gains_in_metres_and_radians() -> None:
    found = proposal()
    controller = found.controller(limits=150.0)
    assert_allclose(controller.reaching.k2, np.repeat(found.k2[:2], 3))
    assert_allclose(controller.reaching.k1, np.repeat(found.k1[:2], 3))
    assert controller.limits is not None
    assert controller.frame == found.frame == ur5().tool_frame
    assert "margin" in found.explain()


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_predicted_error_holds_in_simulation(payload: float) -> None:
    found, scale = proposal(), 1.1 if payload else 0.9
    plant = ur5().with_scaled_inertia(scale).with_payload(payload)
    run = rbi.simulate(found.controller(), plant, line(), q0=Q, duration=1.6, substeps=2)
    assert run.tool is not None
    late = run.t > 1.2
    assert np.abs(run.tool.e1[late, :3]).max() < found.error[0] + 1e-8
    assert np.abs(run.tool.e1[late, 3:]).max() < found.error[1] + 1e-8
