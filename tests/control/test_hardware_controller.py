"""The controller for arms as they are delivered: one tick in both forms, and loops on drives and encoders."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.telemetry import Situation
from rbimpedance.simulation.closed_loop import run
from rbimpedance.simulation.run import closed_loop

from ..arms import manipulator, spinner

HARDWARE = rbi.Hardware(encoder_bits=19, torque_lag=2e-3, delay=1, ripple=0.02, stribeck=0.2)
TARGET = rbi.Impedance(1.0, 10.0, 20.0)


def controller(arm: rbi.ArmModel, hardware: rbi.Hardware = HARDWARE, **more: Any) -> Any:
    settings: dict[str, Any] = {"bandwidths": (20.0, 60.0), "k2": 500.0}
    return rbi.HardwareController(arm, hardware, TARGET, **(settings | more))


def inputs(arm: rbi.ArmModel, seed: int) -> tuple[Any, ...]:
    rng = np.random.default_rng(seed)
    q = arm.integrate(arm.neutral, 1e-3 * rng.normal(size=arm.nv))
    reference = rbi.Reference(q, 0.1 * rng.normal(size=arm.nv), rng.normal(size=arm.nv))
    return q, np.zeros(arm.nv), reference, rng.normal(size=arm.nv)


@pytest.mark.parametrize("delay", [0, 3])
def test_compiled_tick_is_the_readable_one(delay: int) -> None:
    arm = spinner()
    forms = [controller(arm, HARDWARE.but(delay=delay), backend=b) for b in ("compiled", "numpy")]
    states = [law.init() for law in forms]
    for k in range(300):
        ticks = [law.step(state, *inputs(arm, k)) for law, state in zip(forms, states, strict=True)]
        states = [state for _, state in ticks]
        for one, other in zip(ticks[0][0], ticks[1][0], strict=True):
            assert one == pytest.approx(other, rel=1e-8, abs=1e-8)
    assert states[0].rows == pytest.approx(states[1].rows, rel=1e-7, abs=1e-7)
    assert states[0].friction.parameters.any()


def test_realtime_tick_is_that_of_the_steps() -> None:
    """To rounding: a·b + c may be rounded once in one kernel and twice in the other."""
    for backend in ("compiled", "numpy"):
        law = controller(spinner(), HARDWARE.but(delay=2), backend=backend)
        state, fast = law.init(), law.realtime()
        for k in range(250):
            output, state = law.step(state, *inputs(law.arm, k))
            torque = fast.torque(*inputs(law.arm, k))
            assert torque == pytest.approx(output.tau, rel=1e-11, abs=1e-11)
        assert fast.state.rows == pytest.approx(state.rows, rel=1e-10, abs=1e-10)


def test_tick_is_pure() -> None:
    law = controller(spinner())
    state = law.init()
    kept: list[Any] = [np.array(part) for part in state]
    first, second = (law.step(state, *inputs(law.arm, 0)) for _ in range(2))
    for one, other in zip(first[0], second[0], strict=True):
        assert np.array_equal(one, other)
    now: Any = state
    assert all(np.array_equal(a, b) for a, b in zip(now, kept, strict=True))


def loop(law: Any, hardware: rbi.Hardware, **more: Any) -> Any:
    arm = law.arm
    plant = arm.with_scaled_inertia(1.1).with_friction(0.5, 1.0)
    encoders = rbi.QuantizedEncoders.for_(hardware, law)
    settings: dict[str, Any] = {
        "environment": rbi.interaction.Push([0, 5.0, 0, 0, 0, 0], start=0.1, duration=0.1),
        "q0": arm.integrate(arm.neutral, 0.02 * np.ones(arm.nv)),
        "duration": 0.4,
        "substeps": 2,
        "integrator": "semi-implicit",
    }
    driven = rbi.DrivenPlant.for_(hardware, plant)
    return closed_loop(
        encoders, driven, rbi.trajectories.hold(arm, arm.neutral), **(settings | more)
    )


def test_compiled_loop_is_the_readable_one() -> None:
    arm = spinner()
    readable = run(loop(controller(arm, backend="numpy"), HARDWARE))
    parts = loop(controller(arm), HARDWARE)
    compiled = rbi.simulate(
        parts.controller,
        parts.engine,
        parts.trajectory,
        environment=parts.environment,
        q0=parts.q,
        duration=0.4,
        substeps=2,
    )
    for name in ("q", "v", "q_r", "e1", "tau", "tau_ext", "e_im"):
        one, other = getattr(compiled, name), getattr(readable, name)
        assert one == pytest.approx(other, rel=1e-6, abs=1e-6 * max(1.0, np.abs(other).max())), name


def test_differences_chatter_where_the_observer_is_quiet() -> None:
    """17 bits to a turn: the torque of the default law, and of this one, from tick to tick."""
    arm, hardware = manipulator().with_armature(0.1), HARDWARE.but(encoder_bits=17)
    usual = rbi.ImpedanceController(arm, TARGET)
    result = [run(loop(law, hardware)) for law in (usual, controller(arm, hardware))]
    rough = [np.abs(np.diff(each.tau[200:], axis=0)).sum() for each in result]
    assert rough[0] > 30.0 * rough[1]


def test_limits_hold_and_the_observer_knows_what_was_sent() -> None:
    arm = manipulator().with_armature(0.1)
    law = controller(arm, limits=rbi.Limits(effort=3.0, rate=100.0))
    state, q = law.init(), arm.integrate(arm.neutral, 0.5 * np.ones(arm.nv))
    reference = rbi.trajectories.hold(arm, arm.neutral)(0.0)
    for _ in range(50):
        output, state = law.step(state, q, np.zeros(arm.nv), reference, np.zeros(arm.nv))
        assert np.abs(output.tau).max() <= 3.0
    assert output.saturated.any()
    assert np.array_equal(state.tau, output.tau)


def test_handover_starts_without_error() -> None:
    arm = manipulator()
    law = controller(arm)
    q, reference, zero = (
        arm.integrate(arm.neutral, 0.1 * np.ones(arm.nv)),
        rbi.trajectories.hold(arm, arm.neutral)(0.0),
        np.zeros(arm.nv),
    )
    now = Situation(q, zero, zero, reference, arm.bias(q, zero), zero)
    output, _ = law.step(law.handover(law.init(), now), q, zero, reference, zero)
    assert output.e1 == pytest.approx(0.0, abs=1e-6)


def test_late_tick_expects_the_arm_where_it_has_moved_to() -> None:
    arm = spinner()
    law = controller(arm)
    _, state = law.step(law.init(), *inputs(arm, 0))
    moving = state.but(observer=state.observer._replace(v=np.ones(arm.nv)))
    late = law.elapsed(moving, 3e-3)
    assert arm.difference(moving.q, late.q) == pytest.approx(2e-3, abs=1e-9)
    with pytest.raises(rbi.InputError):
        law.elapsed(moving, -1.0)


def test_state_is_kept_in_a_snapshot_and_controller_in_a_pickle(tmp_path: Path) -> None:
    law = controller(spinner())
    _, state = law.step(law.init(), *inputs(law.arm, 0))
    path = rbi.save_snapshot(tmp_path / "state", law, state)
    again = rbi.load_snapshot(path, law)
    twin = pickle.loads(pickle.dumps(law))
    one, other = law.step(state, *inputs(law.arm, 1)), twin.step(again, *inputs(law.arm, 1))
    assert np.array_equal(one[0].tau, other[0].tau)


def test_inputs_that_are_not_sound_are_refused() -> None:
    law = controller(spinner())
    q, v, reference, tau_ext = inputs(law.arm, 0)
    with pytest.raises(rbi.NonFiniteError):
        law.step(law.init(), np.full_like(q, np.nan), v, reference, tau_ext)
    with pytest.raises(rbi.DimensionError):
        law.step(law.init(), q, v[:-1], reference, tau_ext)
    with pytest.raises(rbi.ParameterError, match="backend"):
        controller(law.arm, backend="pinocchio")
