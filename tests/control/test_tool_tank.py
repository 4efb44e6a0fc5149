"""The energy tank at the tool: its port is the tool's displacement, counted here from the poses of x_r."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi

from .test_cartesian import TURNED, motion, panda
from .test_energy_tank import Scripted, slow, stored

Array = NDArray[np.float64]
DT = 1e-3
Q = np.array([0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8])
MASS, SPRING, DAMPING = (3.0, 0.15), (200.0, 20.0), (20.0, 2.0)


def target(stiffness: float = 200.0, mass: float = 3.0) -> rbi.CartesianImpedance:
    return rbi.CartesianImpedance((mass, 0.15), (stiffness, 20.0), DAMPING, axes=TURNED)


def law() -> rbi.CartesianController:
    return rbi.CartesianController(panda(), target(), dt=DT, backend="numpy")


def torque(arm: rbi.ArmModel, force: Array) -> Array:
    return np.asarray(arm.jacobian(Q)[:3].T @ force)


def ticked(tank: rbi.EnergyTank, state: Any, force: Array) -> Any:
    arm: Any = tank.arm
    there: Any = rbi.CartesianReference(rbi.Pose(*arm.frame_placement(Q)), np.zeros(6), np.zeros(6))
    return tank.step(state, Q, np.zeros(7), there, torque(arm, force))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_port_gives_out_no_more_than_was_stored_at_the_start(seed: int) -> None:
    """Gains that jump at random and a told force that has nothing to do with the real one. The work of the real force
    on x_r is added up from its poses; with what is stored and the tank it never exceeds what came in."""
    rng = np.random.default_rng(seed)
    real = 20.0 * np.hstack([slow(rng, 300), slow(rng, 300)])[:, :3]
    controller = law()
    observer = Scripted(np.array([torque(controller.arm, f) for f in real]))
    tank = rbi.EnergyTank(controller, observer=observer, capacity=0.5)
    state, work, before, total = tank.init(), 0.0, None, 0.25
    held, energy = 0.0, total
    for k, f in enumerate(real):
        if k % 25 == 0:
            tank = tank.with_impedance(target(rng.uniform(50.0, 800.0), rng.uniform(2.0, 6.0)))
        told = -2.0 * f if k % 50 < 25 else rng.normal(scale=40.0, size=3)
        output, state = ticked(tank, state, told)
        now = output.at_tool.reference.pose.translation
        if before is not None:
            work += real[k - 1] @ (now - before)
            assert held + energy <= total + work + 1e-9
        before, energy = now, state.energy
        held = stored(state.matrices, *state.inner.displacement)
        assert -1e-12 <= state.energy <= 0.5
    assert abs(work) > 0.05


@pytest.mark.slow
def test_without_the_tank_the_same_torques_give_out_energy() -> None:
    controller: Any = law()
    state, work, before = controller.init(), 0.0, None
    there = rbi.CartesianReference(
        rbi.Pose(*controller.arm.frame_placement(Q)), np.zeros(6), np.zeros(6)
    )
    for f in 20.0 * np.hstack([slow(np.random.default_rng(0), 300)] * 2)[:, :3]:
        output, state = controller.step(state, Q, np.zeros(7), there, np.r_[-2.0 * f, 0, 0, 0])
        now = output.reference.pose.translation
        work += 0.0 if before is None else f @ (now - before)
        before = now
    assert work < -0.5


def test_tank_is_out_of_the_way_while_all_is_well() -> None:
    """Constant gains and a true torque: the torque is that of the controller alone."""
    controller: Any = law()
    tank: Any = rbi.EnergyTank(controller)
    state, inner = tank.init(), controller.init()
    for k in range(30):
        push = torque(controller.arm, np.array([3.0 * np.sin(0.1 * k), -1.0, 2.0]))
        there = motion(controller.arm, Q, k * DT)
        output, state = tank.step(state, Q, np.zeros(7), there, push)
        wrench = controller.wrench_from_torque(Q, push)
        alone, inner = controller.step(inner, Q, np.zeros(7), there, wrench, push)
        assert_array_equal(output.tau, alone.tau)


def test_stiffening_goes_as_far_as_the_tank_pays() -> None:
    """½·ΔK·x² = 0.3 J at x = 5 cm: ΔK = 240 N/m of the 800 that are wanted."""
    tank = rbi.EnergyTank(law(), capacity=5.0, start=0.3)
    state, xi = tank.init(), np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])
    there = state.inner.displacement._replace(xi=xi)
    state = state._replace(inner=state.inner._replace(displacement=there), q_e=xi)
    _, after = ticked(tank.with_impedance(target(1000.0)), state, TURNED @ np.array([10.0, 0, 0]))
    assert_allclose(after.matrices.K_d[0, 0], 200.0 + 2.0 * 0.3 / 0.05**2, rtol=1e-9)
    assert after.energy < 0.01


def test_target_with_other_axes_is_refused() -> None:
    tank = rbi.EnergyTank(law())
    with pytest.raises(rbi.ParameterError, match="same kind and axes"):
        tank.with_impedance(rbi.CartesianImpedance(MASS, SPRING))
    with pytest.raises(rbi.ParameterError, match="same kind and axes"):
        tank.with_impedance(rbi.Impedance(1.0, 10.0, 20.0))
