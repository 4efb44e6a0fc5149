"""One tick of `ImpedanceController` against equations (3) to (8) written out on Pinocchio alone."""

from __future__ import annotations

import dataclasses
import itertools
import pickle
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.linalg import expm

import rbimpedance as rbi

from .. import arms
from ..arms import ARMS

Array = NDArray[np.float64]
Knowledge = Literal["full", "inertia"]
Scheme = Literal["explicit", "matched", "implicit"]

DT = 1e-3
GAMMA, EXPONENT, K1, K2 = 3.0, 5.0 / 3.0, 8.0, 10.0
MASS, DAMPING, STIFFNESS = 1.5, 10.0, 20.0


@pytest.fixture(scope="module")
def spinner() -> rbi.ArmModel:
    return arms.spinner()


def build(arm: rbi.ArmModel, **changes: Any) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(mass=MASS, damping=DAMPING, stiffness=STIFFNESS),
        "surface": rbi.PowerSurface(gamma=GAMMA, exponent=EXPONENT),
        "reaching": rbi.SuperTwisting(k1=K1, k2=K2, scheme="explicit"),
        "dt": DT,
    }
    return rbi.ImpedanceController(arm, **(parts | changes))


class Tick(NamedTuple):
    """The arguments of one step."""

    state: rbi.ControllerState
    q: Array
    v: Array
    reference: rbi.Reference
    tau_ext: Array


def draw(controller: rbi.ImpedanceController, rng: np.random.Generator) -> Tick:
    """Random measurements near a random reference, some ticks into a run."""
    arm = controller.arm
    q_e, v_e, z, x, a, v_d, a_d, v, tau_ext, step = rng.normal(0.0, 0.5, (10, arm.nv))
    q_d = arm.random_configuration(rng)
    state = controller.init()._replace(ticks=3, q_e=q_e, v_e=v_e, z=z, x=x, a=a)
    q = arm.integrate(q_d, step)
    return Tick(state, q, v, rbi.Reference(q_d, v_d, a_d), 10.0 * tau_ext)


def written_out(arm: rbi.ArmModel, tick: Tick, knowledge: Knowledge) -> dict[str, Array]:
    """Equations (3), (4), (6) and (8) with M and the bias from Pinocchio."""
    state, q, v, (q_d, v_d, a_d), tau_ext = tick
    model = arm.model
    a_e = (tau_ext - DAMPING * state.v_e - STIFFNESS * state.q_e) / MASS  # (3)
    q_r = np.array(pin.integrate(model, q_d, state.q_e))  # (4)
    v_r, a_r = v_d + state.v_e, a_d + a_e
    e1, e2 = np.array(pin.difference(model, q, q_r)), v_r - v
    s = GAMMA * np.sign(e1) * np.abs(e1) ** EXPONENT + e2  # (6)
    u = K1 * np.sign(s) * np.sqrt(np.abs(s)) + K2 * state.z
    a = GAMMA * EXPONENT * np.abs(e1) ** (EXPONENT - 1.0) * e2 + a_r + u
    weightless, rest = pin.Model(model), np.zeros(arm.nv)
    weightless.gravity.linear = np.zeros(3)
    tau = -tau_ext + np.array(pin.rnea(weightless, weightless.createData(), q, rest, a))  # M a
    if knowledge == "full":  # (8)
        tau = tau + np.array(pin.nonLinearEffects(model, model.createData(), q, v))
        tau = tau + arm.viscous * v + arm.coulomb * np.tanh(v / 0.05)
    names = ("tau", "q_r", "v_r", "a_r", "e1", "e2", "s", "u")
    return dict(zip(names, (tau, q_r, v_r, a_r, e1, e2, s, u), strict=True))


@pytest.mark.parametrize("model", ["full", "inertia"])
@pytest.mark.parametrize("name", sorted(ARMS))
def test_output_is_that_of_the_equations(
    name: str, model: Knowledge, rng: np.random.Generator
) -> None:
    arm = ARMS[name]()
    controller = build(arm, model=model)
    for _ in range(30):
        tick = draw(controller, rng)
        output, _ = controller.step(*tick)
        for key, truth in written_out(arm, tick, model).items():
            scale = np.abs(truth).max()
            got = getattr(output, key)
            assert_allclose(got, truth, rtol=0.0, atol=1e-10 * scale, err_msg=key)


def test_next_state_is_one_period_of_filter_and_integral(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    controller = build(spinner)
    A = np.array([[0.0, 1.0, 0.0], [-STIFFNESS, -DAMPING, 1.0], [0.0, 0.0, 0.0]])
    A[1] /= MASS
    step = expm(DT * A)[:2]
    for _ in range(10):
        tick = draw(controller, rng)
        output, after = controller.step(*tick)
        filtered = step @ np.array([tick.state.q_e, tick.state.v_e, tick.tau_ext])
        assert_allclose([after.q_e, after.v_e], filtered, rtol=1e-13, atol=1e-13)
        assert_allclose(after.z, tick.state.z + DT * np.sign(output.s), rtol=1e-14)
        assert after.ticks == tick.state.ticks + 1


def test_filter_tends_to_the_static_deflection(spinner: rbi.ArmModel) -> None:
    """K_d q_e = tau_ext at rest."""
    controller, tau_ext = build(spinner, dt=0.1), np.array([3.0, -2.0, 1.0])
    state = controller.init()
    rest = rbi.Reference(spinner.neutral, np.zeros(3), np.zeros(3))
    for _ in range(200):
        _, state = controller.step(state, spinner.neutral, np.zeros(3), rest, tau_ext)
    assert_allclose(state.q_e, tau_ext / STIFFNESS, rtol=1e-10)


def test_impedance_error_is_the_residual_of_the_target(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    """M_d (a_d - a) + D_d (v_d - v) + K_d (q_d (-) q) + tau_ext, equation (2)."""
    controller = build(spinner)
    tick, a = draw(controller, rng), rng.normal(size=3)
    output, _ = controller.step(*tick)
    q_d, v_d, a_d = tick.reference
    away = spinner.difference(tick.q, q_d)
    residual = MASS * (a_d - a) + DAMPING * (v_d - tick.v) + STIFFNESS * away + tick.tau_ext
    assert_allclose(controller.impedance_error(output, a), residual, rtol=0.0, atol=1e-12)


# --- purity --------------------------------------------------------------------------------------


SURFACES: dict[str, Any] = {
    "power": rbi.PowerSurface(gamma=GAMMA, exponent=EXPONENT),
    "fast": rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6, smoothing=1e-3),
    "nonsingular": rbi.NonsingularTerminalSurface(beta=3.0, exponent=EXPONENT),
}
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
LAWS = {
    f"{surface}-{scheme}": {
        "surface": SURFACES[surface],
        "reaching": rbi.SuperTwisting(K1, K2, scheme),
    }
    for surface, scheme in itertools.product(SURFACES, SCHEMES)
}


def flat(answer: tuple[rbi.ControllerOutput, rbi.ControllerState]) -> list[NDArray[Any]]:
    return [x for part in answer for x in part if isinstance(x, np.ndarray)]


def assert_all_equal(some: list[NDArray[Any]], others: list[NDArray[Any]]) -> None:
    for x, y in zip(some, others, strict=True):
        assert_array_equal(x, y)


def arrays(tick: Tick) -> list[Array]:
    state, q, v, reference, tau_ext = tick
    return [*(x for x in state if isinstance(x, np.ndarray)), q, v, *reference, tau_ext]


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("name", sorted(ARMS))
def test_torque_is_unchanged_when_step_is_repeated(
    name: str, law: dict[str, Any], rng: np.random.Generator
) -> None:
    controller = build(ARMS[name](), **law)
    tick = draw(controller, rng)
    first = flat(controller.step(*tick))
    controller.step(*draw(controller, rng))
    assert_all_equal(flat(controller.step(*tick)), first)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_step_leaves_its_arguments_alone(
    spinner: rbi.ArmModel, law: dict[str, Any], rng: np.random.Generator
) -> None:
    controller = build(spinner, **law)
    for state in (controller.init(), None):
        tick = draw(controller, rng)
        tick = tick if state is None else tick._replace(state=state)
        before = [x.copy() for x in arrays(tick)]
        controller.step(*tick)
        assert_all_equal(arrays(tick), before)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_output_shares_no_memory_with_anything(
    spinner: rbi.ArmModel, law: dict[str, Any], rng: np.random.Generator
) -> None:
    controller = build(spinner, **law)
    tick = draw(controller, rng)
    for state in (controller.init(), tick.state):
        tick = tick._replace(state=state)
        output, after = controller.step(*tick)
        outputs = [x for x in output if isinstance(x, np.ndarray)]
        states = [x for x in after if isinstance(x, np.ndarray)]
        others = [*arrays(tick), *states]
        assert not any(np.shares_memory(x, y) for x in outputs for y in others)
        assert not any(np.shares_memory(x, y) for x, y in itertools.combinations(outputs, 2))


def test_state_shares_no_memory_with_the_measurements(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    for law in LAWS.values():
        controller = build(spinner, **law)
        tick = draw(controller, rng)
        _, after = controller.step(*tick)
        inputs = [tick.q, tick.v, *tick.reference, tick.tau_ext]
        states = [x for x in after if isinstance(x, np.ndarray)]
        assert not any(np.shares_memory(x, y) for x in inputs for y in states)


def test_initial_state_is_at_rest_and_read_only(spinner: rbi.ArmModel) -> None:
    ticks, *memory = build(spinner).init()
    assert ticks == 0
    for x in memory:
        assert_array_equal(x, np.zeros(3))
        with pytest.raises(ValueError, match="read-only"):
            x[0] = 1.0


def test_controller_cannot_be_changed(spinner: rbi.ArmModel) -> None:
    controller = build(spinner)
    with pytest.raises(dataclasses.FrozenInstanceError):
        controller.dt = 1.0  # type: ignore[misc]


def test_pickled_controller_gives_the_same_answer(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    controller = build(spinner)
    other = pickle.loads(pickle.dumps(controller))
    tick = draw(controller, rng)
    assert_all_equal(flat(other.step(*tick)), flat(controller.step(*tick)))


def test_form_of_the_measurements_does_not_matter(
    spinner: rbi.ArmModel, rng: np.random.Generator
) -> None:
    controller = build(spinner)
    state, q, v, reference, tau_ext = tick = draw(controller, rng)
    swapped = rbi.Reference(*(x.astype(">f8") for x in reference))
    other = controller.step(state, q.tolist(), np.repeat(v, 2)[::2], swapped, tau_ext.astype(">f8"))
    assert_all_equal(flat(other), flat(controller.step(*tick)))


# --- gains per joint -----------------------------------------------------------------------------


def spread(value: float) -> Array:
    return np.full(3, value)


PER_JOINT: dict[str, dict[str, Any]] = {
    "impedance vectors": {
        "impedance": rbi.Impedance(spread(MASS), spread(DAMPING), spread(STIFFNESS))
    },
    "impedance matrices": {
        "impedance": rbi.Impedance(
            np.diag(spread(MASS)), np.diag(spread(DAMPING)), np.diag(spread(STIFFNESS))
        )
    },
    "surface": {"surface": rbi.PowerSurface(spread(GAMMA), spread(EXPONENT))},
    "reaching": {"reaching": rbi.SuperTwisting(spread(K1), spread(K2), "explicit")},
}


@pytest.mark.parametrize("changes", PER_JOINT.values(), ids=PER_JOINT)
def test_equal_gains_per_joint_are_the_scalar_gain(
    spinner: rbi.ArmModel, changes: dict[str, Any], rng: np.random.Generator
) -> None:
    scalar, vector = build(spinner), build(spinner, **changes)
    for _ in range(5):
        tick = draw(scalar, rng)
        assert_all_equal(flat(vector.step(*tick)), flat(scalar.step(*tick)))


def test_each_joint_obeys_its_own_gains(spinner: rbi.ArmModel, rng: np.random.Generator) -> None:
    """Joint j of a run with gains per joint is joint j of the run in which all have its gain."""
    gammas, k1s, k2s = np.array([1.0, 2.0, 3.0]), np.array([4.0, 8.0, 16.0]), np.arange(1.0, 4.0)
    mixed = build(
        spinner,
        surface=rbi.PowerSurface(gammas, EXPONENT),
        reaching=rbi.SuperTwisting(k1s, k2s, "explicit"),
    )
    tick = draw(mixed, rng)
    output, after = mixed.step(*tick)
    for j in range(3):
        same = build(
            spinner,
            surface=rbi.PowerSurface(gammas[j], EXPONENT),
            reaching=rbi.SuperTwisting(k1s[j], k2s[j], "explicit"),
        )
        alone, alone_after = same.step(*tick)
        assert output.s[j] == alone.s[j]
        assert output.u[j] == alone.u[j]
        assert after.z[j] == alone_after.z[j]
    assert len(set(output.u / alone.u)) == 3


# --- refusals ------------------------------------------------------------------------------------


BAD = {"nan": np.nan, "infinite": np.inf}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
@pytest.mark.parametrize("name", ["q", "v", "tau_ext", "reference.q", "reference.v", "reference.a"])
def test_non_finite_input_is_refused_by_name(
    spinner: rbi.ArmModel, name: str, bad: float, rng: np.random.Generator
) -> None:
    controller = build(spinner)
    tick = draw(controller, rng)
    owner, _, field = name.rpartition(".")
    value = getattr(getattr(tick, owner) if owner else tick, field).copy()
    value[1] = bad
    if owner:
        tick = tick._replace(reference=tick.reference._replace(**{field: value}))
    else:
        tick = tick._replace(**{name: value})
    with pytest.raises(rbi.NonFiniteError, match=rf"^{name} must be finite; entry 1 is") as caught:
        controller.step(*tick)
    assert caught.value.name == name


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"q": np.zeros(3)},
            r"^q must be .*= \(4,\).*nq = 4 \(nv = 3\); arm.integrate.*got shape \(3,\)",
        ),
        ({"q": [2.0, 0.0, 0.0, 0.0]}, r"^q must be .*\(cos, sin\) pairs of unit length"),
        ({"v": np.zeros(4)}, r"^v must be a vector of shape \(nv,\) = \(3,\), got shape \(4,\)"),
        ({"tau_ext": 0.0}, r"^tau_ext must be .*= \(3,\), got shape \(\)"),
        ({"tau_ext": [1j, 0.0, 0.0]}, r"^tau_ext must be .*complex"),
        ({"reference": None}, r"^reference must be a Reference\(q, v, a\), got NoneType"),
        ({"reference": (ZERO := np.zeros(3), ZERO)}, r"^reference must be a Reference\(q, v, a\)"),
        ({"reference": rbi.Reference(ZERO, ZERO, ZERO)}, r"^reference.q must be .*nq = 4"),
    ],
)
def test_input_of_wrong_kind_is_refused_by_name(
    spinner: rbi.ArmModel, changes: dict[str, Any], words: str, rng: np.random.Generator
) -> None:
    controller = build(spinner)
    with pytest.raises(rbi.DimensionError, match=words):
        controller.step(*draw(controller, rng)._replace(**changes))


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf, "1", True, 1j, None, [1e-3]])
def test_unusable_period_is_refused(spinner: rbi.ArmModel, dt: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^dt must be a positive, finite control period"):
        build(spinner, dt=dt)


def test_unknown_knowledge_is_refused(spinner: rbi.ArmModel) -> None:
    with pytest.raises(
        rbi.ParameterError, match=r'^model must be "full" or "inertia", got \'none\''
    ):
        build(spinner, model="none")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"surface": rbi.PowerSurface([3.0, 3.0], EXPONENT)}, r"^PowerSurface\.gamma must be"),
        ({"reaching": rbi.SuperTwisting(8.0, np.ones(4))}, r"^SuperTwisting\.k2 must be"),
        ({"impedance": rbi.Impedance(np.ones(2), 10.0, 20.0)}, r"^mass must be"),
        ({"impedance": rbi.Impedance(1.0, np.eye(4), 20.0)}, r"^damping must be"),
    ],
)
def test_gains_for_another_number_of_joints_are_refused(
    spinner: rbi.ArmModel, changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(rbi.DimensionError, match=words + r".*= \(3,"):
        build(spinner, **changes)


@pytest.mark.parametrize(
    ("kind", "arguments", "words"),
    [
        (rbi.Impedance, (0.0, 1.0, 1.0), r"^mass must be a positive number"),
        (rbi.Impedance, (np.diag([1.0, -1.0]), 1.0, 1.0), r"^mass must .*not positive definite"),
        (rbi.Impedance, ([[1.0, 0.5], [0.0, 1.0]], 1.0, 1.0), r"^mass must .*not symmetric"),
        (rbi.PowerSurface, (3.0, 1.0), r"^exponent must be .*1.*2"),
        (rbi.PowerSurface, (3.0, 2.0), r"^exponent must be .*1.*2"),
        (rbi.SuperTwisting, (0.0, 10.0), r"^k1 must be positive"),
        (rbi.SuperTwisting, (8.0, -1.0), r"^k2 must be positive"),
    ],
)
def test_inadmissible_gain_is_refused_with_its_set(
    kind: Any, arguments: tuple[Any, ...], words: str
) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        kind(*arguments)
