"""What no guard may do: over arms, postures, speeds, pushes and flicker drawn at random, and in known hard cases.

The default tier draws a few; `--slow` draws more and lets every run come to its end.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.guards.faults import OperatingRange
from rbimpedance.trajectories import Reference, hold

from .. import laws

Array = NDArray[np.float64]
DT, RATE, KICK, SUBSTEPS = 1e-3, 1000.0, 20, 2
COUNT = 2.0 * np.pi / 2**17
ARMS = ("panda", "ur5", "two_link", "z1", "kinova")
LOCK = {"panda": ("panda_finger_joint1", "panda_finger_joint2")}
PANDA = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.5])


@functools.cache
def load(name: str) -> rbi.ArmModel:
    return rbi.load_robot(name, armature=0.1, lock=LOCK.get(name, ()))


@functools.cache
def law(name: str, k1: float = 15.0, k2: float = 40.0) -> rbi.ImpedanceController:
    """The README's surface; arms without effort limits get 60 N·m."""
    arm = load(name)
    effort = np.where(np.isfinite(arm.effort_limit), arm.effort_limit, 60.0)
    limits = rbi.Limits(effort=effort, rate=RATE)
    return laws.controller(arm, k1, k2, dt=DT, impedance=laws.STIFF, limits=limits)


def fastest(arm: rbi.ArmModel) -> Array:
    """Speed limits; arms without any get 3 rad/s."""
    return np.where(np.isfinite(arm.velocity_limit), arm.velocity_limit, 3.0)


def guarded(controller: rbi.ImpedanceController, policy: Any) -> FaultGuard:
    arm = controller.arm
    return FaultGuard(controller, policy, range=OperatingRange(arm, velocity=fastest(arm)))


class Run(NamedTuple):
    speed: Array  # largest, in speed limits
    tau: Array
    response: list[str]
    blind: Array
    brakes: list[bool]


Trajectory = Callable[[float], Reference]
Measure = Callable[[int, Array, Array], tuple[Array, Array]]
Torque = Callable[[int], Array | float]


def run(
    controller: Any,
    q: Array,
    ticks: int,
    *,
    trajectory: Trajectory | None = None,
    kick: Array | float = 0.0,
    push: Torque = lambda _k: 0.0,
    measure: Measure = lambda _k, q, v: (q, v),
    braked: range = range(0),
) -> Run:
    """A closed loop with an exact model: a kick is a true velocity at once, a push an untold torque."""
    arm, plant = controller.arm, controller.arm.raw_dynamics
    trajectory = trajectory or hold(arm, q)
    state, v, zero = controller.init(), np.zeros(arm.nv), np.zeros(arm.nv)
    log: list[tuple[float, Array, str, float, bool]] = []
    for k in range(ticks):
        v = zero if k in braked else v + kick if k == KICK else v
        output, state = controller.step(state, *measure(k, q, v), trajectory(k * DT), zero)
        is_guard = isinstance(controller, FaultGuard)
        log.append(
            (
                float(np.abs(v / fastest(arm)).max()),
                output.tau,
                output.response if is_guard else "run",
                state.known.blind if is_guard else 0.0,
                is_guard and output.brakes_requested,
            )
        )
        for _ in range(0 if k in braked else SUBSTEPS):
            v = v + DT / SUBSTEPS * plant.forward_dynamics(q, v, output.tau + push(k))
            q = plant.integrate(q, DT / SUBSTEPS * v)
        if not np.isfinite(v).all():
            log[-1] = (np.inf, *log[-1][1:])
            break
    speed, tau, response, blind, brakes = zip(*log, strict=True)
    return Run(np.array(speed), np.array(tau), list(response), np.array(blind), list(brakes))


class Case(NamedTuple):
    name: str
    q: Array
    kick: Array
    push: Torque


def drawn(seed: int) -> Case:
    """An arm in a posture, truly moving at up to 3 speed limits, or pushed by up to 0.8 effort limits, or both."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(ARMS))
    arm, effort = load(name), law(name).limits.effort  # type: ignore[union-attr]
    q = posture(arm, rng)
    kind = rng.choice(["kick", "push", "both"])
    moving = rng.random(arm.nv) < rng.random()
    kick = fastest(arm) * rng.uniform(-3.0, 3.0, arm.nv) * moving * (kind != "push")
    force = np.zeros(arm.nv)
    joint = rng.integers(arm.nv)
    force[joint] = effort[joint] * rng.uniform(-0.8, 0.8) * (kind != "kick")
    end = KICK + int(rng.integers(50, 400))
    return Case(name, q, kick, lambda k: force * (KICK <= k < end))


def posture(arm: rbi.ArmModel, rng: np.random.Generator) -> Array:
    """Within the middle half of the joints' ranges, and of -3 to 3 rad."""
    lower, upper = (
        np.clip(arm.raw_dynamics.difference(arm.neutral, end), -3.0, 3.0) for end in _ends(arm)
    )
    return arm.integrate(
        arm.neutral, rng.uniform(0.75 * lower + 0.25 * upper, 0.25 * lower + 0.75 * upper)
    )


def _ends(arm: rbi.ArmModel) -> tuple[Array, Array]:
    unit = np.full(arm.nv, 3.0)
    return tuple(  # type: ignore[return-value]
        np.where(np.isfinite(end), end, arm.integrate(arm.neutral, sign * unit))
        for end, sign in ((arm.lower, -1.0), (arm.upper, 1.0))
    )


# --- the cases that once failed ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["stop", pytest.param("hold", marks=pytest.mark.slow)])
def test_fast_arm_with_good_sensors_is_brought_to_rest(policy: str) -> None:
    """Joint 1 of panda truly at 2.1 speed limits: 12.3 times the limit and still speeding, once."""
    arm = load("panda")
    kick = 2.1 * fastest(arm) * np.eye(7)[0]
    result = run(guarded(law("panda"), policy), PANDA, 1000, kick=kick)
    assert result.speed.max() < 2.15
    assert result.speed[-1] < 0.1
    assert result.blind.max() == 0.0
    assert result.response[-1] == "run"


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["stop", pytest.param("hold", marks=pytest.mark.slow)])
def test_untold_push_does_not_run_away(policy: str) -> None:
    """50 N·m on joint 1 for 0.3 s: 34 times the limit, once; 15 times with the bare controller."""
    force = 50.0 * np.eye(7)[0]
    result = run(guarded(law("panda"), policy), PANDA, 700, push=lambda k: force * (20 <= k < 320))
    assert result.speed.max() < 2.1
    assert result.speed[450:].max() < 0.8
    assert result.blind.max() == 0.0


FLICKER: dict[str, Measure] = {
    "the same bits": lambda _, angles, v: (angles, v),
    "half a count of flicker": lambda k, angles, v: (angles + COUNT * 0.5 * (k % 2), v),
    "whole counts": lambda _, angles, v: (COUNT * np.rint(angles / COUNT), v),
    "noise": lambda k, angles, v: (
        angles + 1e-5 * np.random.default_rng((1, k)).standard_normal(len(v)),
        v + 1e-3 * np.random.default_rng((2, k)).standard_normal(len(v)),
    ),
}
"""What encoders make of the joints' angles, continuous ones among them."""


def encoded(arm: rbi.ArmModel, flicker: str) -> Measure:
    """The encoders, as what is measured of q and v."""
    if flicker == "the same bits":
        return lambda _k, q, v: (q, v)

    def measure(k: int, q: Array, v: Array) -> tuple[Array, Array]:
        angles, v = FLICKER[flicker](k, arm.difference(arm.zero, q), v)
        return arm.integrate(arm.zero, angles), v

    return measure


def moves_on(arm: rbi.ArmModel, q: Array) -> Trajectory:
    """A reference of 0.1 rad/s for 3 s on every joint."""
    one = np.ones(arm.nv)
    return lambda t: Reference(
        arm.integrate(q, 0.1 * min(t, 3.0) * one), 0.1 * one * (t < 3.0), 0.0 * one
    )


def assert_release_is_slow(
    name: str, q: Array, flicker: str, k1: float, k2: float, trajectory: Trajectory, ticks: int
) -> None:
    """Brakes from 20 ms on. Never faster than the speed limit, and no torque beyond gravity, 0.2 of the limits as for
    friction, 20 rad/s², and what the rate limit lets grow until it is found, 60 ms."""
    controller = law(name, k1, k2)
    arm, effort = controller.arm, controller.limits.effort  # type: ignore[union-attr]
    result = run(
        guarded(controller, "stop"),
        q,
        ticks + 300,
        trajectory=trajectory,
        measure=encoded(arm, flicker),
        braked=range(20, ticks),
    )
    assert result.speed.max() < 1.0
    beyond = np.abs(result.tau[20:ticks] - arm.bias(q, np.zeros(arm.nv)))
    inertia = np.diag(arm.mass_matrix(q))
    most = np.maximum(0.2 * effort, 20.0 * inertia) + 60.0 * DT * RATE
    assert (beyond <= np.minimum(most, 2.0 * effort)).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flicker", "ticks"),
    [("the same bits", 600), ("half a count of flicker", 600), ("whole counts", 3000)],
)
def test_release_of_brakes_is_slow_although_the_reference_has_moved_on(
    flicker: str, ticks: int
) -> None:
    """87 N·m and 5 to 30 speed limits after the release, once."""
    trajectory = moves_on(load("panda"), PANDA)
    assert_release_is_slow("panda", PANDA, flicker, 50.0, 500.0, trajectory, ticks)


@pytest.mark.slow
@pytest.mark.parametrize("flicker", FLICKER)
@pytest.mark.parametrize("name", ARMS)
def test_release_of_brakes_is_slow_on_every_arm(name: str, flicker: str) -> None:
    arm = load(name)
    rng = np.random.default_rng(sum(map(ord, name + flicker)))
    q = posture(arm, rng)
    trajectory = moves_on(arm, q) if rng.random() < 0.7 else hold(arm, q)
    assert_release_is_slow(name, q, flicker, 15.0, 40.0, trajectory, 1500)


# --- a sensor that freezes at rest ----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("joint", [None, 0, 1, 3])
@pytest.mark.parametrize("flicker", [0.0, 0.5])
def test_sensor_that_freezes_at_rest_asks_for_brakes(joint: int | None, flicker: float) -> None:
    """v = 0 and the same q look as if brakes held the arm. Brakes that close 50 ms after they are asked for stop it;
    37 speed limits within 1.6 s, once. Where the other joints' encoders flicker that does not hide the frozen one."""
    arm, still = load("panda"), hold(load("panda"), PANDA)
    guard, plant = guarded(law("panda", 50.0, 500.0), "stop"), arm.raw_dynamics
    which, on = slice(None) if joint is None else joint, moves_on(arm, PANDA)
    state, q, v = guard.init(), PANDA, np.zeros(7)
    asked, speed = [], []
    for k in range(1200):
        told_q, told_v = q + flicker * COUNT * (k % 2), v.copy()
        if k >= 100:
            told_q[which], told_v[which] = PANDA[which], 0.0
        desired = on((k - 100) * DT) if k >= 100 else still(0.0)
        output, state = guard.step(state, told_q, told_v, desired, np.zeros(7))
        asked.append(output.brakes_requested)
        is_braked = k > 50 and asked[k - 50]
        v = np.zeros(7) if is_braked else v + DT * plant.forward_dynamics(q, v, output.tau)
        q = plant.integrate(q, DT * v)
        speed.append(np.abs(v / fastest(arm)).max())
    assert any(asked)
    assert max(speed) < 0.8
    assert np.abs(q - PANDA).max() < 0.15


# --- over arms, postures, speeds and pushes -------------------------------------------------------


def assert_no_policy_is_worse(seed: int, ticks: int, slow: float) -> None:
    """At the end no policy is faster than the bare controller, or than `slow`: it may be on its way back by then."""
    case = drawn(seed)
    bare, *guards = (
        run(controller, case.q, ticks, kick=case.kick, push=case.push)
        for controller in (law(case.name), *(guarded(law(case.name), x) for x in ("stop", "hold")))
    )
    for guard in guards:
        assert guard.speed[-1] <= max(bare.speed[-1], slow)
        assert guard.blind.max() == 0.0
        assert not any(guard.brakes)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 14])
def test_no_policy_ends_faster_than_the_bare_controller_and_none_is_blind(seed: int) -> None:
    assert_no_policy_is_worse(seed, 500, slow=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_no_policy_ends_faster_than_the_bare_controller_at_all(seed: int) -> None:
    assert_no_policy_is_worse(seed, 3000, slow=0.02)


# --- blind ----------------------------------------------------------------------------------------


def assert_blind_torque_vanishes(seed: int, ticks: int) -> None:
    """All measurements of the motion are lost 10 ms after a kick or in a push; nothing holds the arm then."""
    case = drawn(seed)
    lost = np.full_like(case.q, np.nan)
    for policy in ("stop", "hold"):
        guard = guarded(law(case.name), policy)
        result = run(
            guard,
            case.q,
            ticks,
            kick=case.kick,
            push=case.push,
            measure=lambda k, q, v: (lost, lost) if k >= KICK + 10 else (q, v),
        )
        size = np.abs(result.tau).max(axis=1)
        blind = KICK + 10 + round(guard.longest_blind / DT)
        assert np.isfinite(result.tau).all()
        assert abs(result.brakes.index(True) - blind) <= 1
        assert all(result.brakes[blind + 1 :])
        assert (np.diff(size[blind + 1 :]) < 0.0).all()
        expected = np.exp(-(ticks - blind) * DT / guard.longest_blind)
        assert size[-1] <= 1.5 * expected * size[blind] + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5])
def test_blind_arm_never_gets_a_constant_torque_for_ever(seed: int) -> None:
    assert_blind_torque_vanishes(seed, 600)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200, 215))
def test_blind_arm_never_gets_a_constant_torque_on_any_arm(seed: int) -> None:
    assert_blind_torque_vanishes(seed, 900)


@pytest.mark.parametrize("name", ["q", "v"])
def test_arm_that_still_has_one_of_q_and_v_is_not_blind(name: str) -> None:
    """Lost 10 ms after a kick to 2.5 speed limits; the other one brings the arm to rest."""
    arm = load("panda")
    kick = fastest(arm) * np.array([2.5, 0.0, -1.0, 0.0, 0.5, 0.0, 0.0])
    lost = np.full(7, np.nan)

    def measure(k: int, q: Array, v: Array) -> tuple[Array, Array]:
        if k < KICK + 10:
            return q, v
        return (lost, v) if name == "q" else (q, lost)

    result = run(guarded(law("panda"), "stop"), PANDA, 400, kick=kick, measure=measure)
    assert result.blind.max() == 0.0
    assert result.speed[-1] < 0.05
    assert not any(result.brakes)


# --- what is no missing effect --------------------------------------------------------------------


@pytest.mark.slow
def test_load_that_grows_is_no_brake_for_long() -> None:
    """60 N·m come slowly on joint 2, untold. The arm holds them, and goes on with its motion afterwards."""
    arm = load("panda")
    trajectory = rbi.trajectories.cosine(arm, center=PANDA, amplitude=0.1, period=2.0)

    def still_then_moving(t: float) -> Reference:
        return trajectory(max(t - 1.5, 0.0)) if t > 1.5 else hold(arm, trajectory(0.0).q)(0.0)

    force = np.eye(7)[1]
    result = run(
        guarded(law("panda", 50.0, 500.0), "stop"),
        trajectory(0.0).q,
        2600,
        trajectory=still_then_moving,
        push=lambda k: force * min(60.0 * k * DT, 60.0),
    )
    assert result.response[-300:] == ["run"] * 300
    assert result.speed.max() < 0.6


@pytest.mark.slow
def test_told_contact_with_a_stiff_wall_is_no_missing_effect() -> None:
    """Joint 1 of two_link is driven 0.12 rad into a wall of 2 kN·m/rad, whose torque is measured."""
    arm, q0 = load("two_link"), np.array([0.4, 1.2])
    guard, plant = guarded(law("two_link"), "raise"), arm.raw_dynamics
    state, q, v, wall = guard.init(), q0, np.zeros(2), np.zeros(2)
    pressed = []
    for k in range(2000):
        way = np.array([0.15 * min(k * DT, 1.0), 0.0])
        desired = Reference(q0 + way, np.array([0.15 * (k < 1000), 0.0]), np.zeros(2))
        output, state = guard.step(state, q, v, desired, wall)
        for _ in range(4):
            depth = q[0] - q0[0] - 0.03
            wall = np.array([-(2e3 * depth + 50.0 * v[0]) if depth > 0.0 else 0.0, 0.0])
            v = v + DT / 4.0 * plant.forward_dynamics(q, v, output.tau + wall)
            q = plant.integrate(q, DT / 4.0 * v)
        pressed.append(wall[0])
    assert np.mean(pressed[-500:]) < -8.0
    assert output.response == "run"
