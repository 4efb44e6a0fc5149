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
from rbimpedance.tuning.tool_gains import BLOCKS, joint_motion

Q = np.array([0.0, -1.2, 1.6, -1.9, -1.57, 0.3])
UNKNOWN = rbi.Uncertainty(payload=2.0, inertia_scale=(0.9, 1.1))
FEW: Any = {"samples": 6, "instants": 5, "duration": 1.0}


@functools.cache
def ur5() -> rbi.ArmModel:
    return rbi.load_robot("ur5", armature=0.1)


def line() -> cartesian.CartesianTrajectory:
    start = rbi.Pose(*ur5().frame_placement(Q))
    return cartesian.line(start, [0.0, 0.1, 0.05], 1.0, rotation=[0.2, 0.0, 0.3])


@functools.cache
def proposal() -> rbi.CartesianGainProposal:
    return rbi.propose_cartesian_gains(ur5(), UNKNOWN, line(), 1e-3, q0=Q, **FEW)


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
    found = rbi.propose_cartesian_gains(
        arm, rbi.Uncertainty(payload=p), hold, 1e-3, q0=np.zeros(3), spread=still, **FEW
    )
    m, g = found.payload, 9.81
    weight = max((p - m) * g / (1.0 + p), m * g)
    floor = 0.5  # N on the joint that weighs 1 kg, the least that gains are made for
    assert_allclose(found.missed[0], max(weight, floor), rtol=1e-6)
    assert_allclose(found.k2[0], 3.0 * found.missed[0], rtol=1e-6)
    assert found.feasible


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
    noisy = rbi.propose_cartesian_gains(
        ur5(), UNKNOWN.but(velocity_noise=1e-3), line(), 1e-3, q0=Q, **FEW
    )
    assert noisy.feasible
    assert (noisy.k2[:2] < proposal().k2[:2]).all()
    assert (noisy.noise_error[:2] > 1e-6).all()
    assert not proposal().noise_error.any()


def test_friction_counts() -> None:
    rough = rbi.propose_cartesian_gains(ur5(), UNKNOWN.but(coulomb=2.0), line(), 1e-3, q0=Q, **FEW)
    assert (rough.missed[:2] > proposal().missed[:2]).all()
    assert rough.missed[1] > 2.0 * proposal().missed[1]


def test_a_long_delay_is_refused_with_the_joint() -> None:
    found = rbi.propose_cartesian_gains(ur5(), UNKNOWN.but(delay=40), line(), 1e-3, q0=Q, **FEW)
    assert not found.feasible
    assert any(f"joint '{name}'" in found.reason for name in ur5().joint_names)
    assert found.explain().startswith("No gains: ")
    with pytest.raises(rbi.ParameterError, match="delay of 40 ticks"):
        found.controller()


def test_an_accuracy_below_the_noise_is_refused_with_the_block() -> None:
    found = rbi.propose_cartesian_gains(
        ur5(), UNKNOWN.but(velocity_noise=1e-2), line(), 1e-3, q0=Q, accuracy=1e-6, **FEW
    )
    assert not found.feasible
    assert found.block in BLOCKS
    assert f"the '{found.block}'" in found.reason


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
