"""`backend="compiled"` through the public interface, held to `backend="pinocchio"`."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import sys
from typing import Any, Literal

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.compiled import dynamics, say_once
from rbimpedance.compiled.tables import arm_tables

from . import arms

Array = NDArray[np.float64]
Backend = Literal["pinocchio", "compiled"]
BACKENDS: tuple[Backend, ...] = ("pinocchio", "compiled")
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


def is_compiled(c: rbi.ImpedanceController) -> bool:
    """Whether its ticks come from a kernel; the output only behaves as the named tuple then."""
    zero, q = np.zeros(c.arm.nv), c.arm.neutral
    output, _ = c.step(c.init(), q, zero, rbi.Reference(q, zero, zero), zero)
    return hasattr(output, "block")


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    say_once.cache_clear()
    return caplog


# --- closed loops --------------------------------------------------------------------------------


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("name", ["two_link", "panda"])
def test_closed_loops_of_both_backends_agree(name: str, limited: bool) -> None:
    """Pushed at the tool; with limits, joints saturate on the way."""
    arm = rbi.load_robot("panda", lock=FINGERS) if name == "panda" else rbi.load_robot(name)
    limits = 0.9 * np.abs(arm.bias(arm.neutral, np.zeros(arm.nv))).max() if limited else None
    runs = [
        rbi.simulate(
            controller(arm, backend, limits=limits),
            arm.with_payload(0.5),
            rbi.trajectories.cosine(arm, amplitude=0.1, period=1.0),
            wrench=[5.0, 0.0, -5.0, 0.0, 0.0, 0.0],
            duration=0.5,
            substeps=1,
        )
        for backend in BACKENDS
    ]
    assert runs[0].saturated.any() == limited
    for channel in ("q", "v", "q_r", "e1", "e2", "e_im", "s", "tau"):
        one, other = (getattr(run, channel) for run in runs)
        scale = max(1.0, np.abs(one).max())
        assert_allclose(other, one, rtol=0.0, atol=1e-9 * scale, err_msg=channel)
    assert_array_equal(runs[0].saturated, runs[1].saturated)


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
    assert not is_compiled(default)
    assert is_compiled(parts)


def test_a_repeated_tick_gives_the_same_bits(rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), "compiled", limits=5.0)
    given, other = draw(c.arm, rng), draw(c.arm, rng)
    before = copy.deepcopy(given)
    _, state = c.step(c.init(), *other)
    first = c.step(state, *given)
    c.step(state, *other)
    assert_same(c.step(state, *given), first)
    for one, kept in zip((*given[:2], *given[2]), (*before[:2], *before[2]), strict=True):
        assert_array_equal(one, kept)


def test_a_state_goes_from_one_backend_to_the_other(rng: np.random.Generator) -> None:
    plain, fast = (controller(arms.manipulator(), backend) for backend in BACKENDS)
    first, second = draw(plain.arm, rng), draw(plain.arm, rng)
    truth = plain.step(plain.step(plain.init(), *first)[1], *second)
    assert_same(fast.step(plain.step(plain.init(), *first)[1], *second), truth, 1e-12, 1e-12)
    assert_same(plain.step(fast.step(fast.init(), *first)[1], *second), truth, 1e-12, 1e-12)


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


@pytest.mark.parametrize("name", CONVERSIONS)
def test_what_holds_the_same_numbers_gives_the_same_torque(
    name: str, rng: np.random.Generator
) -> None:
    c, convert = controller(arms.spinner(), "compiled"), CONVERSIONS[name]
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
    for backend in BACKENDS:
        c = controller(arms.spinner(), backend)
        with pytest.raises(rbi.InputError) as error:
            c.step(c.init(), *arguments)
        caught.append(error.value)
    assert type(caught[0]) is type(caught[1])
    assert str(caught[0]) == str(caught[1])


# --- the controller as an object -----------------------------------------------------------------


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(rbi.GainError, match='"pinocchio" or "compiled"'):
        controller(arms.pendulum(), "numba")  # type: ignore[arg-type]


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
@pytest.mark.parametrize("backend", BACKENDS)
def test_controllers_can_be_copied(backend: Backend, way: Any, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend, limits=3.0, knowledge="mass")
    again, given = way(c), draw(c.arm, rng)
    assert again.backend == backend
    assert is_compiled(again) == (backend == "compiled")
    assert_same(again.step(again.init(), *given), c.step(c.init(), *given))


@pytest.mark.parametrize("backend", BACKENDS)
def test_another_impedance_keeps_the_backend(backend: Backend, rng: np.random.Generator) -> None:
    c, softer = controller(arms.spinner(), backend), rbi.Impedance(1.0, 5.0, 10.0)
    given = draw(c.arm, rng)
    other = c.with_impedance(softer)
    anew = controller(c.arm, backend, impedance=softer)
    assert is_compiled(other) == (backend == "compiled")
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
    monkeypatch.setattr(dynamics.CompiledDynamics, "_check", lambda _, arm: seen.append(arm.name))
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


@pytest.mark.parametrize("name", ["panda with fingers", "follower", "screw"])
def test_dynamics_without_tables_are_left_to_pinocchio(
    name: str, said: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    arm = {"follower": arms.follower, "screw": screw}.get(name, lambda: rbi.load_robot("panda"))()
    for limits in (None, 3.0):
        plain, fast = (controller(arm, backend, limits=limits) for backend in BACKENDS)
        assert is_compiled(fast)
        for _ in range(5):
            given = draw(arm, rng)
            truth = plain.step(plain.init(), *given)
            scale = max(np.abs(x).max() for x in truth[0])
            assert_same(fast.step(fast.init(), *given), truth, 1e-12, 1e-12 * scale)
    assert [record.name for record in said.records] == ["rbimpedance"]
    assert f"'{arm.name}' are left to Pinocchio" in said.text


def test_a_filter_that_is_not_linear_is_called_as_it_is(rng: np.random.Generator) -> None:
    target = rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, 0.7)
    plain, fast = (controller(arms.spinner(), x, impedance=target) for x in BACKENDS)
    assert is_compiled(fast)
    one, other = plain.init(), fast.init()
    for _ in range(20):
        given = draw(plain.arm, rng)
        (output, one), (mine, other) = plain.step(one, *given), fast.step(other, *given)
        assert_same((mine, other), (output, one), 1e-10, 1e-10)


def test_a_surface_of_the_users_own_is_left_to_numpy(
    said: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    class Mine(rbi.PowerSurface):
        pass

    plain, fast = (controller(arms.spinner(), x, surface=Mine(3.0, 1.5)) for x in BACKENDS)
    given = draw(plain.arm, rng)
    assert_same(fast.step(fast.init(), *given), plain.step(plain.init(), *given))
    assert not is_compiled(fast)
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


def test_without_numba_numpy_computes_and_that_is_said_once() -> None:
    run = _in_a_new_process(
        "import sys, numpy as np, rbimpedance as rbi\n"
        "from rbimpedance import compiled\n"
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


def test_the_default_backend_does_not_load_numba() -> None:
    run = _in_a_new_process(
        "import sys, rbimpedance as rbi\n"
        "parts = rbi.Impedance(1, 10, 20), rbi.PowerSurface(3, 1.5), rbi.SuperTwisting(8, 10)\n"
        "rbi.ImpedanceController(rbi.load_robot('two_link'), *parts, 1e-3).warm_up()\n"
        "print('numba' in sys.modules)"
    )
    assert run.stdout.strip() == "False"
