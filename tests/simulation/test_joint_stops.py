"""Stops at the position limits: they hold a joint, take energy and give none, and say what they did."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.simulation.joint_stops import JointStops
from rbimpedance.trajectories import hold

from .. import arms, laws


class Idle:
    """A controller that gives a constant torque."""

    def __init__(self, arm: rbi.ArmModel, torque: float = 0.0, dt: float = 1e-3) -> None:
        self.arm, self.dt, self.torque = arm, dt, np.full(arm.nv, torque)
        self._inner = laws.controller(arm, dt=dt)

    def init(self) -> Any:
        return self._inner.init()

    def step(self, state: Any, *inputs: Any) -> Any:
        output, state = self._inner.step(state, *inputs)
        return output._replace(tau=self.torque.copy()), state

    def impedance_error(self, output: Any, a: Array) -> Array:
        return self._inner.impedance_error(output, a)


def swinging() -> rbi.ArmModel:
    """A pendulum of 2 kg on 0.5 m, between -1 and 0.5 rad."""
    model = arms.pendulum().model
    model.lowerPositionLimit, model.upperPositionLimit = np.array([-1.0]), np.array([0.5])
    return rbi.ArmModel(model, name="pendulum", tool_frame="bob")


def energy(arm: rbi.ArmModel, run: rbi.SimulationResult) -> Array:
    """Kinetic and potential energy of the pendulum, and of the spring on the stop [J]."""
    stops = JointStops.at_limits(arm, 2.5e-4)
    q, v = run.q[:, 0], run.v[:, 0]
    depth = np.maximum(np.maximum(q - 0.5, -1.0 - q), 0.0)
    spring = stops.stiffness[0] * depth**2 / 2.0
    return np.asarray(0.25 * v**2 + 9.81 * (1.0 - np.cos(q)) + spring)


@pytest.mark.slow
def test_joint_bounces_on_its_stops_and_never_gains_energy() -> None:
    arm = swinging()
    run = rbi.simulate(
        Idle(arm), arm, hold(arm), q0=[0.0], v0=[4.0], duration=4.0, joint_stops=True
    )
    assert run.q.max() < 0.5 + 0.015
    assert run.q.min() > -1.0 - 0.015
    total = energy(arm, run)
    assert np.diff(total).max() < 2e-3 * total[0]
    assert total[-1] < 1.02 * 9.81 * (1.0 - np.cos(0.5))  # too little to reach a stop again
    free = rbi.simulate(Idle(arm), arm, hold(arm), q0=[0.0], v0=[4.0], duration=0.4)
    assert free.q.max() > 0.6
    assert not free.tau_stop.any()


@pytest.mark.slow
def test_impact_goes_as_deep_as_a_damped_spring_says() -> None:
    """A mass that meets a spring at speed v goes v/ω·exp(-ζ/√(1-ζ²)·arccos ζ) deep."""
    arm = swinging()
    arm = arm.with_gravity([0.0, 0.0, 0.0])
    run = rbi.simulate(
        Idle(arm, dt=1e-4), arm, hold(arm), q0=[0.45], v0=[1.0], duration=0.1, joint_stops=True
    )
    depth = np.exp(-0.5 / np.sqrt(0.75) * np.arccos(0.5)) / 500.0
    assert run.q.max() - 0.5 == pytest.approx(depth, rel=0.02)
    assert run.v[-1, 0] < -0.1  # it comes back, slower
    assert run.v[-1, 0] > -0.5


@pytest.mark.slow
def test_stop_holds_against_a_motor() -> None:
    arm = swinging()
    run = rbi.simulate(
        Idle(arm, torque=60.0), arm, hold(arm), q0=[0.0], duration=2.0, joint_stops=True
    )
    weight = 9.81 * np.sin(run.q[-1])
    assert_allclose(run.tau_stop[-1], weight - 60.0, rtol=1e-3)
    assert_allclose(run.v[-1], 0.0, atol=1e-6)


def test_stops_push_back_and_never_pull() -> None:
    arm = arms.manipulator()
    stops, rng = JointStops.at_limits(arm, 1e-3), np.random.default_rng(2)
    lower, upper = arm.joint_limits()
    for _ in range(200):
        x, v = rng.uniform(lower - 0.1, upper + 0.1), rng.normal(size=6)
        torque = stops.torque(arm, 0.0, x, v)
        assert (torque[(lower <= x) & (x <= upper)] == 0.0).all()
        assert (torque[x > upper] <= 0.0).all()
        assert (torque[x < lower] >= 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["semi-implicit", "rk4"])
@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("name", ["panda", "ur5", "kinova"])
def test_every_joint_thrown_at_its_stop_comes_to_rest_inside(
    name: str, substeps: int, integrator: Any
) -> None:
    """All joints at once, with the damping of real gears: the step stays stable on stiff stops."""
    arm = rbi.load_robot(name, armature=0.05).with_friction(viscous=5.0)
    lower, upper = arm.joint_limits()
    bounded = np.isfinite(upper)
    x = np.where(bounded, upper - 0.01 * np.where(bounded, upper - lower, 0.0), 0.0)
    q0 = arm.integrate(arm.zero, x)
    run = rbi.simulate(
        Idle(arm), arm, hold(arm), q0=q0, v0=np.where(bounded, 1.0, 0.0), duration=0.5,
        substeps=substeps, integrator=integrator, joint_stops=True,
    )  # fmt: skip
    assert run.excess().position.max() < 0.02
    assert np.abs(run.v).max() < 10.0
    assert np.abs(run.tau_stop).max() > 0.0


@pytest.mark.slow
def test_stops_are_no_environment() -> None:
    """The controller is not told, tau_ext is without them, and the energy balance has them apart."""
    arm = swinging()
    run = rbi.simulate(
        Idle(arm, dt=2.5e-4), arm, hold(arm), q0=[0.0], v0=[4.0], duration=1.0, joint_stops=True
    )
    assert np.abs(run.tau_stop).max() > 100.0
    assert not run.tau_ext.any()
    assert not run.wrench.any()
    balance = rbi.energy_balance(run, arm)
    assert balance.stops[-1] < -2.0
    assert np.abs(balance.residual).max() < 0.02 * balance.kinetic[0]


def test_run_with_stops_that_nothing_touches_is_the_run_without() -> None:
    arm = rbi.load_robot("two_link")
    inner = Idle(arm)._inner
    runs = [
        rbi.simulate(
            inner, arm, hold(arm, [0.3, 0.2]), q0=[0.0, 0.0], duration=0.2, joint_stops=stops
        )
        for stops in (False, True)
    ]
    assert_allclose(runs[0].q, runs[1].q, atol=1e-9)


def test_stops_of_ones_own_and_wrong_ones() -> None:
    arm = swinging()
    soft = JointStops(np.array([-0.1]), np.array([0.1]), np.array([500.0]), np.array([20.0]))
    run = rbi.simulate(
        Idle(arm), arm, hold(arm), q0=[0.0], v0=[1.0], duration=0.5, joint_stops=soft
    )
    assert 0.1 < run.q.max() < 0.2
    with pytest.raises(rbi.ParameterError, match=r"^joint_stops must be True, False"):
        rbi.simulate(
            Idle(arm),
            arm,
            hold(arm),
            duration=0.5,
            joint_stops="yes",  # type: ignore[arg-type]
        )


def test_continuous_joint_has_no_stop() -> None:
    arm = arms.spinner()
    stops = JointStops.at_limits(arm, 1e-3)
    q = pin.integrate(arm.model, arm.zero, np.array([3.1, 0.0, 0.0]))
    assert_array_equal(stops.torque(arm, 0.0, q, np.ones(3)), np.zeros(3))
