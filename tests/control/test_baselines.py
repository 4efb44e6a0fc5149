"""The baselines, against what their theory promises."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.baseline_law import coriolis_torque
from rbimpedance.control.baselines import (
    ComputedTorqueImpedance,
    FirstOrderSlidingMode,
    PDGravity,
    PDPlus,
    SlotineLi,
)
from rbimpedance.robot.knowledge import Knowledge
from rbimpedance.trajectories import cosine, hold

from ..arms import manipulator, spinner
from ..oracles import two_link

Array = NDArray[np.float64]

IMPEDANCE = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
PUSH = np.array([5.0, 3.0, 2.0, 0.5, 0.0, -0.5])

BASELINES: dict[str, Callable[[rbi.ArmModel, float, Knowledge], Any]] = {
    "computed torque": lambda arm, dt, known: ComputedTorqueImpedance(
        arm, IMPEDANCE, dt, model=known
    ),
    "PD, gravity": lambda arm, dt, known: PDGravity(arm, IMPEDANCE, dt, model=known),
    "PD+": lambda arm, dt, known: PDPlus(arm, IMPEDANCE, dt, model=known),
    "sign": lambda arm, dt, known: FirstOrderSlidingMode(
        arm, IMPEDANCE, 2.0, 30.0, dt, model=known
    ),
    "boundary layer": lambda arm, dt, known: FirstOrderSlidingMode(
        arm, IMPEDANCE, 2.0, 30.0, dt, "boundary-layer", 0.1, model=known
    ),
    "dead zone": lambda arm, dt, known: FirstOrderSlidingMode(
        arm, IMPEDANCE, 2.0, 30.0, dt, "dead-zone", 0.05, model=known
    ),
    "Slotine-Li": lambda arm, dt, known: SlotineLi(arm, IMPEDANCE, 2.0, 40.0, dt, model=known),
}


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


def _inputs(arm: rbi.ArmModel, rng: np.random.Generator) -> tuple[Array, Array, Any, Array]:
    reference = rbi.Reference(arm.random_configuration(rng), *rng.normal(size=(2, arm.nv)))
    q, v, tau_ext = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
    return q, v, reference, tau_ext


# What all of them share


@pytest.mark.parametrize("name", BASELINES)
def test_torque_is_unchanged_when_the_step_is_repeated(name: str, rng: np.random.Generator) -> None:
    controller = BASELINES[name](spinner(), 1e-3, "full")
    inputs = _inputs(controller.arm, rng)
    kept = [np.copy(x) for x in (inputs[0], inputs[1], *inputs[2], inputs[3])]
    _, state = controller.step(controller.init(), *inputs)
    before = [x.copy() for x in state]
    first, _ = controller.step(state, *inputs)
    second, _ = controller.step(state, *inputs)
    for one, other in zip(first, second, strict=True):
        assert_array_equal(one, other)
    for old, new in zip(before, state, strict=True):
        assert_array_equal(old, new)
    for old, new in zip(kept, (inputs[0], inputs[1], *inputs[2], inputs[3]), strict=True):
        assert_array_equal(old, new)


@pytest.mark.parametrize("name", BASELINES)
def test_output_owns_its_arrays(name: str, rng: np.random.Generator) -> None:
    controller = BASELINES[name](spinner(), 1e-3, "full")
    inputs = _inputs(controller.arm, rng)
    output, state = controller.step(controller.init(), *inputs)
    given = [inputs[0], inputs[1], *inputs[2], inputs[3]]
    for i, array in enumerate(output):
        others = [*output[:i], *state, *given]
        assert not any(np.shares_memory(array, other) for other in others)


@pytest.mark.parametrize("name", BASELINES)
def test_baseline_cannot_be_changed(name: str, arm: rbi.ArmModel) -> None:
    controller = BASELINES[name](arm, 1e-3, "full")
    with pytest.raises(dataclasses.FrozenInstanceError):
        controller.dt = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        controller.speed = 1.0


@pytest.mark.parametrize("name", BASELINES)
def test_reference_and_errors_are_those_of_the_impedance_controller(
    name: str, rng: np.random.Generator
) -> None:
    arm = spinner()
    proposed = rbi.ImpedanceController(
        arm, IMPEDANCE, rbi.PowerSurface(3.0, 5.0 / 3.0), rbi.SuperTwisting(8.0, 10.0), 1e-3
    )
    controller = BASELINES[name](arm, 1e-3, "full")
    state, truth_state = controller.init(), proposed.init()
    for _ in range(5):
        inputs, a = _inputs(arm, rng), rng.normal(size=arm.nv)
        output, state = controller.step(state, *inputs)
        truth, truth_state = proposed.step(truth_state, *inputs)
        for channel in ("q_r", "v_r", "a_r", "e1", "e2", "q_e", "v_e"):
            mine, expected = getattr(output, channel), getattr(truth, channel)
            assert_allclose(mine, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())
        e_im, expected = controller.impedance_error(output, a), proposed.impedance_error(truth, a)
        assert_allclose(e_im, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("name", BASELINES)
def test_a_law_that_knows_the_mass_alone_is_free_of_gravity_and_motion(
    name: str, rng: np.random.Generator
) -> None:
    arm = manipulator()
    weightless = arm.with_gravity([0.0, 0.0, 0.0])
    q, _, reference, tau_ext = _inputs(arm, rng)
    rest = np.zeros(arm.nv)
    outputs = [
        BASELINES[name](model, 1e-3, "inertia").step(
            BASELINES[name](model, 1e-3, "inertia").init(), q, rest, reference, tau_ext
        )[0]
        for model in (arm, weightless)
    ]
    full, _ = BASELINES[name](arm, 1e-3, "full").step(
        BASELINES[name](arm, 1e-3, "full").init(), q, rest, reference, tau_ext
    )
    assert_array_equal(outputs[0].tau, outputs[1].tau)
    assert np.abs(full.tau - outputs[0].tau).max() > 1.0


@pytest.mark.parametrize("name", BASELINES)
def test_bad_input_is_refused(name: str, arm: rbi.ArmModel) -> None:
    controller = BASELINES[name](arm, 1e-3, "full")
    zero = np.zeros(2)
    reference = rbi.Reference(zero, zero, zero)
    with pytest.raises(rbi.DimensionError, match="tau_ext"):
        controller.step(controller.init(), zero, zero, reference, np.zeros(3))
    with pytest.raises(rbi.NonFiniteError, match="v must"):
        controller.step(controller.init(), zero, [0.0, np.nan], reference, zero)
    with pytest.raises(rbi.ParameterError, match="dt"):
        BASELINES[name](arm, 0.0, "full")
    with pytest.raises(rbi.ParameterError, match="model"):
        BASELINES[name](arm, 1e-3, "nothing")  # type: ignore[arg-type]


def test_inadmissible_gains_are_refused_by_name(arm: rbi.ArmModel) -> None:
    for gains, name in (
        ((0.0, 1.0, 1e-3), "surface_rate"),
        ((1.0, -1.0, 1e-3), "gain"),
        ((1.0, 1.0, 1e-3, "smooth"), "smoothing"),
        ((1.0, 1.0, 1e-3, "boundary-layer"), "width"),
        ((1.0, 1.0, 1e-3, "dead-zone", 0.0), "width"),
        ((1.0, 1.0, 1e-3, "sign", 0.1), "width"),
    ):
        with pytest.raises(rbi.ParameterError) as caught:
            FirstOrderSlidingMode(arm, IMPEDANCE, *gains)
        assert caught.value.name == name
    with pytest.raises(rbi.ParameterError, match="gain"):
        SlotineLi(arm, IMPEDANCE, 1.0, np.inf, 1e-3)
    with pytest.raises(rbi.DimensionError, match="gain"):
        SlotineLi(arm, IMPEDANCE, 1.0, [1.0, 2.0, 3.0], 1e-3)


# Computed torque


@pytest.mark.parametrize(
    "impedance", [IMPEDANCE, rbi.FiniteTimeImpedance(1.0, 10.0, 20.0, exponent=0.7)]
)
def test_computed_torque_achieves_the_target_exactly_with_an_exact_model(
    impedance: rbi.Impedance | rbi.FiniteTimeImpedance,
) -> None:
    arm = manipulator()
    trajectory = cosine(arm, amplitude=0.3, period=2.0)
    drift = []
    for dt in (4e-3, 2e-3, 1e-3):
        result = rbi.simulate(
            ComputedTorqueImpedance(arm, impedance, dt),
            arm,
            trajectory,
            environment=PUSH,
            q0=trajectory(0.0).q,
            duration=0.4,
        )
        assert np.abs(result.e_im).max() < 1e-10
        drift.append(np.abs(result.e1).max())
    assert_allclose(np.array(drift[1:]) / drift[:-1], 0.5, rtol=0.15)  # held torque: first order


def test_computed_torque_is_the_textbook_formula(rng: np.random.Generator) -> None:
    arm = manipulator()
    M_d, D_d, K_d = (np.diag(rng.uniform(1.0, 30.0, 6)) for _ in range(3))
    controller = ComputedTorqueImpedance(arm, rbi.Impedance(M_d, D_d, K_d), 1e-3)
    q, v, (q_d, v_d, a_d), tau_ext = _inputs(arm, rng)
    output, _ = controller.step(controller.init(), q, v, rbi.Reference(q_d, v_d, a_d), tau_ext)
    feedback = D_d @ (v_d - v) + K_d @ (q_d - q) + tau_ext
    a = a_d + np.linalg.solve(M_d, feedback)
    tau = arm.mass_matrix(q) @ a + arm.bias(q, v) - tau_ext
    assert_allclose(output.tau, tau, rtol=1e-12, atol=1e-10)
    assert_allclose(output.a_r + output.u, a, rtol=1e-12, atol=1e-10)


# PD


@pytest.mark.parametrize("law", [PDGravity, PDPlus])
def test_unknown_payload_sags_the_springs_by_its_weight(
    law: type[PDGravity] | type[PDPlus], arm: rbi.ArmModel
) -> None:
    K = np.array([200.0, 150.0])
    controller = law(arm, rbi.Impedance(1.0, [80.0, 30.0], K), 1e-3)
    plant = arm.with_payload(2.0)
    q_d = np.array([0.4, 0.6])
    result = rbi.simulate(controller, plant, hold(arm, q_d), q0=q_d, duration=10.0, substeps=1)
    q, rest = result.q[-1], np.zeros(2)
    sag = (plant.bias(q, rest) - arm.bias(q, rest)) / K
    assert_allclose(q_d - q, sag, rtol=0.0, atol=1e-8)
    assert sag.min() > 0.05


@pytest.mark.parametrize("law", [PDGravity, PDPlus])
def test_pd_yields_with_the_arms_own_inertia(
    law: type[PDGravity] | type[PDPlus], arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    controller, rest = law(arm, IMPEDANCE, 1e-3), np.zeros(2)
    q, tau_ext = rng.normal(size=(2, 2))
    output, _ = controller.step(controller.init(), q, rest, rbi.Reference(q, rest, rest), tau_ext)
    a = two_link.forward_dynamics(q, rest, output.tau + tau_ext)
    assert_allclose(a, np.linalg.solve(two_link.mass_matrix(q), tau_ext), rtol=0.0, atol=1e-11)


def _dissipation_gap(energy: Array, power: Array, dt: float) -> float:
    """Energy that the dissipated power does not account for, per energy dissipated."""
    dissipated = dt * (power[1:] + power[:-1]) / 2.0
    return float(np.abs(np.diff(energy) + dissipated).sum() / dissipated.sum())


def test_pd_plus_loses_its_error_energy_to_the_dampers_alone() -> None:
    arm, D, K = manipulator(), np.linspace(2.0, 5.0, 6), 30.0
    trajectory, gaps = cosine(arm, amplitude=0.3, period=2.0), []
    for dt in (2e-3, 1e-3):
        controller = PDPlus(arm, rbi.Impedance(1.0, D, K), dt)
        q0 = trajectory(0.0).q + 0.2
        result = rbi.simulate(controller, arm, trajectory, q0=q0, duration=0.6)
        desired = [trajectory(t) for t in result.t]
        e = np.array([d.q for d in desired]) - result.q
        e_dot = np.array([d.v for d in desired]) - result.v
        M = [arm.mass_matrix(q) for q in result.q]
        energy = np.einsum("ti,tij,tj->t", e_dot, M, e_dot) / 2.0 + K * (e**2).sum(axis=1) / 2.0
        assert (np.diff(energy) < 0.0).all()
        gaps.append(_dissipation_gap(energy, (D * e_dot**2).sum(axis=1), dt))
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.05)
    assert gaps[1] < 0.02


# First-order sliding mode; the two-link arm's gravity, unknown, is the disturbance

SWITCHING_RATE, SWITCHING_GAIN = 2.0, 30.0


def _slide(arm: rbi.ArmModel, dt: float, *smoothing: Any) -> rbi.SimulationResult:
    controller = FirstOrderSlidingMode(
        arm, IMPEDANCE, SWITCHING_RATE, SWITCHING_GAIN, dt, *smoothing, model="inertia"
    )
    trajectory = hold(arm, [0.5, 0.5])
    return rbi.simulate(controller, arm, trajectory, q0=[0.4, 0.6], duration=4.0)


def _disturbance(result: rbi.SimulationResult) -> Array:
    """w = M⁻¹ bias of ṡ = -u + w, from the closed form."""
    return np.array(
        [
            np.linalg.solve(two_link.mass_matrix(q), two_link.bias(q, v))
            for q, v in zip(result.q, result.v, strict=True)
        ]
    )


def test_sign_chatters_in_proportion_to_the_period(arm: rbi.ArmModel) -> None:
    steps, amplitudes, variations = np.array([4e-3, 2e-3, 1e-3]), [], []
    for dt in steps:
        result = _slide(arm, dt)
        late = result.t > 2.0
        w = np.abs(_disturbance(result)[late]).max()
        assert np.abs(result.s[late]).max() <= dt * (SWITCHING_GAIN + w) * 1.02
        amplitudes.append(np.abs(result.s[late]).max())
        variations.append(result.metrics(after=2.0)["tau_variation"].max())
    slope = np.polyfit(np.log(steps), np.log(amplitudes), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.15)
    assert np.polyfit(np.log(steps), np.log(variations), 1)[0] == pytest.approx(-1.0, abs=0.15)


def test_boundary_layer_holds_with_the_error_that_its_slope_needs(arm: rbi.ArmModel) -> None:
    width = 0.5
    result = _slide(arm, 1e-3, "boundary-layer", width)
    w = _disturbance(result)[-1]
    e1 = width * w / (SWITCHING_GAIN * SWITCHING_RATE)
    assert_allclose(result.e1[-1], e1, rtol=0.0, atol=1e-5)
    assert result.metrics(after=3.0)["tau_variation"].max() < 0.1


def test_boundary_layer_bounds_the_error_of_a_moving_arm(arm: rbi.ArmModel) -> None:
    width = 0.2
    controller = FirstOrderSlidingMode(
        arm,
        IMPEDANCE,
        SWITCHING_RATE,
        SWITCHING_GAIN,
        1e-3,
        "boundary-layer",
        width,
        model="inertia",
    )
    trajectory = cosine(arm, center=0.5, amplitude=0.2, period=6.0)
    q0 = trajectory(0.0).q  # e1 = e2 = s = 0
    result = rbi.simulate(controller, arm, trajectory, environment=PUSH, q0=q0, duration=5.0)
    w = np.abs(_disturbance(result)).max()
    assert w < SWITCHING_GAIN
    assert np.abs(result.s).max() <= width * w / SWITCHING_GAIN
    assert np.abs(result.e1).max() <= width * w / SWITCHING_GAIN / SWITCHING_RATE


def test_dead_zone_leaves_the_error_of_its_width(arm: rbi.ArmModel) -> None:
    width, dt = 0.1, 1e-3
    result = _slide(arm, dt, "dead-zone", width)
    late = result.t > 3.0
    w = _disturbance(result)[late]
    overshoot = dt * (SWITCHING_GAIN + np.abs(w).max())
    pushed = np.abs(w[-1]) > 1.0  # the disturbance drives s out of the zone: it stays at the edge
    assert pushed.any()
    assert np.abs(result.s[late]).max() <= width + overshoot
    assert np.abs(result.s[late][:, pushed]).min() >= width - overshoot


def test_dead_zone_does_not_switch_within_it(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    controller = FirstOrderSlidingMode(arm, IMPEDANCE, 2.0, 30.0, 1e-3, "dead-zone", [0.1, 100.0])
    q, v, reference, tau_ext = _inputs(arm, rng)
    output, _ = controller.step(controller.init(), q, v, reference, tau_ext)
    assert_array_equal(output.u, [30.0 * np.sign(output.s[0]), 0.0])


# Slotine and Li


def test_slotine_li_loses_its_sliding_energy_to_its_gain_alone() -> None:
    arm, K_s = manipulator(), np.linspace(2.0, 5.0, 6)
    trajectory, gaps = cosine(arm, amplitude=0.3, period=2.0), []
    for dt in (2e-3, 1e-3):
        controller = SlotineLi(arm, IMPEDANCE, 3.0, K_s, dt)
        q0 = trajectory(0.0).q + 0.2
        result = rbi.simulate(controller, arm, trajectory, environment=PUSH, q0=q0, duration=0.6)
        M = [arm.mass_matrix(q) for q in result.q]
        energy = np.einsum("ti,tij,tj->t", result.s, M, result.s) / 2.0
        assert (np.diff(energy) < 0.0).all()
        gaps.append(_dissipation_gap(energy, (K_s * result.s**2).sum(axis=1), dt))
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.05)
    assert gaps[1] < 0.03


# Coriolis


def test_coriolis_torque_is_that_of_the_closed_form(
    arm: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for _ in range(100):
        q, v, w = rng.normal(size=(3, 2))
        truth = two_link.coriolis(q, v) @ w
        assert_allclose(coriolis_torque(arm.raw_dynamics, q, v, w), truth, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("make", [manipulator, spinner])
def test_coriolis_matrix_is_pinocchios(
    make: Callable[[], rbi.ArmModel], rng: np.random.Generator
) -> None:
    arm = make()
    model = arm.model
    data = model.createData()
    for _ in range(20):
        q, v, w = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
        C = pin.computeCoriolisMatrix(model, data, q, v)
        assert_allclose(coriolis_torque(arm.raw_dynamics, q, v, w), C @ w, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("make", [manipulator, spinner])
def test_mass_rate_minus_twice_coriolis_is_skew(
    make: Callable[[], rbi.ArmModel], rng: np.random.Generator
) -> None:
    arm, h = make(), 1e-5
    for _ in range(20):
        q, v, w = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
        ahead, behind = (arm.mass_matrix(arm.integrate(q, d * v)) for d in (h, -h))
        M_dot = (ahead - behind) / (2.0 * h)
        C_w = coriolis_torque(arm.raw_dynamics, q, v, w)
        assert w @ M_dot @ w - 2.0 * w @ C_w == pytest.approx(0.0, abs=1e-7)
