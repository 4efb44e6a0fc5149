"""The run-time policy: whatever comes in, what goes out is finite and within the limits, and says why."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.baselines import PDGravity
from rbimpedance.control.guards.energy_tank import EnergyTank
from rbimpedance.control.guards.fault_guard import FaultEvent, FaultGuard, GuardedOutput
from rbimpedance.control.guards.faults import Fault, FaultError, OperatingRange
from rbimpedance.control.guards.reference_guard import ReferenceGuard
from rbimpedance.trajectories import Reference, cosine, hold

from .. import laws
from ..arms import pendulum, spinner
from ..isolation import fresh_python

Array = NDArray[np.float64]
DT = 1e-3
EFFORT, RATE = 60.0, 3000.0


def law(arm: rbi.ArmModel, **more: Any) -> rbi.ImpedanceController:
    return laws.controller(
        arm, 15.0, 40.0, dt=DT, limits=more.pop("limits", rbi.Limits(EFFORT, RATE)), **more
    )


Corruption = Callable[[int, dict[str, Any]], None]
"""Changes the inputs q, v, reference, tau_ext of a tick in place."""


def run(
    guard: Any,
    corrupt: Corruption | None = None,
    ticks: int = 800,
    *,
    plant: rbi.ArmModel | None = None,
    trajectory: Any = None,
    push: Any = 0.0,
) -> tuple[list[Any], Array, Array, Any]:
    """Outputs, configurations (one more), velocities and last state of a closed loop with corrupted inputs."""
    arm = guard.arm
    plant = (plant or arm).copy()
    trajectory = trajectory or cosine(arm, amplitude=0.2, period=2.0)
    state, (q, v, _) = guard.init(), trajectory(0.0)
    tau_ext = np.broadcast_to(np.asarray(push, dtype=float), (arm.nv,))
    outputs, configurations, velocities = [], [q], [v]
    for k in range(ticks):
        inputs = {"q": q, "v": v, "reference": trajectory(k * DT), "tau_ext": tau_ext}
        if corrupt is not None:
            corrupt(k, inputs)
        output, state = guard.step(state, **inputs)
        for _ in range(2):
            v = v + DT / 2.0 * plant.forward_dynamics(q, v, output.tau + tau_ext)
            q = plant.integrate(q, DT / 2.0 * v)
        outputs.append(output)
        configurations.append(q)
        velocities.append(v)
    return outputs, np.array(configurations), np.array(velocities), state


def torques(outputs: list[Any]) -> Array:
    return np.array([output.tau for output in outputs])


def assert_within_limits(tau: Array) -> None:
    assert np.isfinite(tau).all()
    assert np.abs(tau).max() <= EFFORT
    steps = np.abs(np.diff(tau, axis=0)).max()
    assert steps <= RATE * DT * (1.0 + 1e-12)


def between(start: int, stop: int, change: Callable[[dict[str, Any]], None]) -> Corruption:
    def corrupt(k: int, inputs: dict[str, Any]) -> None:
        if start <= k < stop:
            change(inputs)

    return corrupt


def lost(name: str) -> Callable[[dict[str, Any]], None]:
    return lambda inputs: inputs.update({name: np.asarray(inputs[name]) * np.nan})


def freezes(start: int, stop: int, joint: int | None = None, names: str = "qv") -> Corruption:
    """All joints, or one that is counted from the end, stay where they are; q and v, or one of them."""
    kept: dict[str, Any] = {}
    which = slice(None) if joint is None else slice(joint, joint + 1 or None)

    def corrupt(k: int, inputs: dict[str, Any]) -> None:
        if k == start:
            kept.update({name: inputs[name] for name in names})
        if start <= k < stop:
            for name, x in kept.items():
                inputs[name] = np.array(inputs[name])
                inputs[name][which] = x[which]

    return corrupt


# --- nothing is wrong -----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrap", [lambda x: x, ReferenceGuard, EnergyTank], ids=["law", "guard", "tank"]
)
def test_guard_is_out_of_the_way_while_all_is_well(wrap: Any) -> None:
    arm = rbi.load_robot("two_link")
    controller = wrap(law(arm))
    guarded, *_ = run(FaultGuard(controller, "raise"), ticks=200)
    alone, *_ = run(controller, ticks=200)
    assert_array_equal(torques(guarded), torques(alone))
    assert {output.response for output in guarded} == {"run"}
    assert {output.fault for output in guarded} == {None}


@pytest.mark.slow
def test_rest_is_no_frozen_sensor() -> None:
    """An arm that holds still, and says so with the same bits at every tick."""
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), "raise")
    state, reference = guard.init(), hold(arm)(0.0)
    for _ in range(300):
        output, state = guard.step(state, arm.neutral, np.zeros(2), reference, np.zeros(2))
    assert output.response == "run"


def test_guard_runs_in_simulate_and_with_a_baseline() -> None:
    arm = pendulum()
    guard = FaultGuard(PDGravity(arm, rbi.Impedance(1.0, 10.0, 20.0), DT), limits=EFFORT)
    result = rbi.simulate(guard, arm, hold(arm), duration=0.02)
    assert np.abs(result.tau).max() <= EFFORT


# --- what is found, and what is done --------------------------------------------------------------

FAULTS: dict[str, tuple[Callable[[dict[str, Any]], None], str, str]] = {
    "q is lost": (lost("q"), "not finite", "q"),
    "v is lost": (lost("v"), "not finite", "v"),
    "tau_ext is lost": (lost("tau_ext"), "not finite", "tau_ext"),
    "infinite": (lambda x: x.update(v=np.full(2, np.inf)), "not finite", "v"),
    "short": (lambda x: x.update(q=x["q"][:1]), "malformed", "q"),
    "text": (lambda x: x.update(tau_ext=["a", "b"]), "malformed", "tau_ext"),
    "nothing": (lambda x: x.update(q=None), "malformed", "q"),
    "no reference": (lambda x: x.update(reference=None), "malformed", "reference"),
    "lost reference": (
        lambda x: x.update(reference=x["reference"]._replace(a=np.full(2, np.nan))),
        "not finite",
        "reference",
    ),
    "spike": (lambda x: x.update(q=x["q"] + [0.0, 0.5]), "jump", "q"),
    "bytes in the wrong order": (lambda x: x.update(q=(x["q"] + 0.01).byteswap()), "jump", "q"),
    "speed": (lambda x: x.update(v=x["v"] + 300.0), "inconsistent", "v"),
    "torque": (lambda x: x.update(tau_ext=np.full(2, 1e5)), "out of range", "tau_ext"),
    "overflow": (
        lambda x: x.update(reference=x["reference"]._replace(a=np.full(2, 1e308))),
        "controller",
        "tau",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(("change", "kind", "name"), FAULTS.values(), ids=FAULTS)
@pytest.mark.parametrize("policy", ["hold", "stop"])
def test_fault_is_named_met_and_overcome(policy: Any, change: Any, kind: str, name: str) -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), policy, range=OperatingRange(arm, velocity=5.0), patience=4)
    outputs, _, _, _ = run(guard, between(300, 308, change), ticks=330)
    assert_within_limits(torques(outputs))
    responses = [output.response for output in outputs]
    back = 308 if kind == "controller" else 311  # that one is tried, not judged, every 4 ticks
    tried = (
        (303,) if kind == "controller" else ()
    )  # it is found only after a tick from where the arm is
    met = [k for k in range(300, back) if responses[k] == policy]
    assert responses[:300] + responses[back:] == ["run"] * (330 - back + 300)
    assert len(met) >= back - 300 - len(tried)
    assert {(outputs[k].fault.kind, outputs[k].fault.name) for k in met} == {(kind, name)}


@pytest.mark.parametrize(("change", "kind", "name"), FAULTS.values(), ids=FAULTS)
def test_policy_that_raises_names_the_fault(change: Any, kind: str, name: str) -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), "raise", range=OperatingRange(arm, velocity=5.0))
    with pytest.raises(FaultError) as raised:
        run(guard, between(30, 31, change), ticks=40)
    assert (raised.value.fault.kind, raised.value.fault.name) == (kind, name)
    assert isinstance(raised.value, rbi.InputError)
    assert str(pickle.loads(pickle.dumps(raised.value))) == raised.value.fault.message


@pytest.mark.parametrize("policy", ["raise", "hold", "stop"])
def test_first_tick_has_nothing_to_fall_back_on(policy: Any) -> None:
    guard = FaultGuard(law(rbi.load_robot("two_link")), policy)
    with pytest.raises(FaultError, match="q must be finite"):
        run(guard, between(0, 1, lost("q")), ticks=1)


def test_output_says_what_is_done_and_why() -> None:
    arm = rbi.load_robot("two_link")
    events: list[FaultEvent] = []
    guard = FaultGuard(law(arm), "hold", longest_hold=0.05, on_event=events.append)
    outputs, *_ = run(guard, between(300, 400, lost("q")), ticks=450)
    said = [output.response for output in outputs]
    assert said == ["run"] * 300 + ["hold"] * 50 + ["stop"] * 54 + ["run"] * 46
    fault = outputs[320].fault
    assert fault.kind == "not finite"
    assert fault.name == "q"
    assert "entry 0, 1 is NaN" in fault.message
    assert [(event.tick, event.response) for event in events] == [
        (300, "hold"),
        (350, "stop"),
        (404, "run"),
    ]
    assert events[-1].fault is None
    assert not outputs[320].premise_holds.any()
    assert_allclose(outputs[320].u, 0.0)


@pytest.mark.parametrize("names", ["qv", "q"])
def test_frozen_joint_is_found_before_it_has_led_the_arm_far(names: str) -> None:
    """One of three joints, a continuous one among the others. The reference moves at up to 0.63 rad/s."""
    arm = spinner()
    guard = FaultGuard(law(arm), "stop", frozen_travel=1e-3)
    outputs, q, _, _ = run(guard, freezes(300, 400, -1, names), ticks=420)
    first = next(k for k, output in enumerate(outputs) if output.response == "stop")
    assert outputs[first].fault == Fault("frozen", "q", ("tilt",), outputs[first].fault.message)
    assert arm.difference(q[300], q[first])[2] == pytest.approx(0.0, abs=3e-3)
    assert outputs[-1].response == "run"


def test_repeated_measurement_of_a_tick_or_two_is_borne() -> None:
    guard = FaultGuard(law(rbi.load_robot("two_link")), "raise", frozen_ticks=3)
    outputs, *_ = run(guard, freezes(300, 303), ticks=310)
    assert outputs[-1].response == "run"


@pytest.mark.slow
def test_range_is_the_users() -> None:
    arm = rbi.load_robot("two_link")
    narrow = OperatingRange(arm, lower=[-0.1, -np.inf])
    outputs, *_ = run(FaultGuard(law(arm), "stop", range=narrow), ticks=800)
    wide, *_ = run(FaultGuard(law(arm), "stop"), ticks=800)
    assert {x.fault.kind for x in outputs if x.fault} == {"out of range"}
    assert {x.fault.joints for x in outputs if x.fault} == {arm.joint_names[:1]}
    assert {x.fault for x in wide} == {None}


def test_jump_of_the_velocity_is_found_where_its_range_is_stated() -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), range=OperatingRange(arm, acceleration=500.0))
    outputs, *_ = run(guard, between(300, 301, lambda x: x.update(v=x["v"] + 2.0)), ticks=310)
    assert outputs[300].fault.kind == "jump"
    assert outputs[300].fault.name == "v"


# --- how the arm comes to rest --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["hold", "stop"])
def test_arm_whose_sensors_are_gone_comes_to_rest_on_its_model(policy: Any) -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), policy)
    outputs, _, v, _ = run(guard, between(400, 10**9, lost("q")), ticks=1200)
    assert np.abs(v[400]).max() > 0.5
    assert np.abs(v[-1]).max() < 0.01
    assert_within_limits(torques(outputs))


@pytest.mark.slow
def test_payload_that_nobody_told_of_does_not_fall_while_the_sensors_are_gone() -> None:
    """0.3 kg, which the observer has found while all was well. Without it the arm falls; 0.4 s are shown."""
    arm = rbi.load_robot("two_link")
    guard, speeds = FaultGuard(law(arm), "stop"), []
    for rate in (guard.rate, 1e-9):  # the second observer has found nothing
        object.__setattr__(guard._believer._observer, "gain", np.full(2, rate))
        _, _, v, _ = run(
            guard, between(500, 10**9, lost("v")), ticks=900, plant=arm.with_payload(0.3)
        )
        speeds.append(np.abs(v[-1]).max())
    assert speeds[0] < 0.5 * speeds[1]


@pytest.mark.slow
def test_stop_brakes_at_the_rate_that_was_asked_for() -> None:
    """v dies away as e^(-λt), by the closed form; with the torque free to step."""
    arm, rate = rbi.load_robot("two_link"), 10.0
    guard = FaultGuard(law(arm, limits=1e3), "stop", rate=rate)
    _, _, v, _ = run(guard, between(400, 700, lambda x: x.update(reference=None)), ticks=600)
    expected = v[400] * np.exp(-rate * DT * np.arange(201))[:, None]
    assert_allclose(v[400:601], expected, atol=0.03 * np.abs(v[400]).max())


@pytest.mark.slow
@pytest.mark.parametrize("told", [0.0, 2.0, -2.0, 20.0])
def test_stopped_arm_rests_under_a_push_whatever_is_told_of_it(told: float) -> None:
    """2 N·m on a pendulum. Told right or wrong, once it is stopped it comes to rest, because the observer finds it."""
    arm = pendulum()
    guard = FaultGuard(law(arm), "stop", rate=20.0)

    def corrupt(k: int, inputs: dict[str, Any]) -> None:
        inputs.update(tau_ext=np.full(1, told))
        if k >= 100:
            inputs.update(reference=None)

    still = hold(arm)
    outputs, q, v, _ = run(guard, corrupt, ticks=1200, trajectory=still, push=2.0)
    assert outputs[-1].response == "stop"
    assert abs(v[-1, 0]) < 1e-4
    assert abs(q[-1, 0] - q[-200, 0]) < 1e-4


# --- how the controller comes back ----------------------------------------------------------------


@pytest.mark.slow
def test_controller_comes_back_without_a_jump_and_returns_to_the_motion() -> None:
    """Off for 0.3 s, the arm is 0.1 rad off its motion; it returns as its impedance lets it."""
    arm = rbi.load_robot("two_link")
    trajectory = cosine(arm, amplitude=0.2, period=2.0)
    guard = FaultGuard(law(arm), "stop")
    outputs, q, _, _ = run(guard, between(300, 600, lost("q")), ticks=2600)
    back = next(k for k in range(301, 2600) if outputs[k].response == "run")
    assert_within_limits(torques(outputs))
    assert np.abs(outputs[back].e1).max() < 1e-12
    off = np.array([np.abs(arm.difference(x, trajectory(k * DT).q)).max() for k, x in enumerate(q)])
    assert off[back] > 0.05
    assert off[-1] < 0.05 * off[back]
    assert off[back:].max() < 1.3 * off[back]


@pytest.mark.slow
@pytest.mark.parametrize("push", [0.0, (3.0, -1.0)])
@pytest.mark.parametrize("name", ["q", "v", "tau_ext"])
def test_short_loss_costs_less_than_a_milliradian(name: str, push: Any) -> None:
    """20 ticks in motion, with the impedance deflected by a push; 14 mrad and more by a soft start."""
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), "hold")
    _, q, *_ = run(guard, ticks=500, push=push)
    outputs, disturbed, *_ = run(guard, between(300, 320, lost(name)), ticks=500, push=push)
    assert np.abs(disturbed - q).max() < 1e-3
    assert [x.response for x in outputs].count("run") == 500 - 24
    assert_within_limits(torques(outputs))


@pytest.mark.slow
def test_short_loss_in_which_the_arm_is_pushed_away_ends_in_a_soft_start() -> None:
    """60 N·m on the first joint, not measured, for 30 ms meanwhile: the way back begins where the arm is."""
    arm = rbi.load_robot("two_link")
    guard, plant = FaultGuard(law(arm), "hold"), arm.raw_dynamics
    still = hold(arm)(0.0)
    state, (q, v, _) = guard.init(), still
    for k in range(100):
        nan = np.nan if 50 <= k < 80 else 0.0
        output, state = guard.step(state, q + nan, v + nan, still, np.zeros(2))
        if k > 50 and output.response == "run":
            break
        v = v + DT * plant.forward_dynamics(
            q, v, output.tau + np.array([60.0, 0.0]) * (50 <= k < 80)
        )
        q = plant.integrate(q, DT * v)
    assert np.abs(v).max() > 1.0
    assert np.abs(output.e2).max() < 1e-12


@pytest.mark.slow
def test_load_that_the_controller_has_learnt_survives_a_fault() -> None:
    """A payload, learnt by z, does not drop when one measurement is lost: the torque stays within a quarter of its
    weight of what it is without the fault."""
    arm = rbi.load_robot("two_link")
    guard, plant = FaultGuard(law(arm), "hold", longest_hold=0.5), arm.with_payload(0.5)
    outputs, q, _, _ = run(guard, between(600, 602, lost("v")), ticks=700, plant=plant)
    sound, *_ = run(guard, ticks=700, plant=plant)
    weight = np.abs(plant.bias(q[600], np.zeros(2)) - arm.bias(q[600], np.zeros(2))).max()
    assert np.abs(torques(outputs) - torques(sound))[600:].max() < 0.25 * weight


def test_measured_periods_are_handed_on_and_long_pauses_are_no_error() -> None:
    arm = rbi.load_robot("two_link")
    controller = law(arm)
    guard = FaultGuard(controller, "raise")
    state, inner = guard.init(), controller.init()
    reference, push = hold(arm)(0.0), np.array([4.0, -2.0])
    for period in (None, 2e-3, 0.5e-3, 1e-3):
        output, state = guard.step(state, arm.neutral, np.zeros(2), reference, push, period)
        alone, inner = controller.step(inner, arm.neutral, np.zeros(2), reference, push, period)
        assert_array_equal(output.tau, alone.tau)
    output, state = guard.step(state, arm.neutral, np.zeros(2), reference, push, 30.0)
    assert output.response == "run"
    assert np.isfinite(output.tau).all()


def test_late_ticks_of_a_fast_motion_are_no_jump_of_the_reference() -> None:
    """A reference at 150 rad/s, every fifth tick late by 9 periods: the torque is the controller's own."""
    arm = rbi.load_robot("two_link")
    controller = law(arm)
    guard = FaultGuard(
        controller, "raise", range=OperatingRange(arm, lower=-np.inf, upper=np.inf, velocity=200.0)
    )
    state, inner, q = guard.init(), controller.init(), arm.neutral
    speed, zero = np.full(2, 150.0), np.zeros(2)
    for k in range(40):
        period = 10.0 * DT if k % 5 == 4 else DT
        q = arm.integrate(q, period * speed)
        given = q, speed, Reference(q, speed, zero), zero, period
        output, state = guard.step(state, *given)
        alone, inner = controller.step(inner, *given)
        assert_array_equal(output.tau, alone.tau)


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf, "soon"])
def test_period_that_cannot_be_is_a_fault(period: Any) -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm))
    state, reference = guard.init(), hold(arm)(0.0)
    for when in (None, period):
        output, state = guard.step(state, arm.neutral, np.zeros(2), reference, np.zeros(2), when)
    assert output.fault is not None
    assert output.fault.name == "period"


@pytest.mark.slow
def test_step_is_pure() -> None:
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), "hold")
    _, q, v, state = run(guard, between(290, 310, lost("q")), ticks=300)
    inputs = (q[-1] * np.nan, v[-1], hold(arm)(0.0), np.zeros(2))
    first, second = (guard.step(state, *inputs)[0] for _ in range(2))
    assert first.response == "hold"
    assert all(map(np.array_equal, first, second))


def test_output_survives_pickling() -> None:
    arm = rbi.load_robot("two_link")
    outputs, *_ = run(FaultGuard(law(arm)), between(10, 20, lost("q")), ticks=12)
    copied = pickle.loads(pickle.dumps(outputs[-1]))
    assert isinstance(copied, GuardedOutput)
    assert (copied.response, copied.fault) == (outputs[-1].response, outputs[-1].fault)
    assert all(map(np.array_equal, copied, outputs[-1]))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"policy": "pray"}, "policy"),
        ({"rate": 0.0}, "rate"),
        ({"rate": 501.0}, "rate"),
        ({"patience": 0}, "patience"),
        ({"frozen_ticks": 1.5}, "frozen_ticks"),
        ({"frozen_travel": -1.0}, "frozen_travel"),
        ({"longest_hold": np.inf}, "longest_hold"),
    ],
)
def test_settings_that_cannot_be_are_refused(change: dict[str, Any], name: str) -> None:
    with pytest.raises(rbi.ParameterError, match=name):
        FaultGuard(law(rbi.load_robot("two_link")), **change)


@pytest.mark.parametrize(
    "bounds",
    [
        {"velocity": 0.0},
        {"acceleration": [1.0, -1.0]},
        {"external": np.nan},
        {"lower": 1.0, "upper": 0.0},
        {"lower": np.nan},
    ],
)
def test_ranges_that_cannot_be_are_refused(bounds: dict[str, Any]) -> None:
    with pytest.raises(rbi.ParameterError):
        OperatingRange(rbi.load_robot("two_link"), **bounds)


# --- anything at all ------------------------------------------------------------------------------

TWO_LINK = rbi.load_robot("two_link")
LAW = law(TWO_LINK)
GUARDS = {policy: FaultGuard(LAW, policy) for policy in ("raise", "hold", "stop")}

_DTYPES = st.one_of(
    hnp.floating_dtypes(endianness="?"),
    hnp.integer_dtypes(endianness="?"),
    hnp.complex_number_dtypes(),
    hnp.boolean_dtypes(),
    hnp.byte_string_dtypes(max_len=4),
)
_EDGES = st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e19, 0.3])
ANYTHING = st.one_of(
    hnp.arrays(_DTYPES, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)),
    hnp.arrays(np.float64, 2, elements=st.one_of(_EDGES, st.floats())),
    hnp.arrays(np.dtype(">f8"), 2, elements=_EDGES),
    st.lists(_EDGES, max_size=3),
    st.sampled_from([None, "a", 1.0, [[1.0], [2.0, 3.0]], {}, object(), [10**400, 1], (0.1, 0.2)]),
)
SOUND = st.just(np.array([0.1, 0.2]))
REFERENCES = st.one_of(
    st.tuples(ANYTHING, ANYTHING, ANYTHING), st.builds(Reference, SOUND, SOUND, SOUND), ANYTHING
)
INPUTS = st.tuples(
    st.one_of(SOUND, ANYTHING), st.one_of(SOUND, ANYTHING), REFERENCES, st.one_of(SOUND, ANYTHING)
)


def _assert_sound(output: Any) -> None:
    assert np.isfinite(output.tau).all()
    assert (np.abs(output.tau) <= EFFORT).all()


@pytest.mark.slow
@settings(max_examples=100)
@given(st.lists(INPUTS, min_size=1, max_size=3), st.sampled_from(["raise", "hold", "stop"]))
def test_no_input_leads_to_a_torque_beyond_the_limits_or_to_an_untyped_error(
    inputs: list[Any], policy: str
) -> None:
    guard, sound = GUARDS[policy], np.array([0.1, 0.2])
    state = guard.init()
    _, state = guard.step(state, sound, sound, Reference(sound, sound, sound), sound)
    for tick in inputs:
        try:
            output, state = guard.step(state, *tick)
        except FaultError:
            assert policy == "raise"
            continue
        _assert_sound(output)


@pytest.mark.slow
@settings(max_examples=100)
@given(INPUTS)
def test_law_itself_gives_a_finite_torque_or_a_typed_error(inputs: Any) -> None:
    """Inputs beyond 1e6 may overflow in the dynamics: the guard is for those."""
    try:
        output, _ = LAW.step(LAW.init(), *inputs)
    except rbi.InputError:
        return
    sizes = [
        np.abs(np.asarray(x, dtype=float)).max(initial=0.0)
        for x in (*inputs[:2], *inputs[2], inputs[3])
    ]
    if max(sizes) < 1e6:
        _assert_sound(output)


def test_warmed_up_guard_compiles_nothing_at_its_first_tick() -> None:
    said = fresh_python(
        "import numpy as np, rbimpedance as rbi\n"
        "from numba.core import event\n"
        "arm = rbi.load_robot('two_link')\n"
        "guard = rbi.FaultGuard(rbi.SoftStart(rbi.ImpedanceController(arm)), 'stop')\n"
        "guard.warm_up()\n"
        "zero, hold = np.zeros(2), rbi.trajectories.hold(arm)(0.0)\n"
        "with event.install_recorder('numba:compile') as recorder:\n"
        "    guard.step(guard.init(), hold.q, zero, hold, zero)\n"
        "print(len(recorder.buffer))\n"
    )
    assert said.stdout.strip() == "0"


def test_arm_without_a_position_asks_for_brakes_before_an_offset_of_its_speed_takes_it_far() -> (
    None
):
    """q is lost for good, v is measured 0.02 rad/s too low: the arm that seems to rest drifts."""
    arm = rbi.load_robot("two_link")
    guard = FaultGuard(law(arm), "stop", longest_blind=0.25)

    def lose_position(k: int, inputs: dict[str, Any]) -> None:
        if k >= 300:
            inputs["q"], inputs["v"] = np.full(2, np.nan), inputs["v"] - 0.02

    outputs, q, *_ = run(guard, lose_position, 1500, trajectory=hold(arm, arm.neutral))
    asked = [k for k, output in enumerate(outputs) if output.brakes_requested]
    assert asked
    assert 798 <= asked[0] <= 802  # half a second
    assert np.abs(q[asked[0]] - q[300]).max() < 0.5 * 0.025
    assert all(output.brakes_requested for output in outputs[asked[0] :])
