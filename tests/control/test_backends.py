"""The compiled backends through the public interface, compared with "numpy", which specifies them."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance._common.frozen import set_fields
from rbimpedance._numba import COMPILING, warn_once
from rbimpedance.control.backends import warm_up
from rbimpedance.control.compiled import forms
from rbimpedance.robot.compiled import dynamics
from rbimpedance.robot.compiled.tables import arm_tables
from rbimpedance.robot.mimic_dynamics import pinocchio_dynamics

from .. import arms

Array = NDArray[np.float64]
Backend = Literal["numpy", "pinocchio", "compiled"]
BACKENDS: tuple[Backend, ...] = ("pinocchio", "compiled")
FINITE_TIME = rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, 0.7)
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def controller(arm: rbi.ArmModel, backend: Backend, **changes: Any) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(1.5, 10.0, 20.0),
        "surface": rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6),
        "reaching": rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="matched"),
        "dt": 1e-3,
    }
    return rbi.ImpedanceController(arm, **(parts | changes), backend=backend)


def draw(arm: rbi.ArmModel, rng: np.random.Generator) -> tuple[Array, Array, rbi.Reference, Array]:
    """Random q, v, reference and tau_ext."""
    v, v_d, a_d, tau_ext = rng.normal(size=(4, arm.nv))
    q, q_d = arm.random_configuration(rng), arm.random_configuration(rng)
    return q, v, rbi.Reference(q_d, v_d, a_d), tau_ext


def assert_same(
    one: tuple[Any, Any], other: tuple[Any, Any], rtol: float = 0.0, atol: float = 0.0
) -> None:
    """Equal outputs and states; by default to the last bit."""
    for mine, truth in zip((*one[0], *one[1]), (*other[0], *other[1]), strict=True):
        assert_allclose(mine, truth, rtol=rtol, atol=atol)


def readable(c: rbi.ImpedanceController) -> rbi.ImpedanceController:
    """The same controller by the specification."""
    return rbi.ImpedanceController(
        c.arm,
        c.impedance,
        c.surface,
        c.reaching,
        c.dt,
        model=c.model,
        limits=c.limits,
        backend="numpy",
    )


def is_compiled(c: rbi.ImpedanceController) -> bool:
    """Whether its ticks come from a kernel; the output only behaves as the named tuple then."""
    zero, q = np.zeros(c.arm.nv), c.arm.neutral
    output, _ = c.step(c.init(), q, zero, rbi.Reference(q, zero, zero), zero)
    return hasattr(output, "block")


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    warm_up()  # the first compilation on a machine is logged, too
    warn_once.cache_clear()
    return caplog


# --- closed loops --------------------------------------------------------------------------------


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("name", ["two_link", "panda"])
def test_closed_loops_are_those_of_the_numpy_form(name: str, limited: bool) -> None:
    """Pushed at the tool; with limits, joints saturate on the way."""
    arm = rbi.load_robot("panda", lock=FINGERS) if name == "panda" else rbi.load_robot(name)
    limits = 0.9 * np.abs(arm.bias(arm.neutral, np.zeros(arm.nv))).max() if limited else None
    forms = [controller(arm, backend, limits=limits) for backend in BACKENDS]
    runs = [
        rbi.simulate(
            form,
            arm.with_payload(0.5),
            rbi.trajectories.cosine(arm, amplitude=0.1, period=1.0),
            environment=[5.0, 0.0, -5.0, 0.0, 0.0, 0.0],
            duration=0.5,
            substeps=1,
        )
        for form in (readable(forms[0]), *forms)
    ]
    truth = runs[0]
    assert truth.saturated.any() == limited
    for channel in ("q", "v", "q_r", "e1", "e2", "e_im", "s", "tau"):
        expected = getattr(truth, channel)
        scale = max(1.0, np.abs(expected).max())
        for run in runs[1:]:
            mine = getattr(run, channel)
            assert_allclose(mine, expected, rtol=0.0, atol=1e-9 * scale, err_msg=channel)
    for run in runs[1:]:
        assert_array_equal(run.saturated, truth.saturated)


def test_provenance_names_the_backend() -> None:
    arm = arms.pendulum()
    for backend in BACKENDS:
        run = rbi.simulate(
            controller(arm, backend), arm, rbi.trajectories.hold(arm), duration=0.002
        )
        assert json.loads(json.dumps(run.provenance))["controller"]["backend"] == backend


# --- one tick ------------------------------------------------------------------------------------


def test_the_default_is_pinocchio() -> None:
    arm = arms.pendulum()
    parts = controller(arm, "compiled")
    default = rbi.ImpedanceController(arm, parts.impedance, parts.surface, parts.reaching, parts.dt)
    assert default.backend == "pinocchio"


@pytest.mark.parametrize("backend", BACKENDS)
def test_ticks_are_compiled_and_those_of_the_numpy_form(
    backend: Backend, rng: np.random.Generator
) -> None:
    for arm in (arms.manipulator(), arms.spinner(), arms.pendulum()):
        fast = controller(arm, backend, limits=5.0)
        assert is_compiled(fast)
        assert not is_compiled(readable(fast))
        given = draw(arm, rng)
        truth = readable(fast).step(readable(fast).init(), *given)
        scale = max(np.abs(x).max() for x in truth[0])
        assert_same(fast.step(fast.init(), *given), truth, 1e-12, 1e-12 * scale)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_repeated_tick_gives_the_same_bits(backend: Backend, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend, limits=5.0)
    given, other = draw(c.arm, rng), draw(c.arm, rng)
    before = copy.deepcopy(given)
    _, state = c.step(c.init(), *other)
    first = c.step(state, *given)
    c.step(state, *other)
    assert_same(c.step(state, *given), first)
    for one, kept in zip((*given[:2], *given[2]), (*before[:2], *before[2]), strict=True):
        assert_array_equal(one, kept)


class Meeting(rbi.Impedance):
    """A target whose filter lets every tick wait, half done, for one of another thread."""

    barrier: threading.Barrier | None = None

    def filter(self, nv: int, dt: float) -> Any:
        exact = super().filter(nv, dt)

        def advance(*given: Any) -> Any:
            if self.barrier is not None:
                self.barrier.wait(timeout=10.0)
            return exact.advance(*given)

        return SimpleNamespace(acceleration=exact.acceleration, advance=advance)


def assert_threads_get_what_each_gets_alone(
    c: rbi.ImpedanceController, meet: Callable[[threading.Barrier | None], None]
) -> None:
    """Two ticks of one controller at a time; `meet` lets each of them wait for the other."""
    rng = np.random.default_rng(7)
    state = c.step(c.init(), *draw(c.arm, rng))[1]
    given = [draw(c.arm, rng) for _ in range(2)]
    alone = [c.step(state, *one) for one in given]
    meet(threading.Barrier(2))
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda one: c.step(state, *one), given))
    meet(None)
    for one, other in zip(together, alone, strict=True):
        assert_same(one, other)


@pytest.mark.parametrize("backend", BACKENDS)
def test_ticks_of_two_threads_at_once_in_a_filter_do_not_mix(backend: Backend) -> None:
    target = Meeting(1.5, 10.0, 20.0)

    def meet(barrier: threading.Barrier | None) -> None:
        set_fields(target, barrier=barrier)

    assert_threads_get_what_each_gets_alone(
        controller(arms.spinner(), backend, impedance=target), meet
    )


def test_ticks_of_two_threads_at_once_in_pinocchio_do_not_mix(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    barriers: list[threading.Barrier | None] = [None]

    def meet(barrier: threading.Barrier | None) -> None:
        barriers[0] = barrier

    def waiting(model: Any) -> Any:
        exact = pinocchio_dynamics(model)

        def rnea(*given: Any) -> Any:
            if barriers[0] is not None:
                barriers[0].wait(timeout=10.0)
            return exact.rnea(*given)

        return SimpleNamespace(rnea=rnea, mass_matrix=exact.mass_matrix)

    monkeypatch.setattr(forms, "pinocchio_dynamics", waiting)
    c = controller(arms.spinner(), "pinocchio", limits=5.0)
    assert_threads_get_what_each_gets_alone(c, meet)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("period", [None, 1.3e-3])
def test_a_state_goes_from_one_form_to_the_other(
    backend: Backend, period: float | None, rng: np.random.Generator
) -> None:
    fast = controller(arms.manipulator(), backend)
    plain = readable(fast)
    first, second = draw(plain.arm, rng), draw(plain.arm, rng)
    truth = plain.step(plain.step(plain.init(), *first)[1], *second, period)
    for one, other in ((fast, plain), (plain, fast), (fast, fast)):
        after = other.step(other.init(), *first)[1]
        assert_same(one.step(after, *second, period), truth, 1e-12, 1e-12)


def _unaligned(x: Array) -> Array:
    raw = np.zeros(8 * len(x) + 1, dtype=np.uint8)[1:].view(np.float64)
    raw[:] = x
    return raw


CONVERSIONS: dict[str, Any] = {
    "list": lambda x: x.tolist(),
    "strided": lambda x: np.repeat(x, 2)[::2],
    "big-endian": lambda x: x.astype(">f8"),
    "read-only": lambda x: np.frombuffer(x.tobytes()),
    "unaligned": _unaligned,
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", CONVERSIONS)
def test_what_holds_the_same_numbers_gives_the_same_torque(
    name: str, backend: Backend, rng: np.random.Generator
) -> None:
    c, convert = controller(arms.spinner(), backend), CONVERSIONS[name]
    q, v, reference, tau_ext = draw(c.arm, rng)
    expected, _ = c.step(c.init(), q, v, reference, tau_ext)
    other = rbi.Reference(*map(convert, reference))
    output, _ = c.step(c.init(), convert(q), convert(v), other, convert(tau_ext))
    assert_allclose(output.tau, expected.tau, rtol=1e-12, atol=1e-12)


def _wrong() -> dict[str, tuple[int, Any]]:
    nan, zero = np.full(4, np.nan), np.zeros(3)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    return {
        "q is NaN": (0, nan),
        "q is too short": (0, zero),
        "q is no pair": (0, np.array([2.0, 0.0, 0.0, 0.0])),
        "q is text": (0, "up"),
        "v is infinite": (1, np.array([0.0, np.inf, 0.0])),
        "v is a matrix": (1, np.zeros((3, 1))),
        "v is ragged": (1, [0.0, [0.0], 0.0]),
        "reference is no triple": (2, (q, zero)),
        "reference is None": (2, None),
        "reference.q is NaN": (2, rbi.Reference(nan, zero, zero)),
        "reference.a is too long": (2, rbi.Reference(q, zero, np.zeros(4))),
        "tau_ext is complex": (3, zero + 1j),
        "tau_ext is NaN": (3, nan[:3]),
    }


@pytest.mark.parametrize("name", _wrong())
def test_errors_are_those_of_the_readable_form(name: str, rng: np.random.Generator) -> None:
    index, bad = _wrong()[name]
    arguments: list[Any] = list(draw(arms.spinner(), rng))
    arguments[index] = bad
    caught = []
    forms = [controller(arms.spinner(), backend) for backend in BACKENDS]
    for c in (readable(forms[0]), *forms):
        with pytest.raises(rbi.InputError) as error:
            c.step(c.init(), *arguments)
        caught.append(error.value)
    assert len({(type(error), str(error)) for error in caught}) == 1


# --- the controller as an object -----------------------------------------------------------------


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match='"numpy", "pinocchio" or "compiled"'):
        controller(arms.pendulum(), "numba")  # type: ignore[arg-type]


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
@pytest.mark.parametrize("backend", BACKENDS)
def test_controllers_can_be_copied(backend: Backend, way: Any, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend, limits=3.0, model="inertia")
    again, given = way(c), draw(c.arm, rng)
    assert again.backend == backend
    assert is_compiled(again)
    assert_same(again.step(again.init(), *given), c.step(c.init(), *given))


@pytest.mark.parametrize("backend", BACKENDS)
def test_another_impedance_keeps_the_backend(backend: Backend, rng: np.random.Generator) -> None:
    c, softer = controller(arms.spinner(), backend), rbi.Impedance(1.0, 5.0, 10.0)
    given = draw(c.arm, rng)
    other = c.with_impedance(softer)
    anew = controller(c.arm, backend, impedance=softer)
    assert is_compiled(other)
    assert_same(other.step(other.init(), *given), anew.step(anew.init(), *given))


@pytest.mark.parametrize("backend", BACKENDS)
def test_warming_up_changes_nothing(backend: Backend, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend)
    given = draw(c.arm, rng)
    before = c.step(c.init(), *given)
    c.warm_up()
    assert_same(c.step(c.init(), *given), before)


def test_agreement_is_checked_once_for_each_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(
        dynamics.CompiledDynamics, "_check", lambda _, arm, *__: seen.append(arm.name)
    )
    c = controller(arms.manipulator(), "compiled")
    c.with_impedance(rbi.Impedance(1.0, 5.0, 10.0))
    assert seen == ["manipulator"]


# --- what cannot be compiled ---------------------------------------------------------------------


def screw() -> rbi.ArmModel:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelHZ(0.1), pin.SE3.Identity(), "screw")
    inertia = pin.Inertia(2.0, np.array([0.1, 0.2, 0.3]), np.diag([0.1, 0.2, 0.25]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return rbi.ArmModel(model, name="screw", tool_frame="tip")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["panda with fingers", "follower", "screw"])
def test_dynamics_without_tables_are_left_to_pinocchio_and_compiled_says_so_once(
    name: str, backend: Backend, said: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    arm = {"follower": arms.follower, "screw": screw}.get(name, lambda: rbi.load_robot("panda"))()
    for limits in (None, 3.0):
        fast = controller(arm, backend, limits=limits)
        plain = readable(fast)
        assert is_compiled(fast)
        for _ in range(5):
            given = draw(arm, rng)
            truth = plain.step(plain.init(), *given)
            scale = max(np.abs(x).max() for x in truth[0])
            assert_same(fast.step(fast.init(), *given), truth, 1e-12, 1e-12 * scale)
    assert [record.name for record in said.records] == ["rbimpedance"] * (backend == "compiled")
    assert (f"'{arm.name}' are left to Pinocchio" in said.text) == (backend == "compiled")


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_filter_that_is_not_linear_is_called_as_it_is(
    backend: Backend, rng: np.random.Generator
) -> None:
    fast = controller(arms.spinner(), backend, impedance=FINITE_TIME)
    plain = readable(fast)
    assert is_compiled(fast)
    one, other = plain.init(), fast.init()
    for _ in range(20):
        given = draw(plain.arm, rng)
        (output, one), (mine, other) = plain.step(one, *given), fast.step(other, *given)
        assert_same((mine, other), (output, one), 1e-10, 1e-10)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_surface_with_methods_of_its_own_is_left_to_numpy(
    backend: Backend, said: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    class Mine(rbi.PowerSurface):
        def value(self, e1: Array, e2: Array) -> Array:
            return super().value(e1, e2)

    c = controller(arms.spinner(), backend, surface=Mine(3.0, 1.5))
    known = controller(arms.spinner(), backend, surface=rbi.PowerSurface(3.0, 1.5))
    given = draw(c.arm, rng)
    assert_same(c.step(c.init(), *given), readable(known).step(readable(known).init(), *given))
    assert not is_compiled(c)
    assert "no compiled form of Mine" in said.text


def test_dynamics_that_differ_from_pinocchio_are_not_served(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrong = arm_tables(arms.manipulator().with_scaled_inertia(1.0 + 1e-9))
    monkeypatch.setattr(dynamics, "arm_tables", lambda _: wrong)
    with pytest.raises(rbi.ModelError, match="differs from Pinocchio"):
        controller(arms.manipulator(), "compiled")


def _in_a_new_process(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True
    )


@pytest.mark.slow
def test_the_first_compilation_on_a_machine_is_said_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    code = "import rbimpedance as rbi; rbi.ImpedanceController(rbi.load_robot('two_link'))"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert _in_a_new_process(code).stderr.splitlines() == [COMPILING]
    assert _in_a_new_process(code).stderr == ""


@pytest.mark.slow
def test_without_numba_numpy_computes_and_that_is_said_once() -> None:
    run = _in_a_new_process(
        "import sys, numpy as np, rbimpedance as rbi\n"
        "from rbimpedance.control import backends as compiled\n"
        "sys.modules['numba'] = None\n"
        "arm, zero = rbi.load_robot('two_link'), np.zeros(2)\n"
        "parts = rbi.Impedance(1, 10, 20), rbi.PowerSurface(3, 1.5), rbi.SuperTwisting(8, 10)\n"
        "taus = []\n"
        "for backend in ('pinocchio', 'compiled', 'compiled'):\n"
        "    c = rbi.ImpedanceController(arm, *parts, 1e-3, backend=backend)\n"
        "    c.warm_up()\n"
        "    output, _ = c.step(c.init(), [1, 2], zero, rbi.Reference(zero, zero, zero), zero)\n"
        "    taus.append(output.tau.tolist())\n"
        "print(taus[0] == taus[1] == taus[2], compiled.is_available(), compiled.warm_up())\n"
    )
    assert run.stdout.split() == ["True", "False", "False"]
    assert run.stderr.count("NumPy computes the same") == 1
