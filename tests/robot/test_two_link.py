"""The paper's arm and section 4, against closed forms that know nothing of the package."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi

from ..oracles import two_link

Knowledge = Literal["inertia", "full"]
IN_PLANE = [0, 2]  # rows of the spatial Jacobian: velocity along x and z of the world


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


def test_urdf_equals_the_closed_form(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    for _ in range(1000):
        q, v = rng.uniform(-2.0 * np.pi, 2.0 * np.pi, 2), rng.uniform(-5.0, 5.0, 2)
        assert_allclose(arm.mass_matrix(q), two_link.mass_matrix(q), rtol=0.0, atol=1e-12)
        assert_allclose(arm.bias(q, v), two_link.bias(q, v), rtol=0.0, atol=1e-12)
        J = arm.jacobian(q)
        assert_allclose(J[IN_PLANE], two_link.jacobian(q), rtol=0.0, atol=1e-12)


def test_forward_dynamics_equals_the_closed_form(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(1000):
        q, v, tau = rng.uniform(-np.pi, np.pi, 2), rng.uniform(-5.0, 5.0, 2), rng.normal(0, 20, 2)
        a = two_link.forward_dynamics(q, v, tau)
        assert_allclose(arm.forward_dynamics(q, v, tau), a, rtol=1e-12, atol=1e-11)


def test_tip_force_becomes_the_joint_torque_of_the_closed_form(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(100):
        q, force = rng.uniform(-np.pi, np.pi, 2), rng.normal(0.0, 5.0, 2)
        wrench = np.array([force[0], 0.0, force[1], 0.0, 0.0, 0.0])
        tau_ext = arm.external_torque(q, wrench)
        assert_allclose(tau_ext, two_link.jacobian(q).T @ force, rtol=0.0, atol=1e-12)


def test_arm_says_what_the_paper_gives(arm: rbi.ArmModel) -> None:
    assert arm.joint_names == ("joint1", "joint2")
    assert arm.tool_frame == "tool"
    assert_allclose(arm.upper, 2.0 * np.pi)
    assert_allclose(arm.lower, -2.0 * np.pi)
    assert np.isposinf(arm.effort_limit).all()
    assert np.isposinf(arm.velocity_limit).all()


# Section 4, explicit scheme


@cache
def _paper(model: Knowledge, duration: float, step: float = 1e-3) -> rbi.SimulationResult:
    return rbi.scenarios.paper(known=model, dt=step, duration=duration, substeps=4).simulate()


@pytest.mark.parametrize("model", ["inertia", "full"])
def test_closed_loop_follows_the_closed_form_loop(model: Knowledge) -> None:
    result = _paper(model, duration=0.5)
    truth = two_link.closed_loop(model, duration=0.5, step=1e-3, substeps=4)
    assert_allclose(result.t, truth.t, rtol=0.0, atol=1e-12)
    assert_allclose(result.e1, truth.e1, rtol=0.0, atol=1e-9)
    assert_allclose(result.e2, truth.e2, rtol=0.0, atol=1e-9)
    assert_allclose(result.s, truth.s, rtol=0.0, atol=1e-9)
    assert_allclose(result.tau_ext, truth.tau_ext, rtol=0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["inertia", "full"])
def test_halving_the_step_halves_the_distance_to_the_fine_solution(model: Knowledge) -> None:
    fine_step, steps = 2e-5, np.array([4e-3, 2e-3, 1e-3])
    fine = two_link.closed_loop(model, duration=0.5, step=fine_step, substeps=1).e1
    errors = [
        np.abs(_paper(model, 0.5, step).e1 - fine[:: round(step / fine_step)]).max()
        for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("model", "figure"), [("inertia", 1.22e-2), ("full", 1.02e-2)])
def test_error_left_after_ten_seconds_is_the_known_figure(model: Knowledge, figure: float) -> None:
    result = _paper(model, duration=10.0)
    assert np.abs(result.e1[-1]).max() == pytest.approx(figure, rel=0.03)


def test_sampled_forward_euler_chatters() -> None:
    result = _paper("inertia", duration=10.0)
    last = result.tau[result.t >= 5.0, 0]
    variation = np.abs(np.diff(last)).sum() / 5.0
    assert variation == pytest.approx(101.0, rel=0.1)  # the motion itself needs 4.2 N·m/s
