"""The energy tank, against energies that are added up outside of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.guards.energy_tank import EnergyTank, TankState
from rbimpedance.interaction.estimators import MomentumObserver
from rbimpedance.law.impedance import ImpedanceMatrices
from rbimpedance.trajectories import cosine, hold

from .. import laws

Array = NDArray[np.float64]
DT = 1e-3


def law(stiffness: Any = 20.0, damping: float = 2.0) -> rbi.ImpedanceController:
    arm = rbi.load_robot("two_link")
    return laws.controller(arm, 15.0, 50.0, dt=DT, impedance=rbi.Impedance(1.0, damping, stiffness))


class Scripted:
    """An observer that says what it is told to say."""

    def __init__(self, torques: Array) -> None:
        self.torques = torques

    def init(self) -> int:
        return 0

    def step(self, state: int, q: Any, v: Any, tau: Any, tau_ext: Any) -> tuple[Array, int]:
        del q, v, tau, tau_ext
        return self.torques[state], state + 1


def stored(matrices: ImpedanceMatrices, q_e: Array, v_e: Array) -> float:
    return float(v_e @ matrices.M_d @ v_e + q_e @ matrices.K_d @ q_e) / 2.0


def ticked(tank: EnergyTank, state: Any, told: Array, period: float | None = None) -> Any:
    arm = tank.arm
    reference = hold(arm)(0.0)
    return tank.step(state, arm.neutral, np.zeros(arm.nv), reference, told, period)


def slow(rng: np.random.Generator, ticks: int) -> Array:
    """Random torques of about 1 N·m that change within a tenth of a second, shape (ticks, 2)."""
    phase, t = rng.uniform(0.0, 2.0 * np.pi, size=(3, 2)), DT * np.arange(ticks)[:, None]
    rates = 2.0 * np.pi * np.array([1.0, 2.3, 4.1])
    return np.asarray(sum(np.sin(r * t + p) for r, p in zip(rates, phase, strict=True)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_port_gives_out_no_more_than_was_stored_at_the_start(seed: int) -> None:
    """Gains that jump at random and a told torque that has nothing to do with the real one. The work at the port, the
    energy of mass and spring, and the tank are added up here; what is stored never exceeds what came in."""
    rng = np.random.default_rng(seed)
    real = 4.0 * slow(rng, 600)
    tank = EnergyTank(law(), observer=Scripted(real), capacity=0.5)
    state, work, before = tank.init(), 0.0, np.zeros(2)
    for k in range(len(real)):
        if k % 7 == 0:
            wanted = rbi.Impedance(rng.uniform(0.5, 2.0), 2.0, rng.uniform(5.0, 100.0))
            tank = tank.with_impedance(wanted)
        told = -2.0 * real[k] if k % 50 < 25 else rng.normal(scale=10.0, size=2)
        _, state = ticked(tank, state, told)
        work += real[k] @ (state.inner.q_e - before)
        before = state.inner.q_e
        held = stored(state.matrices, state.inner.q_e, state.inner.v_e)
        assert state.energy >= -1e-12
        assert state.energy <= 0.5
        assert held + state.energy <= 0.25 + work + 1e-9
        assert state.port == pytest.approx(work, abs=1e-9)


def test_without_the_tank_the_same_torques_give_out_energy() -> None:
    """What the test above would find without a tank: the filter alone, told the opposite of what is real."""
    controller = law()
    state, work, arm = controller.init(), 0.0, controller.arm
    for torque in 4.0 * slow(np.random.default_rng(0), 600):
        before = state.q_e
        _, state = controller.step(state, arm.neutral, np.zeros(2), hold(arm)(0.0), -2.0 * torque)
        work += torque @ (state.q_e - before)
    assert work < -0.5


def test_tank_is_out_of_the_way_while_all_is_well() -> None:
    """Constant gains and a true torque: the torque is that of the controller alone, to the bit."""
    controller, tank = law(), EnergyTank(law())
    state, inner = tank.init(), controller.init()
    motion = cosine(controller.arm, amplitude=0.2, period=1.0)
    for k in range(200):
        (q, v, _), push = motion(k * DT + 0.01), np.array([3.0 * np.sin(0.1 * k), -1.0])
        output, state = tank.step(state, q, v, motion(k * DT), push)
        alone, inner = controller.step(inner, q, v, motion(k * DT), push)
        assert_array_equal(output.tau, alone.tau)


def stretched() -> tuple[EnergyTank, TankState]:
    """A spring of 20 N·m/rad that 4 N·m have stretched to 0.2 rad, and a tank with 0.3 J."""
    tank = EnergyTank(law(damping=20.0), capacity=5.0, start=0.3)
    state, q_e = tank.init(), np.array([0.2, 0.0])
    inner = state.inner._replace(ticks=1, q_e=q_e)
    return tank, state._replace(inner=inner, q_e=q_e)


def test_stiffening_goes_as_far_as_the_tank_pays() -> None:
    """½·ΔK·q_e² = 0.3 J at q_e = 0.2 rad: ΔK = 15 N·m/rad of the 80 that are wanted."""
    tank, state = stretched()
    _, after = ticked(
        tank.with_impedance(rbi.Impedance(1.0, 20.0, 100.0)), state, np.array([4.0, 0.0])
    )
    q_e = state.q_e[0]
    assert after.matrices.K_d[0, 0] == pytest.approx(20.0 + 2.0 * 0.3 / q_e**2, rel=1e-9)
    assert after.energy == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
def test_rest_of_a_change_follows_as_the_damper_fills_the_tank() -> None:
    tank, state = stretched()
    tank = tank.with_impedance(rbi.Impedance(1.0, 20.0, 100.0))
    stiffness = []
    for k in range(1500):  # the hand shakes: what it puts in, the damper takes
        push = np.array([4.0 + 30.0 * np.sin(4.0 * np.pi * k * DT), 0.0])
        _, state = ticked(tank, state, push)
        stiffness.append(state.matrices.K_d[0, 0])
    assert np.all(np.diff(stiffness) >= 0.0)
    assert stiffness[-1] == 100.0


def test_softening_is_free_and_fills_the_tank() -> None:
    """½·10·0.2² = 0.2 J are set free."""
    tank, state = stretched()
    _, after = ticked(
        tank.with_impedance(rbi.Impedance(1.0, 20.0, 10.0)), state, np.array([4.0, 0.0])
    )
    assert after.matrices.K_d[0, 0] == 10.0
    assert after.energy == pytest.approx(0.3 + 5.0 * state.q_e[0] ** 2, abs=1e-3)


@pytest.mark.slow
def test_sensor_of_the_wrong_sign_moves_the_arm_no_further_than_the_tank_pays() -> None:
    """Told -4 N·m where there are 4. Against them 0.05 J pay for 12.5 mm of joint travel at most, and what the damper
    takes in pays for less; the filter alone would go 0.2 rad the wrong way."""
    real = np.tile([4.0, 0.0], (1500, 1))
    tank = EnergyTank(law(damping=5.0), observer=Scripted(real), capacity=0.1, refill=0.0)
    state = tank.init()
    for torque in real:
        _, state = ticked(tank, state, -torque)
    assert -0.05 / 4.0 <= state.q_e[0] < 0.0
    rest = np.zeros(2)
    alone, _ = rbi.Impedance(1.0, 5.0, 20.0).filter(2, 1.5).advance(rest, rest, -real[0])
    assert alone[0] < -0.15


def test_late_ticks_are_counted() -> None:
    """The filter's steps over measured periods come into the same balance."""
    rng = np.random.default_rng(5)
    real = rng.normal(scale=5.0, size=(400, 2))
    tank = EnergyTank(law(), observer=Scripted(real), capacity=0.5)
    state, work = tank.init(), 0.0
    for torque in real:
        before = state.q_e
        _, state = ticked(tank, state, torque, DT * rng.uniform(0.5, 3.0))
        work += torque @ (state.q_e - before)
        held = stored(state.matrices, state.q_e, state.v_e)
        assert held + state.energy <= 0.25 + work + 1e-9


@pytest.mark.slow
def test_observer_hears_the_motors() -> None:
    """In a run with a momentum observer what the port took in is close to the work of the environment."""
    arm = rbi.load_robot("two_link")
    tank = EnergyTank(law(damping=10.0), observer=MomentumObserver(arm, 500.0, DT))
    state, q, v = tank.init(), np.array(arm.neutral), np.zeros(2)
    work, push = 0.0, np.array([3.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    for k in range(1000):
        torque = arm.external_torque(q, push)
        output, state = tank.step(state, q, v, hold(arm)(k * DT), torque)
        for _ in range(4):
            v = v + DT / 4.0 * arm.forward_dynamics(q, v, output.tau, torque)
            q = arm.integrate(q, DT / 4.0 * v)
            work += DT / 4.0 * float(torque @ v)
    assert state.port == pytest.approx(work, rel=0.02)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"capacity": 0.0}, "capacity"),
        ({"start": -0.1}, "start"),
        ({"capacity": 1.0, "start": 1.5}, "start"),
        ({"refill": 1.5}, "refill"),
        ({"refill": [0.5, 0.5]}, "refill"),
    ],
)
def test_tanks_that_cannot_be_are_refused(change: dict[str, Any], name: str) -> None:
    with pytest.raises(rbi.ParameterError, match=name):
        EnergyTank(law(), **change)


def test_target_without_matrices_is_refused() -> None:
    controller = law().with_impedance(rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, 0.5))
    with pytest.raises(rbi.ParameterError, match="an Impedance"):
        EnergyTank(controller)
