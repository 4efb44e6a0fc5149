"""The compiled ticks against their specification, the NumPy form of `ImpedanceController.step`."""

from __future__ import annotations

import copy
import functools
import itertools
import pickle
from typing import Any, Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.backends import is_available, warm_up
from rbimpedance.control.compiled.block import PackedState
from rbimpedance.control.compiled.forms import CompiledForm, CompiledTick, PinocchioTick
from rbimpedance.control.compiled.pack import can_pack

from .. import arms
from ..isolation import fresh_python

Array = NDArray[np.float64]
Scheme = Literal["explicit", "matched", "implicit"]
Knowledge = Literal["full", "inertia"]
Arguments = tuple[rbi.ControllerState, Array, Array, rbi.Reference, Array]

DT = 1e-3
CLOSE = 1e-13
SURFACES: dict[str, Any] = {
    "power": rbi.PowerSurface(gamma=3.0, exponent=5.0 / 3.0),
    "fast terminal": rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6),
    "nonsingular terminal": rbi.NonsingularTerminalSurface(beta=3.0, exponent=5.0 / 3.0),
    "bounded": rbi.BoundedSurface(rbi.FastTerminalSurface(2.0, 3.0, 0.6), max_error=0.4),
}
LIMITS: dict[str, rbi.Limits | None] = {
    "none": None,
    "effort": rbi.Limits(effort=3.0),
    "rate": rbi.Limits(rate=2e3),
    "both": rbi.Limits(effort=3.0, rate=2e3),
}
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
FLAGS = ("saturated", "premise_holds", "rate_limited", "clipped", "reference_limited")
KNOWLEDGE: tuple[Knowledge, ...] = ("full", "inertia")
WAYS: tuple[type[CompiledForm], ...] = (PinocchioTick, CompiledTick)


def impedances(nv: int) -> dict[str, Any]:
    B = np.random.default_rng(3).normal(size=(nv, nv))
    coupled = B @ B.T + nv * np.eye(nv)
    return {
        "scalar": rbi.Impedance(1.5, 10.0, 20.0),
        "coupled": rbi.Impedance(coupled, 5.0 * coupled, 20.0),
        "finite-time": rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, 0.7),
    }


def controller(arm: rbi.ArmModel, **changes: Any) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(1.5, 10.0, 20.0),
        "surface": SURFACES["fast terminal"],
        "reaching": rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="matched"),
        "dt": DT,
        "backend": "numpy",
    }
    return rbi.ImpedanceController(arm, **(parts | changes))


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> type[CompiledForm]:
    form: type[CompiledForm] = request.param
    return form


def tick(way: type[CompiledForm], specification: rbi.ImpedanceController) -> CompiledForm:
    return way(specification._law)


def take(fast: CompiledForm, state: rbi.ControllerState, *given: Any) -> Any:
    """One tick: output and next state, or None."""
    step, own = fast.step
    return step(own, fast.pack(state), *given)


def draw(arm: rbi.ArmModel, rng: np.random.Generator, ticks: int, step: float = 0.5) -> Arguments:
    """Random measurements near a random reference, some ticks into a run."""
    v_d, a_d, v, tau_ext = rng.normal(0.0, 0.5, (4, arm.nv))
    remembered = rng.normal(0.0, 0.5, (len(rbi.ControllerState._fields) - 1, arm.nv))
    q_d = arm.random_configuration(rng)
    q = arm.integrate(q_d, rng.normal(0.0, step, arm.nv))
    state = rbi.ControllerState(ticks, *remembered)
    return state, q, v, rbi.Reference(q_d, v_d, a_d), 10.0 * tau_ext


def assert_same(
    specification: rbi.ImpedanceController, fast: CompiledForm, arguments: Arguments
) -> None:
    """Bit-close: each array to 1e-13 of what its sum of terms is made of."""
    expected, expected_state = specification.step(*arguments)
    answer = take(fast, *arguments)
    assert answer is not None
    output, state = answer
    withheld = np.zeros(1)
    if not expected.premise_holds.all():  # a system of equations with M was solved
        free, _ = controller_without_limits(specification).step(*arguments)
        M = specification.arm.mass_matrix(arguments[1])
        withheld = np.linalg.cond(M) * (free.u - expected.u)
    terms = {
        "tau": (expected.tau, arguments[-1], withheld),
        "e1": (expected.e1, arguments[1]),
        "u": (expected.u, withheld),
        "x": (expected_state.x, DT * withheld),
        "a": (expected_state.a, expected.s, expected_state.x, arguments[0].x),
    }
    for name in (*expected._fields, *expected_state._fields):
        mine, truth = (
            (getattr(output, name), getattr(expected, name))
            if name in expected._fields
            else (getattr(state, name), getattr(expected_state, name))
        )
        if name in (*FLAGS, "ticks"):
            assert_array_equal(mine, truth, err_msg=name)
            continue
        scale = max(np.abs(term).max() for term in terms.get(name, (truth,)))
        assert_allclose(mine, truth, rtol=0.0, atol=CLOSE * scale, err_msg=name)
    for name in ("q_e", "v_e"):
        truth = getattr(expected_state, name)
        scale = np.abs(truth).max()
        assert_allclose(getattr(state, name), truth, rtol=0.0, atol=CLOSE * scale, err_msg=name)


@functools.lru_cache(maxsize=1)
def controller_without_limits(c: rbi.ImpedanceController) -> rbi.ImpedanceController:
    return rbi.ImpedanceController(
        c.arm, c.impedance, c.surface, c.reaching, c.dt, model=c.model, backend="numpy"
    )


COMBINATIONS = [
    pytest.param(*choice, id="-".join(choice))
    for choice in itertools.product(SURFACES, SCHEMES, KNOWLEDGE)
]


@pytest.fixture(scope="module", params=["manipulator", "spinner", "pendulum"])
def arm(request: pytest.FixtureRequest) -> rbi.ArmModel:
    arm: rbi.ArmModel = getattr(arms, request.param)()
    return arm


@pytest.mark.slow
@pytest.mark.parametrize(("surface", "scheme", "model"), COMBINATIONS)
def test_ticks_are_those_of_the_specification(
    arm: rbi.ArmModel,
    surface: str,
    scheme: Scheme,
    model: Knowledge,
    rng: np.random.Generator,
) -> None:
    reaching = rbi.SuperTwisting(8.0, 10.0, scheme, 3.0 if scheme == "matched" else 1.0)
    scalar, *others = impedances(arm.nv).values()
    pairs = [
        *((limits, scalar) for limits in LIMITS.values()),
        *((LIMITS["both"], x) for x in others),
    ]
    for limits, impedance in pairs:
        specification = controller(
            arm,
            surface=SURFACES[surface],
            reaching=reaching,
            model=model,
            limits=limits,
            impedance=impedance,
        )
        for fast in (tick(way, specification) for way in WAYS):
            for ticks in range(3):
                assert_same(specification, fast, draw(arm, rng, ticks))


@pytest.mark.slow
def test_ticks_near_the_surface_are_those_of_the_specification(
    arm: rbi.ArmModel, way: type[CompiledForm], rng: np.random.Generator
) -> None:
    """Errors within the smoothing radius, where a run spends its time."""
    for surface, scheme in itertools.product(SURFACES.values(), SCHEMES):
        specification = controller(
            arm, surface=surface, reaching=rbi.SuperTwisting(8.0, 10.0, scheme)
        )
        fast = tick(way, specification)
        for _ in range(5):
            (state, *_), q, v, reference, tau_ext = draw(arm, rng, 2), *draw(arm, rng, 2, 1e-4)[1:]
            rest = state._replace(q_e=np.zeros(arm.nv), v_e=np.zeros(arm.nv))
            assert_same(specification, fast, (rest, q, v, reference, tau_ext))


def test_no_error_at_all_gives_the_torque_of_the_model(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    arm = arms.manipulator()
    for surface, scheme in itertools.product(SURFACES.values(), SCHEMES):
        specification = controller(
            arm, surface=surface, reaching=rbi.SuperTwisting(8.0, 10.0, scheme)
        )
        q, v, a = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
        fast = tick(way, specification)
        answer = take(fast, fast.init(), q, v, rbi.Reference(q, v, a), np.zeros(arm.nv))
        assert answer is not None
        truth = arm.inverse_dynamics(q, v, a)
        assert_allclose(answer[0].tau, truth, rtol=0.0, atol=1e-12 * np.abs(truth).max())
        assert (answer[0].s == 0.0).all()


def test_runs_of_ticks_stay_together(
    arm: rbi.ArmModel, way: type[CompiledForm], rng: np.random.Generator
) -> None:
    """Each hands its own state on; with the matched scheme a difference in rounding dies out."""
    specification = controller(arm)
    fast, expected_state = tick(way, specification), specification.init()
    state: rbi.ControllerState = fast.init()
    q, v = arm.random_configuration(rng), np.zeros(arm.nv)
    for k in range(200):
        reference = rbi.Reference(q, v, np.full(arm.nv, np.sin(0.01 * k)))
        tau_ext = np.full(arm.nv, np.cos(0.02 * k))
        expected, expected_state = specification.step(expected_state, q, v, reference, tau_ext)
        answer = take(fast, state, q, v, reference, tau_ext)
        assert answer is not None
        output, state = answer
        assert_allclose(output.tau, expected.tau, rtol=1e-11, atol=1e-11)
    assert state.ticks == 200


def test_a_repeated_tick_gives_the_same_bits(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.spinner()))
    arguments = draw(fast.arm, rng, 2)
    first, second = take(fast, *arguments), take(fast, *arguments)
    assert first is not None
    assert second is not None
    for one, other in zip((*first[0], *first[1]), (*second[0], *second[1]), strict=True):
        assert_array_equal(one, other)


def test_inputs_are_not_changed(way: type[CompiledForm], rng: np.random.Generator) -> None:
    fast = tick(way, controller(arms.spinner(), limits=2.0))
    arguments = draw(fast.arm, rng, 2)
    before = copy.deepcopy(arguments)
    take(fast, *arguments)
    state, q, v, reference, tau_ext = arguments
    for one, other in zip(
        (*state, q, v, *reference, tau_ext),
        (*before[0], *before[1:3], *before[3], before[4]),
        strict=True,
    ):
        assert_array_equal(one, other)


def test_read_only_inputs_are_welcome(way: type[CompiledForm], rng: np.random.Generator) -> None:
    fast = tick(way, controller(arms.manipulator()))
    state, q, v, reference, tau_ext = draw(fast.arm, rng, 1)
    for array in (q, v, *reference, tau_ext):
        array.setflags(write=False)
    assert take(fast, state, q, v, reference, tau_ext) is not None


UNSOUND: dict[str, Any] = {
    "q is NaN": (1, np.nan),
    "v is infinite": (2, np.inf),
    "tau_ext is NaN": (4, np.nan),
}


@pytest.mark.parametrize("name", UNSOUND)
def test_numbers_that_are_not_finite_are_refused(
    way: type[CompiledForm], name: str, rng: np.random.Generator
) -> None:
    index, bad = UNSOUND[name]
    fast = tick(way, controller(arms.manipulator()))
    arguments: list[Any] = list(draw(fast.arm, rng, 1))
    arguments[index][2] = bad
    assert take(fast, *arguments) is None


def test_sizes_that_do_not_fit_are_refused(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.spinner()))
    sound: list[Any] = list(draw(fast.arm, rng, 1))
    for index in (1, 2, 4):
        longer = [*sound]
        longer[index] = np.append(sound[index], 0.0)
        assert take(fast, *longer) is None
    other = draw(arms.manipulator(), rng, 1)[0]
    assert take(fast, other, *sound[1:]) is None


def test_a_pair_that_is_no_cosine_and_sine_is_refused(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.spinner()))
    state, q, v, reference, tau_ext = draw(fast.arm, rng, 1)
    q[:2] *= 1.0 + 2e-6
    assert take(fast, state, q, v, reference, tau_ext) is None


@pytest.mark.parametrize(
    "wrong",
    [
        [0.0] * 6,
        None,
        3.0,
        np.zeros(6, dtype=np.float32),
        np.zeros(6, dtype=np.int64),
        np.zeros(6, dtype=">f8"),
        np.zeros(12)[::2],
        np.zeros((1, 6)),
        np.zeros(7, dtype=np.uint8)[1:].view(np.uint8),
    ],
    ids=repr,
)
def test_what_is_no_plain_vector_is_a_type_error(
    way: type[CompiledForm], wrong: Any, rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.manipulator()))
    arguments: list[Any] = list(draw(fast.arm, rng, 1))
    arguments[2] = wrong
    with pytest.raises(TypeError, match="plain NumPy array"):
        take(fast, *arguments)


def test_what_is_no_state_or_reference_is_a_type_error(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.manipulator()))
    state, q, v, reference, tau_ext = draw(fast.arm, rng, 1)
    step, own = fast.step
    empty, wrong = PackedState.__new__(PackedState), PackedState.__new__(PackedState)
    wrong.block = "text"  # type: ignore[assignment]
    for no_state in (state, empty, wrong, None, 1.0, np.zeros(6), b"text"):
        with pytest.raises(TypeError):
            step(own, no_state, q, v, reference, tau_ext)
    packed = fast.pack(state)
    short = tuple.__new__(rbi.Reference, (q, v))
    hollow: Any = rbi.Reference(q, v, "text")  # type: ignore[arg-type]
    wrong_ones: list[Any] = [tuple(reference), short, hollow, None, 1.0, 2**80, q]
    for no_reference in wrong_ones:
        with pytest.raises(TypeError):
            step(own, packed, q, v, no_reference, tau_ext)
    assert step(own, packed, q, v, reference, tau_ext) is not None


def test_output_and_state_behave_as_the_named_tuples_they_stand_for(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    arm = arms.spinner()
    specification = controller(arm, limits=3.0)
    arguments = draw(arm, rng, 3)
    answer = take(tick(way, specification), *arguments)
    assert answer is not None
    pairs: list[tuple[Any, Any]] = list(zip(answer, specification.step(*arguments), strict=True))
    for mine, plain in pairs:
        assert type(mine.unpacked()) is type(plain)
        assert mine._fields == plain._fields
        assert len(mine) == len(plain)
        for one, other in zip(mine, plain, strict=True):
            assert type(one) is type(other)
            assert np.shape(one) == np.shape(other)
            assert np.asarray(one).dtype == np.asarray(other).dtype
        assert_array_equal(mine[1], getattr(mine, mine._fields[1]))
        again = pickle.loads(pickle.dumps(mine))
        assert type(again) is type(plain)
        assert_array_equal(again[-1], mine[-1])
        assert list(mine._asdict()) == list(plain._fields)
        assert repr(mine).startswith(type(plain).__name__)
    state = answer[1]._replace(ticks=9)
    assert state.ticks == 9
    assert_array_equal(state.z, answer[1].z)


def test_arrays_of_an_output_are_the_users_own_and_those_of_a_state_cannot_change(
    way: type[CompiledForm], rng: np.random.Generator
) -> None:
    fast = tick(way, controller(arms.manipulator()))
    answer = take(fast, *draw(fast.arm, rng, 1))
    assert answer is not None
    output, state = answer
    output.tau[:] = np.nan
    assert np.isfinite(output.tau).all()
    assert output.tau.flags.c_contiguous
    for x in state[1:]:
        with pytest.raises(ValueError, match="read-only"):
            x[0] = 1.0


def test_ticks_can_be_pickled(rng: np.random.Generator) -> None:
    fast = tick(CompiledTick, controller(arms.manipulator()))
    arguments = draw(fast.arm, rng, 1)
    again = take(pickle.loads(pickle.dumps(fast)), *arguments)
    answer = take(fast, *arguments)
    assert answer is not None
    assert_array_equal(again[0].tau, answer[0].tau)


def test_parts_with_methods_of_their_own_are_not_packed() -> None:
    class Mine(rbi.PowerSurface):
        def value(self, e1: Array, e2: Array) -> Array:
            return 2.0 * super().value(e1, e2)

    class Restless(rbi.SuperTwisting):
        def anti_windup(self, state: Any, following: Any, unrealised_u: Array, dt: float) -> Any:
            del state, unrealised_u, dt
            return following

    reaching = rbi.SuperTwisting(8.0, 10.0)
    assert can_pack(SURFACES["power"], reaching)
    assert not can_pack(Mine(3.0, 1.5), reaching)
    assert not can_pack(SURFACES["power"], Restless(8.0, 10.0))
    assert not can_pack(SURFACES["power"], object())


def test_fused_ticks_carry_joints_that_follow_others(rng: np.random.Generator) -> None:
    for limits, model in itertools.product((None, 3.0), KNOWLEDGE):
        specification = controller(arms.follower(), limits=limits, model=model)
        for ticks in range(5):
            arguments = draw(specification.arm, rng, ticks)
            assert_same(specification, tick(PinocchioTick, specification), arguments)


@pytest.mark.slow
def test_a_second_process_compiles_nothing() -> None:
    """The kernels that this process has made or found are on the disk."""
    assert warm_up()
    code = (
        "from numba.core import event\n"
        "from rbimpedance.control.backends import warm_up\n"
        "with event.install_recorder('numba:compile') as recorder: warm_up()\n"
        "print(len(recorder.buffer))"
    )
    run = fresh_python(code)
    assert run.stdout.strip() == "0"


def test_compiled_code_is_available_here() -> None:
    assert is_available()
    assert warm_up()
