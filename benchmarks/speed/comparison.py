"""The tick and the closed loop compared with C++ and other libraries, on one arm, in one run."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks.arms import FINGERS
from rbimpedance._common.arrays import Array
from rbimpedance.cli import timing
from rbimpedance.cli.timing import (
    BACKENDS,
    DT,
    RNEA,
    Inputs,
    Timer,
    controller,
    inputs,
    interleaved,
    simulate_timer,
    timer,
)
from rbimpedance.control.controller import ImpedanceController
from rbimpedance.robot.arm_model import ArmModel
from rbimpedance.robot.load import load_robot
from rbimpedance.robot.loading.plain_urdf import plain

from . import ticks
from .libraries import PEERS, SOURCES, STEP, Started, Task, start
from .percentiles import median
from .plan import Setting
from .report import RATIO, Line, Section
from .workers import Worker, WorkerError

CPP = "c++"
KP, KD = 100.0, 20.0
"""Gains of the peers' law; peers/protocol.py has the same."""

CPP_AGREEMENT, PEER_AGREEMENT = 1e-9, 1e-6
"""Largest difference of a torque, N·m, with which it counts as the same."""

CPP_LOOP, MJ_STEP = "C++ loop", "mj_step alone"
"""Lines of the second table."""

_COMPARED = 200
_TICK = "C++ loop, same law on Pinocchio"
_CPP_TASKS = {
    "tick": Task(_TICK, "no checks of the inputs"),
    "rnea": Task("C++ rnea alone", "no controller"),
}


def compare(
    setting: Setting, names: tuple[str, ...] = (CPP, *PEERS), sources: Path = SOURCES
) -> tuple[Section, Section]:
    """Measure the tick and the closed loop of everything that runs here.

    Args:
        setting: As for the other sections; the arm is the panda without fingers, meshes and friction.
        names: Peers, and "c++" for the C++ loop.
        sources: Folder of their programs.
    """
    urdf, arm = _description()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        path = folder / "panda.urdf"
        path.write_text(urdf, encoding="utf-8")
        started = start(stack, path, names, sources)
        differences = _prepare(started, arm)
        ticks_table = _ticks(setting, arm, started, differences)
        return ticks_table, _loops(setting, arm, started, differences)


def _description() -> tuple[str, ArmModel]:
    description = load_robot("panda").description
    assert description is not None
    urdf = plain(description.xml, FINGERS)
    return urdf, load_robot(urdf)


def _prepare(started: Started, arm: ArmModel) -> dict[str, dict[str, float]]:
    """Send the states to every worker and compare torques; what fails is moved to the reasons."""
    given, differences = inputs(arm), {}
    rows = np.array([[x.q, x.v, *x.reference, x.tau_ext] for x in given]).ravel()
    for name, worker in list(started.workers.items()):
        try:
            worker.call("states", rows)
            differences[name] = _differences(name, worker, arm, given)
        except WorkerError as error:
            del started.workers[name]
            started.reasons[name] = str(error)
    return differences


def _differences(name: str, worker: Worker, arm: ArmModel, given: list[Inputs]) -> dict[str, float]:
    """Largest difference of each task's torque to ours, N·m, where the law is the same."""
    if name == CPP:
        made = controller(arm, "pinocchio")
        worker.call("filter", _filter_table(made))
        return {
            "tick": _distance(worker.call("torques"), _torques(made, given)),
            "loop": _distance(worker.call("run", [_COMPARED]), _end_of_run(made, given[0])),
        }
    law = computed_torques(arm, given)
    return {
        key: _distance(worker.call(key), law)
        for key, task in PEERS[name].tasks.items()
        if task.has_law
    }


def computed_torques(arm: ArmModel, given: list[Inputs]) -> Array:
    """Return M·(a_d + KP·(q_d - q) + KD·(v_d - v)) + bias - tau_ext by Pinocchio, shape (states, nv)."""
    rows = []
    for q, v, (q_d, v_d, a_d), tau_ext in given:
        a = a_d + KP * arm.difference(q, q_d) + KD * (v_d - v)
        rows.append(arm.inverse_dynamics(q, v, a) - tau_ext)
    return np.array(rows)


def _torques(made: ImpedanceController, given: list[Inputs]) -> Array:
    state, rows = made.init(), []
    for q, v, reference, tau_ext in given:
        output, state = made.step(state, q, v, reference, tau_ext)
        rows.append(output.tau)
    return np.array(rows)


def _end_of_run(made: ImpedanceController, x: Inputs) -> Array:
    """Return q and v after some steps of the loop that the C++ program runs, by `step` and ABA from Python."""
    q, v, arm, state = x.q, x.v, made.arm, made.init()
    for _ in range(_COMPARED):
        output, state = made.step(state, q, v, x.reference, x.tau_ext)
        v = v + DT * arm.forward_dynamics(q, v, output.tau, x.tau_ext)
        q = arm.integrate(q, DT * v)
    return np.concatenate([q, v])


def _filter_table(made: ImpedanceController) -> Array:
    """The nine numbers that take (q_e, v_e, tau_ext) of a joint to a_e and the next q_e and v_e."""
    maps = made.impedance.filter(1, DT).maps()  # type: ignore[attr-defined]
    return np.array(maps).ravel()


def _distance(mine: Array, truth: Array) -> float:
    return float(np.abs(mine.reshape(truth.shape) - truth).max())


def _ticks(
    setting: Setting,
    arm: ArmModel,
    started: Started,
    differences: Mapping[str, Mapping[str, float]],
) -> Section:
    timers = {name: timer(made) for name, made in ticks.of_arm(arm).items()}
    labels: dict[str, tuple[str, str, Task]] = {}
    for name, worker in started.workers.items():
        for key, task in _tasks(name).items():
            timers[task.label] = worker.timer(key)
            labels[task.label] = name, key, task
    found = interleaved(timers, setting.plan.ticks // 4, rounds=20, on_tick=setting.on_tick)
    yardsticks = {"rnea": median(found[RNEA])}
    if _TICK in found:
        yardsticks["C++"] = median(found[_TICK])
    lines = []
    for label, durations in found.items():
        figures = {"p50 [µs]": median(durations)}
        figures |= {f"{RATIO} {k}": median(durations) / x for k, x in yardsticks.items()}
        name, key, task = labels.get(label, ("", "", Task(label, "")))
        distance = differences.get(name, {}).get(key)
        if distance is not None:
            figures["torque off by [N·m]"] = distance
        version = started.versions.get(name, "")
        lines.append(Line(f"{label} {version}".strip(), figures, _note(name, task, distance)))
    lines += [Line(name, {}, reason) for name, reason in started.reasons.items()]
    return Section(
        "peers",
        "The tick compared with C++ and other libraries: panda, 7 joints",
        "Medians, all measured alternately in one run, each library in a process of its own and called from Python; "
        "the panda without fingers, friction and meshes. Ours has the impedance filter, the terminal surface and the "
        "super-twisting law; the peers compute a torque as close to it as they offer: "
        f"M·(a_d + {KP:g}·e + {KD:g}·ė) + bias - tau_ext.",
        tuple(lines),
    )


def _tasks(name: str) -> Mapping[str, Task]:
    return _CPP_TASKS if name == CPP else PEERS[name].tasks


def _note(name: str, task: Task, distance: float | None) -> str:
    agreement = CPP_AGREEMENT if name == CPP else PEER_AGREEMENT
    wrong = distance is not None and not distance <= agreement
    return f"NOT THE SAME TORQUE; {task.note}" if wrong else task.note


def _loops(
    setting: Setting,
    arm: ArmModel,
    started: Started,
    differences: Mapping[str, Mapping[str, float]],
) -> Section:
    given, plan = inputs(arm), setting.plan
    timers: dict[str, Timer] = {
        RNEA: timer(timing.rnea(arm, given)),
        "pin.aba": timer(ticks.aba(arm, given)),
        **{f"simulate, {b}": simulate_timer(arm, b) for b in BACKENDS},
    }
    notes = {f"simulate, {b}": "tick, ABA, semi-implicit Euler, log" for b in BACKENDS}
    for name, key, label, note in (
        (CPP, "loop", CPP_LOOP, "tick, ABA, semi-implicit Euler, no log"),
        ("mujoco", STEP, MJ_STEP, "no controller, no log, constraints off"),
    ):
        if name in started.workers:
            timers[label], notes[label] = started.workers[name].timer(key), note
    found = interleaved(
        timers, plan.loop_ticks * plan.runs, rounds=plan.runs, on_tick=setting.on_tick
    )
    yardstick = median(found[RNEA]) + median(found["pin.aba"])
    lines = []
    for label, durations in found.items():
        figures = {"a step [µs]": median(durations)}
        figures[f"{RATIO} (rnea + aba)"] = median(durations) / yardstick
        if CPP_LOOP in found:
            figures[f"{RATIO} C++"] = median(durations) / median(found[CPP_LOOP])
        if label == CPP_LOOP:
            figures["state off by [rad, rad/s]"] = differences[CPP]["loop"]
        lines.append(Line(label, figures, notes.get(label, "")))
    missing = {key: reason for key, reason in started.reasons.items() if key in (CPP, "mujoco")}
    lines += [Line(name, {}, reason) for name, reason in missing.items()]
    return Section(
        "peer-loops",
        "A closed-loop step compared with C++ and MuJoCo: panda, 7 joints",
        "Medians, all measured alternately in one run, on the model of the table above.",
        tuple(lines),
    )
