"""The command `rbimpedance bench`: what tick, closed loop and batch cost here, as ratios to `pin.rnea`."""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
import typer

from .._common.arrays import Array
from ..exceptions import InputError
from ..robot.arm_model import ArmModel
from ..robot.load import load_robot
from .terminal import number, print_json, progress, say, stdout
from .timing import (
    AT_TOOL,
    BACKENDS,
    REALTIME,
    RNEA,
    SIMULATE,
    STEP,
    Progress,
    Timer,
    batch_timer,
    controller,
    inputs,
    interleaved,
    plants,
    realtime,
    rnea,
    simulate_timer,
    step,
    step_at_tool,
    timer,
)

TIME, RATIO = "µs", "× pin.rnea"

Costs: TypeAlias = Mapping[str, Mapping[str, float]]
"""`TIME` and `RATIO` by the name of what was timed."""

_PANDA, _FINGERS = "panda", ("panda_finger_joint1", "panda_finger_joint2")
_TURNS, _RUN_TURNS, _WORLDS = 50, 5, 64


def bench(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="As for run; the panda is taken without fingers.")
    ] = _PANDA,
    ticks: Annotated[
        int, typer.Option("--ticks", metavar="N", min=100, help="How many of each kind.")
    ] = 20_000,
    compare: Annotated[
        Path | None,
        typer.Option("--compare", metavar="FILE", help="Compare with what --json wrote."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Says where the benchmark with C++ and peers is.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Measure what tick, closed loop and batch cost here, as ratios to one call of pin.rnea from Python."""
    if full:
        words = "`python -m benchmarks.speed` in a checkout of the project"
        raise InputError(f"--full: the benchmark with C++ and other libraries is now {words}")
    before = {} if compare is None else load(compare)
    machine = describe()
    if compare is not None:
        _note_other_conditions(compare, robot, machine)
    _say(f"{robot} on {machine['processor']}, pin {machine['pin']}", quiet=as_json)
    arm = load_robot(robot, lock=_FINGERS if robot == _PANDA else ())
    found: dict[str, Costs] = {}
    for title, measure in MEASUREMENTS.items():
        _say(f"\n{title}", quiet=as_json)
        with progress(title, quiet=as_json, every=1) as on_tick:
            found[title] = costs(measure(arm, ticks, on_tick))
        for name, cost in found[title].items():
            _say(_line(name, cost, before.get(title, {}).get(name)), quiet=as_json)
    if as_json:
        print_json({"robot": robot, "machine": machine, "costs": found})


def tick(arm: ArmModel, count: int, on_tick: Progress | None = None) -> dict[str, Array]:
    """Time `pin.rnea` and every way to take a tick, back to back, by turns [µs]."""
    given, made = inputs(arm), {b: controller(arm, b) for b in BACKENDS}
    timers = {RNEA: timer(rnea(arm, given))}
    timers |= {STEP[b]: timer(step(made[b], given)) for b in BACKENDS}
    timers |= {REALTIME[b]: timer(realtime(made[b], given)) for b in BACKENDS}
    return interleaved(timers, count, rounds=_TURNS, on_tick=on_tick)


def at_tool(arm: ArmModel, count: int, on_tick: Progress | None = None) -> dict[str, Array]:
    """Time the tick of a `CartesianController`, beside `pin.rnea` [µs]; only the latter where joints mimic others."""
    given, timers = inputs(arm), dict[str, Timer]()
    if not arm.model.mimicking_joints:
        timers = {AT_TOOL[b]: timer(step_at_tool(arm, b, given)) for b in BACKENDS}
    timers = {RNEA: timer(rnea(arm, given)), **timers}
    return interleaved(timers, count, rounds=_TURNS, on_tick=on_tick)


def closed_loop(arm: ArmModel, count: int, on_tick: Progress | None = None) -> dict[str, Array]:
    """Time `simulate` with one physics step a tick, logs included, beside `pin.rnea` [µs a tick]."""
    timers = {SIMULATE[b]: simulate_timer(arm, b) for b in BACKENDS}
    return _beside_rnea(arm, timers, count, on_tick)


def batch(arm: ArmModel, count: int, on_tick: Progress | None = None) -> dict[str, Array]:
    """Time `simulate_batch` on one thread and on all cores, beside `pin.rnea` [µs a world and tick]."""
    worlds = plants(arm, _WORLDS)
    timers = {
        f"{_WORLDS} worlds, threads: {n}": batch_timer(arm, worlds, n)
        for n in dict.fromkeys((1, os.cpu_count() or 1))
    }
    return _beside_rnea(arm, timers, max(count // 10, _RUN_TURNS), on_tick)


MEASUREMENTS: dict[str, Callable[[ArmModel, int, Progress | None], dict[str, Array]]] = {
    "one tick, back to back": tick,
    "one tick at the tool": at_tool,
    "closed loop, a tick": closed_loop,
    "many closed loops, a world and tick": batch,
}
"""What is measured, by its title."""


def costs(durations: Mapping[str, Array]) -> Costs:
    """Return medians [µs] and their ratios to that of `pin.rnea`."""
    medians = {name: float(np.median(times)) for name, times in durations.items()}
    return {name: {TIME: x, RATIO: x / medians[RNEA]} for name, x in medians.items()}


def load(path: Path) -> Mapping[str, Costs]:
    """Read the costs that `bench --json` printed.

    Raises:
        InputError: It is no such file.
    """
    try:
        found: Mapping[str, Costs] = json.loads(path.read_text(encoding="utf-8"))["costs"]
        return {
            title: {name: {RATIO: float(cost[RATIO])} for name, cost in part.items()}
            for title, part in found.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"'{path}' is not what `bench --json` printed: {error!r}") from error


def _note_other_conditions(path: Path, robot: str, machine: Mapping[str, str]) -> None:
    """Say where a file to compare with is of another robot or processor."""
    data = json.loads(path.read_text(encoding="utf-8"))
    was, now = (
        (data.get("robot"), data.get("machine", {}).get("processor")),
        (robot, machine["processor"]),
    )
    others = [f"{b} instead of {a}" for a, b in zip(was, now, strict=True) if a not in {None, b}]
    if others:
        say(f"note: '{path}' was measured with something else: {', '.join(others)}")


def describe() -> dict[str, str]:
    """Return date, processor, system, load and versions; neither host name nor path."""
    now, release = datetime.now(tz=timezone.utc), ".".join(platform.release().split(".")[:2])
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return {
        "date": f"{now:%Y-%m-%d %H:%M} UTC",
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {release}, {platform.machine()}",
        "load at the start": load,
        "Python": platform.python_version(),
    } | {name: version(name) for name in ("rbimpedance", "pin", "numba", "numpy")}


def _beside_rnea(
    arm: ArmModel, timers: Mapping[str, Timer], count: int, on_tick: Progress | None
) -> dict[str, Array]:
    timers = {RNEA: timer(rnea(arm, inputs(arm))), **timers}
    return interleaved(timers, count, rounds=_RUN_TURNS, on_tick=on_tick)


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8") if info.exists() else ""
    found = re.search(r"^model name\s*: (.+)$", text, re.MULTILINE)
    return found[1] if found else platform.processor() or platform.machine()


def _line(name: str, cost: Mapping[str, float], before: Mapping[str, float] | None) -> str:
    line = f"{name:32}{number(cost[TIME]):>8} {TIME}{number(cost[RATIO]):>9} {RATIO}"
    if before is None:
        return line
    return f"{line}, before {number(before[RATIO])}: {cost[RATIO] / before[RATIO] - 1.0:+.0%}"


def _say(line: str, *, quiet: bool) -> None:
    if not quiet:
        stdout.print(line, soft_wrap=True, markup=False, highlight=False)
