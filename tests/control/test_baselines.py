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
    PIDImpedance,
    SlotineLi,
)
from rbimpedance.control.telemetry import Situation
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
    "PID": lambda arm, dt, known: PIDImpedance(arm, IMPEDANCE, 10.0, dt, model=known),
}


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


def _inputs(arm: rbi.ArmModel, rng: np.random.Generator) -> tuple[Array, Array, Any, Array]:
    reference = rbi.Reference(arm.random_configuration(rng), *rng.normal(size=(2, arm.nv)))
    q, v, tau_ext = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
    return q, v, reference, tau_ext


def _leaves(state: Any) -> list[Array]:
    """The arrays of a state, of the states in it too."""
    if not isinstance(state, tuple):
        return [np.asarray(state)]
    return [leaf for part in state for leaf in _leaves(part)]


# What all of them share


@pytest.mark.parametrize("name", BASELINES)
def test_torque_is_unchanged_when_the_step_is_repeated(name: str, rng: np.random.Generator) -> None:
    controller = BASELINES[name](spinner(), 1e-3, "full")
    inputs = _inputs(controller.arm, rng)
    kept = [np.copy(x) for x in (inputs[0], inputs[1], *inputs[2], inputs[3])]
    _, state = controller.step(controller.init(), *inputs)
    before = [np.copy(x) for x in _leaves(state)]
    first, _ = controller.step(state, *inputs)
    second, _ = controller.step(state, *inputs)
    for one, other in zip(first, second, strict=True):
        assert_array_equal(one, other)
    for old, new in zip(before, _leaves(state), strict=True):
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
        others = [*output[:i], *_leaves(state), *given]
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_boundary_layer_holds_with_the_error_that_its_slope_needs(arm: rbi.ArmModel) -> None:
    width = 0.5
    result = _slide(arm, 1e-3, "boundary-layer", width)
    w = _disturbance(result)[-1]
    e1 = width * w / (SWITCHING_GAIN * SWITCHING_RATE)
    assert_allclose(result.e1[-1], e1, rtol=0.0, atol=1e-5)
    assert result.metrics(after=3.0)["tau_variation"].max() < 0.1


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


# PID


def test_pid_places_all_poles_of_the_sampled_loop_at_its_bandwidth() -> None:
    dt, bandwidth = 5e-3, np.array([20.0, 5.0])
    arm = rbi.load_robot("two_link").with_gravity([0.0, 0.0, 0.0])
    controller = PIDImpedance(arm, IMPEDANCE, bandwidth, dt)
    state, rest = controller.init(), np.zeros(2)
    q, v = np.array([0.3, -0.2]), np.zeros(2)
    errors = []
    for _ in range(60):  # a plant that has the acceleration it is asked for, held for dt
        output, state = controller.step(state, q, v, rbi.Reference(rest, rest, rest), rest)
        a = np.linalg.solve(arm.mass_matrix(q), output.tau - arm.bias(q, v))
        q, v = q + dt * v + dt**2 / 2.0 * a, v + dt * a
        errors.append(output.e1)
    e = np.array(errors)
    pole = np.exp(-bandwidth * dt)
    residual = e[3:] - 3.0 * pole * e[2:-1] + 3.0 * pole**2 * e[1:-2] - pole**3 * e[:-3]
    assert_allclose(residual, 0.0, rtol=0.0, atol=1e-13)
    assert_allclose(e[0], [-0.3, 0.2])


@pytest.mark.slow
def test_pid_error_decays_as_the_triple_pole_says_on_an_arm_that_is_known() -> None:
    arm, p, gaps = manipulator(), 8.0, []
    trajectory = hold(arm, np.linspace(-0.5, 0.5, 6))
    e0 = np.array([0.2, -0.1, 0.15, 0.1, -0.2, 0.05])
    for dt in (2e-3, 1e-3):
        controller = PIDImpedance(arm, IMPEDANCE, p, dt)
        result = rbi.simulate(controller, arm, trajectory, q0=trajectory(0.0).q - e0, duration=1.0)
        t = result.t[:, np.newaxis]
        gaps.append(np.abs(result.e1 - e0 * np.exp(-p * t) * (1.0 + p * t - (p * t) ** 2)).max())
    assert gaps[1] < 0.01 * 0.2
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.1)  # held torque: first order


@pytest.mark.slow
def test_pid_leaves_no_error_under_an_unknown_payload(arm: rbi.ArmModel) -> None:
    p, reference = 15.0, hold(arm, [0.4, 0.6])
    result = rbi.simulate(
        PIDImpedance(arm, IMPEDANCE, p, 1e-3),
        arm.with_payload(2.0),
        reference,
        q0=reference(0.0).q,
        duration=6.0,
    )
    assert np.abs(result.e1).max() > 1e-2
    assert np.abs(result.e1[-1]).max() < 1e-9


@pytest.mark.slow
def test_pid_lags_behind_a_disturbance_that_grows_by_its_rate_over_the_bandwidth_cubed(
    arm: rbi.ArmModel,
) -> None:
    p, dt, rate = 15.0, 1e-3, np.array([2.0, -3.0])
    controller = PIDImpedance(arm, IMPEDANCE, p, dt)
    state, rest = controller.init(), np.zeros(2)
    q, v = np.zeros(2), np.zeros(2)
    for k in range(2000):
        output, state = controller.step(state, q, v, rbi.Reference(rest, rest, rest), rest)
        a = two_link.forward_dynamics(q, v, output.tau) - rate * k * dt
        q, v = q + dt * v + dt**2 / 2.0 * a, v + dt * a
    assert_allclose(output.e1, rate / p**3, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [rbi.Limits(effort=25.0), rbi.Limits(rate=1.0)])
def test_pid_does_not_wind_up_while_brakes_hold_the_arm(
    arm: rbi.ArmModel, limits: rbi.Limits
) -> None:
    dt, rest = 1e-3, np.zeros(2)
    controller = PIDImpedance(arm, IMPEDANCE, 15.0, dt, limits=limits)
    weightless = np.array([np.pi / 2.0, 0.0])  # upright
    braked, state = weightless - 0.5, controller.init()
    reference = rbi.Reference(weightless, rest, rest)
    for _ in range(3000):
        before = state
        output, state = controller.step(state, braked, rest, reference, rest)
        assert (np.abs(output.tau) <= limits.effort).all()
        if before.ticks:
            assert (np.abs(output.tau - before.tau) <= limits.rate * dt + 1e-12).all()
    assert (output.saturated | output.rate_limited)[0]
    assert 0.0 <= state.integral[0] <= 2.0 * dt * 0.5  # without clamping: 3 s of 0.5 rad


def test_pid_integrates_over_the_time_that_a_late_tick_took(arm: rbi.ArmModel) -> None:
    dt, rest, error = 1e-3, np.zeros(2), np.array([0.02, -0.01])
    controller = PIDImpedance(arm, IMPEDANCE, 15.0, dt)
    reference = rbi.Reference(error, rest, rest)
    _, state = controller.step(controller.init(), rest, rest, reference, rest)
    for period in (dt, 3.5 * dt):
        _, late = controller.step(state, rest, rest, reference, rest, period)
        assert_allclose(late.integral, error * (period + dt), rtol=1e-12)
    with pytest.raises(rbi.InputError, match="period"):
        controller.step(state, rest, rest, reference, rest, -dt)


def test_pid_takes_an_arm_over_with_the_integral_that_it_has(arm: rbi.ArmModel) -> None:
    q, v, rest = np.array([0.3, 0.1]), np.array([0.2, -0.1]), np.zeros(2)
    controller = PIDImpedance(arm, IMPEDANCE, 15.0, 1e-3)
    learnt = np.array([0.01, -0.02])
    reference = rbi.Reference(rest, rest, rest)
    now = Situation(q, v, rest, reference, tau=rest, tau_ext=rest)
    state = controller.handover(controller.init()._replace(integral=learnt), now)
    output, _ = controller.step(state, q, v, reference, rest)
    assert_allclose([output.e1, output.e2], 0.0, rtol=0.0, atol=1e-15)
    assert_allclose(output.u, 15.0**3 * learnt, rtol=0.03)


def test_pid_refuses_a_bandwidth_and_limits_that_cannot_be(arm: rbi.ArmModel) -> None:
    with pytest.raises(rbi.ParameterError, match="bandwidth"):
        PIDImpedance(arm, IMPEDANCE, 0.0, 1e-3)
    with pytest.raises(rbi.DimensionError, match="bandwidth"):
        PIDImpedance(arm, IMPEDANCE, [1.0, 2.0, 3.0], 1e-3)
    with pytest.raises(rbi.DimensionError, match=r"Limits\.effort"):
        PIDImpedance(arm, IMPEDANCE, 10.0, 1e-3, limits=[1.0, 2.0, 3.0])
