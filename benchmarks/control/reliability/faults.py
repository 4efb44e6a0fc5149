"""What faults of sensors, timing, plant and process do to a guarded loop."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.snapshot import load_snapshot, save_snapshot
from rbimpedance.trajectories import cosine

from .guarded_arm import guarded, law, load

TICKS, NEAR = 6000, 1e-3
START, TURNING = 2500, 2000  # in motion, and where every joint turns round


@dataclass
class World:
    """A plant in a closed loop at tick k; a fault changes what it likes.

    Attributes:
        guard: The guarded controller.
        plant: The simulated arm.
        state: State of the guard.
        q: Configuration of the plant.
        v: Its velocity.
        inputs: What the controller is told at this tick.
        period: Time since the last tick that took place, in periods.
        is_dropped: The tick does not take place.
        memory: Whatever the fault wants to remember.
    """

    guard: FaultGuard
    plant: rbi.ArmModel
    state: Any
    q: Array
    v: Array
    inputs: dict[str, Any] = field(default_factory=dict)
    period: int = 1
    is_dropped: bool = False
    memory: Any = None


Fault = Callable[[World, int], None]
"""Called at every tick from its start on, counted from there, with the inputs not yet told."""


def in_ticks(stop: int, change: Callable[[World], None]) -> Fault:
    """Return the fault that lasts so many ticks."""

    def fault(world: World, k: int) -> None:
        if k < stop:
            change(world)

    return fault


def add(name: str, value: Any) -> Callable[[World], None]:
    """Return what adds to an input."""
    return lambda world: world.inputs.update({name: world.inputs[name] + value})


def lost(world: World) -> None:
    """The measurements of the motion are NaN."""
    world.inputs.update(q=world.q * np.nan, v=world.v * np.nan)


def spike(world: World) -> None:
    """Every joint is told 0.3 rad off."""
    arm = world.guard.arm
    world.inputs["q"] = arm.integrate(world.q, np.full(arm.nv, 0.3))


def freeze(world: World, k: int) -> None:
    """The measurements of the motion stay what they are for 200 ticks."""
    world.memory = (world.q, world.v) if k == 0 else world.memory
    if k < 200:
        world.inputs.update(zip("qv", world.memory, strict=True))


def bias(world: World) -> None:
    """The second joint's torque is told with 20 N·m too much."""
    told = np.array(world.inputs["tau_ext"])
    told[1] += 20.0
    world.inputs["tau_ext"] = told


def delay(ticks: int) -> Fault:
    """Return the fault of measurements that are so old."""

    def fault(world: World, k: int) -> None:
        names = ("q", "v", "tau_ext")
        past = (world.memory or ()) + (tuple(world.inputs[name] for name in names),)
        world.memory = past[-ticks - 1 :]
        world.inputs.update(zip(names, world.memory[0], strict=True))
        del k

    return fault


def drop(share: float) -> Fault:
    """Return the fault of ticks that do not take place; the next one is told how long ago the last one was."""
    rng = np.random.default_rng(3)

    def fault(world: World, k: int) -> None:
        world.is_dropped = bool(rng.random() < share)
        del k

    return fault


def payload(world: World, k: int) -> None:
    """2 kg are attached for 2 s; they move as the tool does when they are."""
    if k == 0:
        world.memory, world.plant = world.plant, world.plant.with_payload(2.0)
    elif k == 2000:
        world.plant = world.memory


def stiffen(world: World, k: int) -> None:
    """K_d from 100 to 400 N·m/rad at once."""
    if k == 0:
        world.guard = guarded(law(world.guard.arm, stiffness=400.0))


def restart(world: World, k: int) -> None:
    """The process ends, and a new one goes on from the snapshot of its last tick after 20 periods."""
    if k == 0:
        with tempfile.TemporaryDirectory() as folder:
            path = save_snapshot(Path(folder) / "state", world.guard, world.state)
            world.guard = guarded(law(world.guard.arm.copy()))
            world.state = load_snapshot(path, world.guard)
    world.is_dropped = k < 20


FAULTS: dict[str, Fault | None] = {
    "none": None,
    "q and v NaN, 20 ticks": in_ticks(20, lost),
    "q and v NaN, 200 ticks": in_ticks(200, lost),
    "q and v frozen in motion, 200 ticks": freeze,
    "q and v frozen at a turning point, 200 ticks": freeze,
    "spike of 0.3 rad on q, 1 tick": in_ticks(1, spike),
    "spike of 2 rad/s on v, 1 tick": in_ticks(1, add("v", 2.0)),
    "spike of 100 N·m on tau_ext, 1 tick": in_ticks(1, add("tau_ext", 100.0)),
    "tau_ext of a joint 20 N·m too high, 1 s": in_ticks(1000, bias),
    "tau_ext reported as zero, 1 s": in_ticks(
        1000, lambda w: w.inputs.update(tau_ext=0.0 * w.inputs["tau_ext"])
    ),
    "tau_ext NaN, 1 s": in_ticks(1000, add("tau_ext", np.nan)),
    **{f"measurements {n} ticks old, on": delay(n) for n in (1, 2, 5, 10)},
    **{f"{share:.0%} of the ticks dropped, on": drop(share) for share in (0.01, 0.05, 0.2)},
    "torque saturates at 30 %": None,
    "2 kg attached for 2 s": payload,
    "2 kg for 2 s, and torque saturates at 30 %": payload,
    "K_d times 4 at once (error to q_r)": stiffen,
    "restart from a snapshot, 20 ticks off": restart,
}


@dataclass
class Run:
    """Log of a run: first tick of the fault, configurations, errors to q_r, torques, ticks of the policy, breaches."""

    start: int
    q: Array
    e1: Array
    tau: Array
    responses: int
    broken: list[str]


def run(name: str, fault_name: str) -> Run:
    """Run one fault on one robot, with a constant push of 10 N at the tool."""
    arm, center = load(name)
    fault = FAULTS[fault_name]
    share = 0.3 if "saturates" in fault_name else 1.0
    trajectory = cosine(arm, center=center, amplitude=0.15, period=4.0)
    world = World(guarded(law(arm, share)), arm.copy(), None, *trajectory(0.0)[:2])
    world.state = world.guard.init()
    start = TURNING if "turning" in fault_name else START
    log: tuple[list[Array], ...] = ([], [], [])
    told, e1, responses = np.zeros(arm.nv), np.zeros(arm.nv), 0
    broken: list[str] = []
    force = np.array([6.0, 8.0, 0.0, 0.0, 0.0, 0.0])
    for k in range(TICKS):
        push = arm.external_torque(world.q, force)
        world.inputs = {
            "q": world.q,
            "v": world.v,
            "reference": trajectory(k * DT),
            "tau_ext": push,
        }
        world.is_dropped = False
        if fault is not None and k >= start:
            fault(world, k - start)
        if world.is_dropped:
            world.period += 1
        else:
            period = None if world.period == 1 else world.period * DT
            output, world.state = world.guard.step(world.state, **world.inputs, period=period)
            broken += _broken(world.guard, output.tau, told if k else output.tau)
            told, e1, world.period = output.tau, output.e1, 1
            responses += output.response != "run"
        for channel, value in zip(log, (world.q, e1, told), strict=True):
            channel.append(value)
        _advance(world, told + push)
    q, e1s, tau = (np.array(channel) for channel in log)
    return Run(start, q, e1s, tau, responses, broken)


def _advance(world: World, torque: Array) -> None:
    """Two physics steps of semi-implicit Euler; the joints stop where they would leave every sensible range."""
    dynamics, h = world.plant.raw_dynamics, DT / 2.0
    for _ in range(2):
        world.v = np.clip(
            world.v + h * dynamics.forward_dynamics(world.q, world.v, torque), -50, 50
        )
        world.q = dynamics.integrate(world.q, h * world.v)


def _broken(guard: FaultGuard, tau: Array, before: Array) -> Iterator[str]:
    if not np.isfinite(tau).all():
        yield "not finite"
    if (np.abs(tau) > guard.limits.effort).any():
        yield "beyond the torque limit"
    if (np.abs(tau - before) > guard.limits.rate * DT * (1.0 + 1e-9)).any():
        yield "beyond the rate limit"


def cell(found: Run, sound: Run, arm: rbi.ArmModel, *, to_reference: bool) -> str:
    """Peak error [mrad], peak step of the torque [N·m], time to recover [s], ticks of the policy."""
    start = found.start
    pairs = zip(sound.q[start:], found.q[start:], strict=True)
    off = np.array([np.abs(arm.difference(a, b)).max() for a, b in pairs])
    if to_reference:
        off = np.abs(found.e1[start:]).max(axis=1)
    step = np.abs(np.diff(found.tau[start - 1 :], axis=0)).max()
    beyond = np.flatnonzero(off > NEAR)
    late = 0.0 if not len(beyond) else (beyond[-1] + 1) * DT
    recovered = "–" if late > (TICKS - start) * DT - 0.05 else f"{late:.2f}"
    policy = f", {found.responses}" if found.responses else ""
    return f"{1e3 * off.max():.3g}, {step:.2f}, {recovered}{policy}"


def faults(robots: list[str]) -> str:
    """Run every fault on every robot, and return the table."""
    header, rows = ("fault", *robots), []
    sound = {name: run(name, "none") for name in robots}
    ticks = 0
    for fault in FAULTS:
        row = [fault]
        for name in robots:
            found = run(name, fault)
            if found.broken:
                sys.exit(f"{name}, {fault}: {found.broken[0]}")
            ticks += len(found.tau)
            is_other = "K_d" in fault  # the arm is to be elsewhere
            arm = load(name)[0]
            row.append(cell(found, sound[name], arm, to_reference=is_other))
        rows.append(row)
        print(" | ".join(row), flush=True)
    verdict = f"{ticks} ticks: 0 not finite, 0 beyond the limits, 0 untyped exceptions."
    return f"{markdown(header, rows)}\n\n{verdict}"
