"""Dry friction that sticks, held to closed forms of one joint and to energy."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.interaction.wrenches import Nothing
from rbimpedance.simulation.plants.dry_friction import rub
from rbimpedance.simulation.plants.protocol import Motion
from rbimpedance.simulation.plants.sticking import StickingPlant

from ..arms import manipulator, pendulum

H, INERTIA, FREE = 2.5e-4, 0.5, Nothing()


def flywheel(coulomb: float, viscous: float = 0.0, stribeck: float = 0.0) -> StickingPlant:
    """One link of 0.5 kg·m² without gravity."""
    return StickingPlant(
        pendulum().with_gravity(np.zeros(3)).with_friction(viscous, coulomb), stribeck
    )


def moved(plant: StickingPlant, v: float, tau: float, time: float) -> Motion:
    state = plant.begin(plant.arm.neutral, np.array([v]), H)
    for i in range(round(time / H)):
        state = plant.step(state, np.array([tau]), FREE, i * H, H)
    return state


def test_joint_stays_where_it_is_below_the_breakaway_torque_and_leaves_above() -> None:
    plant = flywheel(2.0, stribeck=0.5)
    rested = moved(plant, 0.0, 2.9, 1.0)
    assert rested.q == plant.arm.neutral
    assert rested.v == [0.0]
    assert moved(plant, 0.0, 3.1, 1.0).v[0] > 0.2


def test_coulomb_friction_stops_a_flywheel_at_the_time_and_place_of_the_closed_form() -> None:
    """v²·J/(2·tau_c) of travel, J·v/tau_c of time."""
    plant, v = flywheel(2.0), 1.0
    stop = INERTIA * v / 2.0
    assert moved(plant, v, 0.0, 0.5 * stop).v == pytest.approx(0.5, abs=1e-3)
    end = moved(plant, v, 0.0, 2.0 * stop)
    assert end.v == [0.0]
    assert end.q - plant.arm.neutral == pytest.approx(INERTIA * v * v / 4.0, abs=1e-3)


def test_viscous_friction_lets_the_speed_decay_exponentially() -> None:
    assert moved(flywheel(0.0, viscous=1.5), 1.0, 0.0, 0.3).v == pytest.approx(
        np.exp(-1.5 / INERTIA * 0.3), rel=1e-3
    )


def test_impulses_obey_coulombs_law_on_every_joint_at_once() -> None:
    arm, rng = manipulator(), np.random.default_rng(3)
    for _ in range(20):
        A = np.asarray(np.linalg.inv(arm.mass_matrix(arm.random_configuration(rng))), dtype=float)
        free, dry = rng.normal(size=arm.nv), rng.uniform(0.0, 0.1, arm.nv)
        v, p = free.copy(), np.zeros(arm.nv)
        rub(v, A, dry, np.zeros(arm.nv), p, 0.0, 300)
        assert v == pytest.approx(free + A @ p, abs=1e-12)
        sticks = np.abs(v) < 1e-9
        assert (np.abs(p[sticks]) <= dry[sticks] + 1e-9).all()
        assert p[~sticks] == pytest.approx(-dry[~sticks] * np.sign(v[~sticks]), abs=1e-7)


def test_friction_takes_energy_out_of_an_arm_that_swings() -> None:
    arm = manipulator().with_gravity(np.zeros(3)).with_friction(1.0, 4.0)
    plant = StickingPlant(arm, 0.2)
    state = plant.begin(arm.neutral, np.full(arm.nv, 0.5), H)

    def energy(state: Motion) -> float:
        M: Array = arm.mass_matrix(state.q)
        return float(state.v @ M @ state.v / 2.0)

    energies = [energy(state)]
    for i in range(400):
        state = plant.step(state, np.zeros(arm.nv), FREE, i * H, H)
        energies.append(energy(state))
    assert (np.diff(energies) <= 1e-5).all()
    assert energies[-1] < 0.9 * energies[0]


def test_rise_below_zero_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match="stribeck"):
        StickingPlant(pendulum(), -0.1)
