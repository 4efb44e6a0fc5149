"""The tick that keeps its state and writes its torque in place, held to `ImpedanceController.step`."""

from __future__ import annotations

import gc
import tracemalloc
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi

from .. import arms
from .test_backends import BACKENDS, FINITE_TIME, Backend, controller, draw

Array = NDArray[np.float64]


class OwnSurface(rbi.PowerSurface):
    """One that is not compiled."""

    def value(self, e1: Array, e2: Array) -> Array:
        return super().value(e1, e2)


CONTROLLERS: dict[str, dict[str, Any]] = {
    "linear": {},
    "limited": {"limits": rbi.Limits(effort=5.0, rate=2e3)},
    "finite-time": {"impedance": FINITE_TIME},
    "mass only": {"model": "inertia"},
    "not compiled": {"surface": OwnSurface(3.0, 1.5)},
}


def same_bits(one: rbi.ControllerState, other: rbi.ControllerState) -> bool:
    pairs: Any = zip(one, other, strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", CONTROLLERS)
def test_torques_and_states_are_those_of_step(
    backend: Backend, name: str, rng: np.random.Generator
) -> None:
    c = controller(arms.spinner(), backend, **CONTROLLERS[name])
    lean, state = c.realtime(), c.init()
    for k in range(10):
        given, period = draw(c.arm, rng), (1.2e-3 if k == 5 else None)
        output, state = c.step(state, *given, period=period)
        assert_array_equal(lean.torque(*given, period=period), output.tau)
        assert same_bits(lean.state, state)


@pytest.mark.parametrize("backend", BACKENDS)
def test_torque_is_always_the_same_array(backend: Backend, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend)
    lean = c.realtime()
    tau = lean.tau
    q, v, reference, tau_ext = draw(c.arm, rng)
    assert lean.torque(q, v, reference, tau_ext) is tau
    assert lean.torque(q.tolist(), v, reference, tau_ext) is tau
    assert tau.any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_lean_controller_starts_from_any_state_and_again(
    backend: Backend, rng: np.random.Generator
) -> None:
    c = controller(arms.spinner(), backend)
    given, other = draw(c.arm, rng), draw(c.arm, rng)
    _, state = c.step(c.init(), *other)
    output, _ = c.step(state, *given)
    first, _ = c.step(c.init(), *given)
    lean = c.realtime(state)
    assert_array_equal(lean.torque(*given), output.tau)
    lean.reset()
    assert_array_equal(lean.torque(*given), first.tau)
    lean.reset(state)
    assert_array_equal(lean.torque(*given), output.tau)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("index", range(4))
def test_a_bad_input_is_an_error_and_changes_nothing(
    backend: Backend, index: int, rng: np.random.Generator
) -> None:
    c = controller(arms.spinner(), backend, limits=5.0)
    lean, given = c.realtime(), draw(c.arm, rng)
    lean.torque(*given)
    tau, state = lean.tau.copy(), lean.state
    nan = np.full(c.arm.nv, np.nan)
    wrong: tuple[Any, ...] = nan, np.zeros(9), "up", None
    for bad in wrong:
        arguments: list[Any] = list(given)
        arguments[index] = rbi.Reference(given[2].q, bad, nan) if index == 2 else bad
        with pytest.raises(rbi.InputError):
            lean.torque(*arguments)
        assert_array_equal(lean.tau, tau)
        assert same_bits(lean.state, state)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_state_that_was_asked_for_stays_as_it_was(
    backend: Backend, rng: np.random.Generator
) -> None:
    c = controller(arms.spinner(), backend)
    lean, given = c.realtime(), draw(c.arm, rng)
    lean.torque(*given)
    state = lean.state
    z = state.z
    lean.torque(*given)
    assert_array_equal(state.z, z)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_ticks_leave_no_memory_behind(backend: Backend, rng: np.random.Generator) -> None:
    c = controller(arms.spinner(), backend, limits=5.0)
    lean, state, given = c.realtime(), c.init(), draw(c.arm, rng)

    def run(ticks: int) -> None:
        nonlocal state
        for _ in range(ticks):
            lean.torque(*given)
            _, state = c.step(state, *given)

    run(100)
    gc.collect()
    tracemalloc.start()
    try:
        run(100)
        before = tracemalloc.get_traced_memory()[0]
        run(2000)
        after = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert after - before < 2000  # less than a byte a tick
