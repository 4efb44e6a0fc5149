"""The rules for contact, against the eigenvalues of the sampled loop and against contacts that were simulated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.linalg import expm

import rbimpedance as rbi
from rbimpedance.interaction import (
    Delay,
    NormalImpedance,
    Wall,
    contact_damping,
    critical_delay,
    impedance_for_wall,
    normal_impedance,
    recommended_mass,
    smallest_mass,
)
from rbimpedance.simulation.energy import energy_balance
from rbimpedance.trajectories import Reference

from ..arms import ARMS, manipulator

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def spectral_radius(target: NormalImpedance, wall: float, h: float, ticks: int) -> float:
    """Of the target at a period h whose wall force is `ticks` old: x⁺ = A x + b f, f = -wall·(position then)."""
    M, D, K = target
    system = np.array([[0.0, 1.0, 0.0], [-K / M, -D / M, 1.0 / M], [0.0, 0.0, 0.0]])
    step = expm(h * system)[:2]
    loop = np.zeros((2 + ticks, 2 + ticks))  # position, velocity, the forces of the last ticks
    loop[:2, :2], loop[:2, -1] = step[:, :2], step[:, 2]
    loop[2, :2] = -wall, 0.0
    loop[3:, 2:-1] = np.eye(ticks - 1)
    return float(np.abs(np.linalg.eigvals(loop)).max())


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0])
def test_damping_gives_mass_on_both_springs_its_ratio(ratio: float) -> None:
    M, K, wall = 1.7, 400.0, 9e3
    poles = np.roots([M, contact_damping(M, K, wall, ratio), K + wall])
    assert_allclose(poles.prod(), (K + wall) / M, rtol=1e-12)
    assert_allclose(-poles.sum().real / 2.0 / np.sqrt((K + wall) / M), ratio, rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.2, 0.7, 1.0, 1.5])
@pytest.mark.parametrize("stiffness", [1.0, 500.0, 6000.0])
def test_contact_turns_unstable_at_the_smallest_mass(ratio: float, stiffness: float) -> None:
    wall, ticks = 1e4, 100
    h = 5e-3 / (ticks + 0.5)  # a held force is half a period older
    verge = smallest_mass(wall, 5e-3, stiffness, ratio)

    def radius(mass: float) -> float:
        damping = contact_damping(mass, stiffness, wall, ratio)
        return spectral_radius(NormalImpedance(mass, damping, stiffness), wall, h, ticks)

    assert radius(0.97 * verge) > 1.0
    assert radius(1.03 * verge) < 1.0


def test_critical_delay_is_the_verge_for_any_damping() -> None:
    wall, ticks = 1e4, 100
    for target in (NormalImpedance(1.0, 60.0, 20.0), NormalImpedance(0.2, 200.0, 800.0)):
        h = critical_delay(target, wall) / (ticks + 0.5)
        assert spectral_radius(target, wall, 0.98 * h, ticks) < 1.0
        assert spectral_radius(target, wall, 1.02 * h, ticks) > 1.0


def test_wall_softer_than_a_well_damped_target_bears_any_delay() -> None:
    M, K, wall = 1.0, 2000.0, 1000.0
    target = NormalImpedance(M, contact_damping(M, K, wall, 0.5), K)
    assert critical_delay(target, wall) == np.inf
    assert spectral_radius(target, wall, 1e-3, 100) < 1.0


def test_smallest_mass_grows_with_the_square_of_the_delay() -> None:
    one, two = (smallest_mass(1e4, delay, 500.0) for delay in (2e-3, 4e-3))
    assert two == pytest.approx(4.0 * one, rel=1e-12)


def test_recommended_mass_bears_twice_the_delay_and_ten_periods_of_contact() -> None:
    assert recommended_mass(1e4, 500.0, 1e-3) == pytest.approx(1.0)  # 1e4·(10·1e-3)²
    mass = recommended_mass(1e4, 500.0, 1e-3, delay=20e-3)
    assert mass > 1.0
    assert smallest_mass(1e4, 2.0 * 23e-3, 500.0) == pytest.approx(mass, rel=1e-12)


@pytest.mark.parametrize("name", ["manipulator", "spinner"])
def test_frame_feels_what_was_asked_for_along_the_normal(
    name: str, rng: np.random.Generator
) -> None:
    arm = ARMS[name]()
    q, normal = arm.random_configuration(rng), rng.normal(size=3)
    impedance = impedance_for_wall(arm, q, normal, mass=1.5, stiffness=300.0, wall_stiffness=2e4)
    felt = normal_impedance(arm, q, impedance, 3.0 * normal)
    assert_allclose(felt, [1.5, contact_damping(1.5, 300.0, 2e4), 300.0], rtol=1e-10)


def press(
    ratio: float, sensor: Delay | None = None, mass: float = 1.0
) -> tuple[rbi.SimulationResult, rbi.ArmModel, Wall, Array]:
    """Meet a wall at 0.2 m/s and press on; the last array is the force of the target alone."""
    arm, q, dt = manipulator().with_friction(0.0, 0.0), np.full(6, 0.5), 1e-3
    wall = Wall(arm.frame_placement(q)[1], UP, 1e4)
    impedance = impedance_for_wall(
        arm, q, UP, mass=mass, stiffness=500.0, wall_stiffness=1e4, damping_ratio=ratio
    )
    down = np.linalg.pinv(arm.jacobian(q)[:3]) @ -UP

    def trajectory(t: float) -> Reference:
        late = min(max(t - 0.1, 0.0), 0.15)  # braking, to rest 0.015 m beyond the wall
        x = 0.2 * (min(t, 0.1) - 0.1) + 0.2 * late * (1.0 - late / 0.3)
        speed, slowing = 0.2 * (1.0 - late / 0.15), -0.2 / 0.15 if 0.0 < late < 0.15 else 0.0
        return Reference(arm.integrate(q, x * down), speed * down, slowing * down)

    surface = rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6)
    controller = rbi.ImpedanceController(arm, impedance, surface, rbi.SuperTwisting(15.0, 50.0), dt)
    start = trajectory(0.0)
    result = rbi.simulate(
        controller,
        arm,
        trajectory,
        environment=wall,
        sensor=sensor,
        q0=start.q,
        v0=start.v,
        duration=0.8,
        substeps=2,
        integrator="rk4",
    )
    target, q_e, v_e = impedance.filter(6, dt / 10.0), np.zeros(6), np.zeros(6)
    alone = np.empty(len(result.t))
    for k in range(10 * len(alone)):
        t = k * dt / 10.0
        desired = trajectory(t)
        q_t, v_t = arm.integrate(desired.q, q_e), desired.v + v_e
        if k % 10 == 0:
            alone[k // 10] = wall.force(arm, t, q_t, v_t)
        q_e, v_e = target.advance(q_e, v_e, wall.torque(arm, t, q_t, v_t))
    return result, arm, wall, alone


def contact_forces(result: rbi.SimulationResult, arm: rbi.ArmModel, wall: Wall) -> Array:
    return np.array(
        [wall.force(arm, t, q, v) for t, q, v in zip(result.t, result.q, result.v, strict=True)]
    )


def touches(force: Array) -> int:
    return int(np.count_nonzero(np.diff((force > 0.0).astype(int), prepend=0) == 1))


@pytest.mark.slow
def test_contact_by_the_rule_is_that_of_the_target_alone() -> None:
    result, arm, wall, alone = press(1.0)
    force = contact_forces(result, arm, wall)
    assert touches(force) == touches(alone) == 1
    assert force.max() == pytest.approx(alone.max(), rel=0.05)
    assert force[-1] == pytest.approx(alone[-1], rel=0.05)
    assert force[-1] == pytest.approx(0.015 * 500.0 * 1e4 / 10500.0, rel=0.05)
    assert np.abs(force - alone).max() < 0.05 * alone.max()
    energy = energy_balance(result, arm)
    assert np.abs(energy.residual).max() < 0.01 * np.ptp(energy.environment)


@pytest.mark.slow
def test_readings_that_are_too_old_make_contact_bounce_without_end() -> None:
    mass, ticks = 0.2, 10
    assert mass < smallest_mass(1e4, ticks * 1e-3, 500.0, 0.3)
    result, arm, wall, _ = press(0.3, Delay(ticks), mass)
    assert touches(contact_forces(result, arm, wall)) > 3


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda _: contact_damping(0.0, 1.0, 1.0), r"^mass must be"),
        (lambda _: critical_delay(NormalImpedance(1.0, 0.0, 1.0), 1.0), r"^damping must be"),
        (lambda _: smallest_mass(1e3, 1e-3, 2e3), r"^stiffness must be less than the wall's"),
        (lambda _: recommended_mass(1e3, 1.0, 1e-3, delay=-1.0), r"^delay must be"),
        (
            lambda arm: impedance_for_wall(
                arm, arm.neutral, [0, 0, 0], mass=1, stiffness=1, wall_stiffness=1
            ),
            r"^normal must be a direction in which",
        ),
    ],
)
def test_unusable_request_is_refused(call: Callable[[rbi.ArmModel], object], words: str) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        call(manipulator())
