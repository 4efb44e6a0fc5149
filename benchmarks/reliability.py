"""What faults do to a guarded loop, what an energy tank does at the port, a day of ticks, and kills of a long run.

    python benchmarks/reliability.py faults     [--robots panda ur5 kinova] [--write]
    python benchmarks/reliability.py passivity  [--write]
    python benchmarks/reliability.py day        [--hours 24] [--write]
    python benchmarks/reliability.py kill       [--times 50] [--write]

Each prints its table; `--write` puts it between its markers in docs/reliability.md. Everything is seeded. A torque that
is not finite or beyond the limits, a file that is not whole, or bytes that differ end the script with an error.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.guards.energy_tank import EnergyTank
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.guards.faults import OperatingRange
from rbimpedance.control.snapshot import load_snapshot, save_snapshot
from rbimpedance.interaction.estimators import MomentumObserver
from rbimpedance.trajectories import cosine, hold

DT, TICKS, PEAK_RATE, NEAR = 1e-3, 6000, 1000.0, 1e-3
START, TURNING = 2500, 2000  # in motion, and where every joint turns round
PAGE = Path(__file__).parents[1] / "docs" / "reliability.md"
ROBOTS: dict[str, dict[str, Any]] = {
    "panda": {"lock": ("panda_finger_joint1", "panda_finger_joint2")},
    "ur5": {},
    "kinova": {},
}
CENTERS = {
    "kinova": (1.0, 0.0, 2.6, 1.3, 1.0, 0.0, 1.5, 1.0, 0.0),
    "panda": (0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.5),
    "ur5": (0.0, -1.2, 1.5, -1.8, -1.5, 0.0),
}


def load(name: str) -> tuple[rbi.ArmModel, Array]:
    """Return an arm and the configuration that it moves about."""
    arm = rbi.load_robot(name, armature=0.1, **ROBOTS[name])
    return arm, np.array(CENTERS[name])


def law(arm: rbi.ArmModel, share: float = 1.0, stiffness: float = 100.0) -> rbi.ImpedanceController:
    """Return the controller of the table, with a share of the arm's effort limits."""
    return rbi.ImpedanceController(
        arm,
        rbi.Impedance(1.0, 20.0, stiffness),
        rbi.FastTerminalSurface(2.0, 3.0, 0.6),
        rbi.SuperTwisting(15.0, 50.0),
        DT,
        limits=rbi.Limits(share * arm.effort_limit, PEAK_RATE),
    )


def guarded(controller: Any) -> FaultGuard:
    """Return the guard of the table."""
    arm = controller.arm
    return FaultGuard(controller, "hold", range=OperatingRange(arm, acceleration=200.0))


# --- faults -----------------------------------------------------------------------------------------------------------


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
    "tau_ext told as zero, 1 s": in_ticks(
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
    rows = [["fault", *robots]]
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
    return f"{table(rows)}\n\n{verdict}"


# --- energy -----------------------------------------------------------------------------------------------------------


class Hand:
    """A hand on the tool that only resists its motion, with 5 N·s/m: it takes energy in and never gives any."""

    def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return tau_ext."""
        del t
        J = arm.jacobian(q)[:3]
        torque: Array = -5.0 * J.T @ (J @ v)
        return torque


def port(case: str, tank: bool) -> tuple[float, float]:
    """Least work of the environment on the arm so far [J], and the largest speed [rad/s], of panda in a case."""
    arm, center = load("panda")
    soft = rbi.Impedance(1.0, 4.0, 50.0)
    controller: Any = law(arm).with_impedance(soft)
    observer = MomentumObserver(arm, 200.0, DT)
    if tank:
        controller = EnergyTank(controller, observer=observer, capacity=1.0, start=0.2)
    stiff = controller.with_impedance(rbi.Impedance(1.0, 4.0, 250.0))
    where, state, q, v = hold(arm, center)(0.0), controller.init(), center, np.zeros(arm.nv)
    place = arm.frame_placement(center)[1]
    wall = rbi.Wall(place - np.array([0.0, 0.0, 0.01]), [0.0, 0.0, 1.0], 5e3, 20.0)
    push = rbi.Push([0, 0, -15, 0, 0, 0], 0.1, 0.5)
    environment = rbi.Sum(Hand() if case == "gains" else wall, push)
    work = least = fastest = 0.0
    for k in range(4000):
        felt = environment.torque(arm, k * DT, q, v)
        told = felt
        acting = controller
        if case == "gains":
            # stiff on the way back, soft on the way out: what a spring gives, it gets back with interest
            filtered = state.inner if tank else state
            acting = stiff if filtered.q_e @ filtered.v_e < 0.0 else controller
        elif case == "sign":
            told = -felt
        else:
            told = felt + 20.0 * (np.arange(arm.nv) == 1)
        output, state = acting.step(state, q, v, where, told)
        for i in range(4):
            acting_torque = environment.torque(arm, k * DT + i * DT / 4.0, q, v)
            v = v + DT / 4.0 * arm.raw_dynamics.forward_dynamics(q, v, output.tau + acting_torque)
            v = np.clip(v, -20.0, 20.0)
            q = arm.raw_dynamics.integrate(q, DT / 4.0 * v)
            work += DT / 4.0 * float(acting_torque @ v)
        least, fastest = min(least, work), max(fastest, float(np.abs(v).max()))
    return least, fastest


def passivity() -> str:
    """Measure the port of panda with and without a tank, and return the table."""
    words = {
        "gains": "K_d from 50 to 250 N·m/rad whenever the spring lets go, and back, in a hand that only resists",
        "sign": "tau_ext told with the wrong sign, in contact with a wall of 5 kN/m",
        "bias": "tau_ext of joint 2 told with 20 N·m too much, at the same wall",
    }
    rows = [["case", "energy given out, without [J]", "with the tank [J]", "peak speed [rad/s]"]]
    for case, said in words.items():
        without, tank = port(case, tank=False), port(case, tank=True)
        figures = [f"{-without[0]:.2f}", f"{-tank[0]:.2f}", f"{without[1]:.2g} → {tank[1]:.2g}"]
        rows.append([said, *figures])
        print(" | ".join(rows[-1]), flush=True)
    return table(rows)


# --- a day ------------------------------------------------------------------------------------------------------------

PERIOD = 6.0  # s, of the motion; it is looked at once a minute, ten periods


def day(hours: float) -> str:
    """Run two_link for so long by compiled code, compare the same phase of every minute, and return the table."""
    arm = rbi.load_robot("two_link")
    controller = rbi.ImpedanceController(
        arm,
        rbi.Impedance(1.0, 10.0, 20.0),
        rbi.FastTerminalSurface(2.0, 3.0, 0.6),
        rbi.SuperTwisting(15.0, 40.0),
        DT,
        limits=rbi.Limits(60.0, PEAK_RATE),
        backend="compiled",
    )
    names = ("q_r", "e1", "s", "tau")

    def minutes(count: int) -> Any:
        return rbi.simulate_batch(
            [controller],
            arm.with_payload(0.3),
            cosine(arm, center=0.5, amplitude=0.2, period=PERIOD),
            wrench=np.array([3.0, 0.0, 2.0, 0.0, 0.0, 0.0]),
            duration=60.0 * count,
            substeps=2,
            channels=names,
            every=round(60.0 / DT),
            metrics=False,
        )

    minutes(10)
    first, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    found = minutes(round(60.0 * hours))
    last, took = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic() - began
    rows = [
        [
            "same phase of every minute",
            "spread in the first hour",
            "spread in the last hour",
            "moved in between",
        ]
    ]
    for name in names:
        x = found[name][0][2:]  # two minutes to settle
        hour = min(60, len(x) // 2)
        early, late = x[:hour], x[-hour:]
        moved = np.abs(late.mean(axis=0) - early.mean(axis=0)).max()
        rows.append(
            [name, *(f"{np.ptp(part, axis=0).max():.1e}" for part in (early, late)), f"{moved:.1e}"]
        )
    said = (
        f"{hours:g} h, {round(3600 * hours / DT):,} ticks in {took / 60:.1f} min; peak memory {first / 1024:.0f} MB "
        f"after ten minutes, {last / 1024:.0f} MB at the end."
    )
    return f"{table(rows)}\n\n{said}"


# --- kills ------------------------------------------------------------------------------------------------------------

COMMAND = ("run", "two_link", "--duration", "20", "--substeps", "2", "--quiet")
ENTRY = """
import rbimpedance.simulation.checkpoint as c
c.Checkpoint.__init__.__kwdefaults__["every"] = 0.3
from rbimpedance.cli import main
main()
"""


def command(out: Path, *more: str) -> list[str]:
    """Return the command line of the run that is killed, with a checkpoint every 0.3 s instead of 2 s."""
    return [sys.executable, "-c", ENTRY, *COMMAND, "--out", str(out), *more]


def kill(times: int) -> str:
    """Kill runs at random moments, go on with --resume, compare, and return the verdict."""
    rng, counts = random.Random(5), {"before a checkpoint": 0, "after one": 0, "with a result": 0}
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        began = time.monotonic()
        subprocess.run(command(whole), check=True, capture_output=True)
        took = time.monotonic() - began
        expected = (whole / "result.npz").read_bytes()
        for i in range(times):
            out = Path(folder) / str(i)
            out.mkdir()
            shutil.copy(whole / "result.npz", out / "result.npz")
            counts[_killed(out, rng.uniform(0.0, took), expected)] += 1
            subprocess.run(command(out, "--resume"), check=True, capture_output=True)
            if (out / "result.npz").read_bytes() != expected:
                sys.exit(f"kill {i}: the resumed run has other bytes")
            shutil.rmtree(out)
            print(f"{i + 1} of {times}: {counts}", flush=True)
    found = ", ".join(f"{n} {words}" for words, n in counts.items())
    return f"{times} kills ({found}): {times} whole files, {times} times the same bytes."


def _killed(out: Path, after: float, old: bytes) -> str:
    """Kill a run after a time; the file that was there is whole, and still the old one or the new one."""
    process = subprocess.Popen(command(out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(after)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    if (out / "result.npz").read_bytes() != old:
        sys.exit("the file is neither the old one nor the new one")
    rbi.SimulationResult.load(out / "result.npz")
    if process.returncode == 0:
        return "with a result"
    return "after one" if (out / "result.checkpoint").exists() else "before a checkpoint"


# --- the page ---------------------------------------------------------------------------------------------------------


def table(rows: list[list[str]]) -> str:
    """Return rows as a Markdown table, the first one as its head."""
    head, *body = rows
    lines = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write(name: str, content: str) -> None:
    """Put a table between its markers in the page."""
    page = PAGE.read_text(encoding="utf-8")
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    if not pattern.search(page):
        sys.exit(f"{PAGE.name} has no {begin} ... {end}")
    new = pattern.sub(lambda _: f"{begin}\n{content}\n{end}", page)
    PAGE.write_text(new, encoding="utf-8")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=("faults", "passivity", "day", "kill"))
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=ROBOTS)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    given = parser.parse_args()
    measures: dict[str, Callable[[], str]] = {
        "faults": lambda: faults(given.robots),
        "passivity": passivity,
        "day": lambda: day(given.hours),
        "kill": lambda: kill(given.times),
    }
    made = measures[given.what]()
    print(made)
    if given.write:
        write(given.what, made)


if __name__ == "__main__":
    main()
