"""Without a force sensor the arm yields like the spring it was given, and what that costs is what the docs say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.sensorless import split

from ..arms import manipulator, spinner

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
POSTURE = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
SIDEWAYS = [0.0, 20.0, 0.0, 0.0, 0.0, 0.0]
STIFFNESS = 200.0


@pytest.fixture(scope="module")
def panda() -> rbi.ArmModel:
    return rbi.load_robot("panda", lock=FINGERS, armature=0.1)


def rigid(arm: rbi.ArmModel) -> rbi.ImpedanceController:
    return rbi.ImpedanceController(arm, rbi.Impedance(1.0, stiffness=STIFFNESS))


def held(controller: Any, plant: rbi.ArmModel, wrench: Any = None, **more: Any) -> Array:
    """Deflection after 1.2 s of holding the posture, shape (nv,)."""
    motion = rbi.trajectories.hold(plant, POSTURE)
    result = rbi.simulate(
        controller, plant, motion, environment=wrench, q0=POSTURE, duration=1.2, substeps=1, **more
    )
    return np.asarray(result.q[-1] - POSTURE)


class Zeros:
    """What a loop without a sensor passes for tau_ext if nobody thinks of it."""

    def init(self) -> None:
        return None

    def step(
        self, state: None, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, None]:
        del state, q, v, tau
        return np.zeros_like(tau_ext), None


@pytest.mark.slow
def test_with_zeros_for_tau_ext_the_arm_is_rigid(panda: rbi.ArmModel) -> None:
    assert np.abs(held(rigid(panda), panda, SIDEWAYS, sensor=Zeros())).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("reject", [0.0, 8.0])
def test_unknown_payload_lets_the_spring_sag_by_its_weight_less_what_is_rejected(
    panda: rbi.ArmModel, reject: float
) -> None:
    plant = panda.with_payload(1.0)
    moved = held(rbi.CompliantController(panda, STIFFNESS, reject=reject), plant)
    missed = panda.bias(POSTURE + moved, np.zeros(7)) - plant.bias(POSTURE + moved, np.zeros(7))
    felt = missed - np.clip(missed, -reject, reject)
    np.testing.assert_allclose(moved, felt / STIFFNESS, atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("reject", [0.0, 2.0])
@pytest.mark.parametrize("kind", ["compliant", "observer"])
def test_without_a_sensor_a_push_moves_the_arm_by_what_is_not_rejected_over_stiffness(
    panda: rbi.ArmModel, kind: str, reject: float
) -> None:
    controller: Any = {
        "compliant": rbi.CompliantController(panda, STIFFNESS, reject=reject),
        "observer": rbi.SensorlessController(rigid(panda), reject=reject),
    }[kind]
    moved = held(controller, panda, SIDEWAYS)
    torque = panda.external_torque(POSTURE + moved, SIDEWAYS)
    felt = np.sign(torque) * np.maximum(np.abs(torque) - reject, 0.0)
    np.testing.assert_allclose(moved, felt / STIFFNESS, atol=2e-4)
    assert np.abs(moved).max() > 0.01


def test_split_parts_add_up_and_the_rejected_one_keeps_its_bound() -> None:
    torque = np.array([3.0, -0.5, -7.0])
    rejected, felt = split(torque, np.array([1.0, 1.0, 0.0]))
    np.testing.assert_array_equal(rejected, [1.0, -0.5, 0.0])
    np.testing.assert_array_equal(felt, [2.0, 0.0, -7.0])


def test_every_mode_of_the_arms_inertia_and_the_spring_has_the_damping_ratio() -> None:
    """Poles of M(q) ë + D ė + K e = 0 by the companion matrix: each pair has ζ = 0.7."""
    arm = manipulator()
    controller = rbi.CompliantController(arm, 80.0, 0.7)
    q = np.linspace(-1.0, 1.0, arm.nq)
    M, zero = arm.mass_matrix(q), np.zeros(arm.nv)
    reference = rbi.Reference(q, zero, zero)
    pull = [
        controller.step(controller.init(), q, -unit, reference)[0].tau
        - controller.step(controller.init(), q, zero, reference)[0].tau
        - arm.bias(q, -unit)
        + arm.bias(q, zero)
        + _coriolis_excess(arm, q, unit)
        for unit in 1e-6 * np.eye(arm.nv)
    ]
    D = np.array(pull).T / 1e-6
    companion = np.block(
        [
            [np.zeros_like(M), np.eye(arm.nv)],
            [-np.linalg.solve(M, 80.0 * np.eye(arm.nv)), -np.linalg.solve(M, D)],
        ]
    )
    poles = np.linalg.eigvals(companion)
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.7, rtol=1e-3)


def _coriolis_excess(arm: rbi.ArmModel, q: Array, v: Array) -> Array:
    """Coriolis torque of a small velocity, quadratic in it: the law leaves it to the arm."""
    bare = arm.with_friction(0.0, 0.0)
    return bare.bias(q, -v) - bare.bias(q, np.zeros(arm.nv))


@pytest.mark.slow
def test_free_motion_gives_no_energy_away_whatever_the_mass_model_says() -> None:
    """Storage ½vᵀMv + ½eᵀKe of the true arm falls, although the law's arm is half as heavy; gravity off."""
    plant = spinner().with_gravity([0.0, 0.0, 0.0]).with_friction(0.0, 0.0)
    believed = plant.with_scaled_inertia(0.5)
    controller = rbi.CompliantController(believed, 60.0)
    hold = rbi.trajectories.hold(plant, plant.neutral)
    start = plant.integrate(plant.neutral, np.array([0.3, 0.1, -0.3]))
    result = rbi.simulate(controller, plant, hold, q0=start, duration=1.0)
    energy = [
        0.5 * v @ plant.mass_matrix(q) @ v + 30.0 * e @ e
        for q, v, e in zip(result.q, result.v, result.e1, strict=True)
    ]
    assert np.diff(energy).max() < 1e-3 * energy[0]
    assert energy[-1] < 0.05 * energy[0]


def test_e_im_is_what_acts_beyond_the_model(panda: rbi.ArmModel) -> None:
    motion = rbi.trajectories.hold(panda, POSTURE)
    controller = rbi.CompliantController(panda, STIFFNESS)
    result = rbi.simulate(
        controller, panda, motion, environment=SIDEWAYS, q0=POSTURE, duration=0.02, substeps=1
    )
    np.testing.assert_allclose(result.e_im, -result.tau_ext, atol=1e-6)


def test_compliant_controller_keeps_its_limits(panda: rbi.ArmModel) -> None:
    controller = rbi.CompliantController(panda, STIFFNESS, limits=panda.effort_limit)
    far = rbi.Reference(POSTURE + 1.0, np.zeros(7), np.zeros(7))
    output, _ = controller.step(controller.init(), POSTURE, np.zeros(7), far)
    assert (np.abs(output.tau) <= panda.effort_limit + 1e-9).all()
    assert output.saturated.any()


@pytest.mark.parametrize(
    "make",
    [
        lambda arm: rbi.CompliantController(arm, -1.0),
        lambda arm: rbi.CompliantController(arm, 100.0, 0.7, damping=3.0),
        lambda arm: rbi.CompliantController(arm, 100.0, reject=-1.0),
        lambda arm: rbi.SensorlessController(rigid(arm), reject=[-1.0] * 7),
    ],
)
def test_values_that_cannot_be_are_refused(panda: rbi.ArmModel, make: Any) -> None:
    with pytest.raises(rbi.ParameterError):
        make(panda)


def test_momentum_observer_has_a_bandwidth_that_its_period_allows(panda: rbi.ArmModel) -> None:
    assert rbi.MomentumObserver(panda).gain[0] == 100.0
    assert rbi.MomentumObserver(panda, dt=1e-2).gain[0] == pytest.approx(10.0)


@pytest.mark.parametrize("kind", ["compliant", "observer"])
def test_guards_and_measured_periods_go_with_it(panda: rbi.ArmModel, kind: str) -> None:
    controller: Any = {
        "compliant": rbi.CompliantController(panda, STIFFNESS, reject=1.0),
        "observer": rbi.SensorlessController(rigid(panda)),
    }[kind]
    reference = rbi.Reference(POSTURE, np.zeros(7), np.zeros(7))
    state, guard = controller.init(), rbi.FaultGuard(controller)
    output, state = controller.step(state, POSTURE, np.zeros(7), reference)
    late, _ = controller.step(state, POSTURE, np.zeros(7), reference, period=1.5e-3)
    guarded, _ = guard.step(guard.init(), POSTURE, np.zeros(7), reference, np.zeros(7))
    np.testing.assert_allclose(guarded.tau, output.tau)
    assert np.isfinite(late.tau).all()
    with pytest.raises(rbi.InputError):
        controller.step(state, POSTURE, np.zeros(7), reference, period=-1.0)
