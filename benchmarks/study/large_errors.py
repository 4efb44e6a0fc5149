"""From a start that is off: the law against PIDs around the same reference, in the joints and at the tool.

    python -m benchmarks.study.large_errors [--tabulate]

Every law keeps the arm's torque limits and has anti-windup; with and without a soft start. Writes
docs/figures/large_errors.json, and the tables of docs/standard-study.md and docs/tool.md.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import rbimpedance as rbi
from benchmarks import pages
from benchmarks.arms import Array
from benchmarks.control.cartesian.task import IMPEDANCE, case
from benchmarks.progress import bar
from rbimpedance.study.standard.arms import ARMS, DT, posture

OFF, OFF_AT_TOOL = 0.1, 0.05
"""How far every joint is off its reference at the start [rad], and the tool [m]."""

DURATION, LATE, SOFT = 4.0, 3.0, 1.0
"""Of a run, when what is left of the error counts, and how long a soft start takes [s]."""

IN_JOINTS, AT_TOOL = ("panda", "ur5", "z1"), ("panda", "ur5")
POLES = (40, 100, 200)
POLES_AT_TOOL = (40, 100)
NEAR, NEAR_AT_TOOL = 1e-3, 1e-3
"""Error from which on the arm has arrived [rad], [m]."""

HEADER = (
    "law",
    "first torque",
    *("at a limit", "speed", "arrives [s]"),
    *("at a limit, soft", "speed, soft", "arrives, soft [s]"),
    "error left",
)


class Start(NamedTuple):
    """A start that is off, and who has to bring the arm back.

    Attributes:
        plant: The arm with what no controller knows.
        q: Configuration at the start.
        motion: Desired motion.
        laws: Controllers by name, made with limits or with None.
        deviation: Error of a run over time, one number a tick.
        near: Error from which on the arm has arrived.
        rest: The wrench or torque that is measured: none.
    """

    plant: rbi.ArmModel
    q: Array
    motion: Callable[[float], Any]
    laws: dict[str, Callable[[Any], Any]]
    deviation: Callable[[rbi.SimulationResult], Array]
    near: float
    rest: Array


def in_joints(robot: str) -> Start:
    """All joints off by `OFF`, gains of the standard study, payload and links 10 % heavier unknown."""
    task = ARMS[robot].task()
    center = posture(task.arm)
    motion = rbi.trajectories.cosine(task.arm, center=center, amplitude=0.2, period=4.0)
    plant = task.arm.with_scaled_inertia(1.1).with_payload(ARMS[robot].payload)
    laws: dict[str, Callable[[Any], Any]] = {
        "super-twisting terminal": lambda limits: task.known.controller(
            task.impedance, limits=np.inf if limits is None else limits
        )
    }
    for poles in POLES:
        laws[f"PID, poles {poles}"] = partial(_joint_pid, task, float(poles))
    q = task.arm.integrate(motion(0.0).q, np.full(task.arm.nv, OFF))
    return Start(plant, q, motion, laws, partial(_joint_error, motion), NEAR, np.zeros(plant.nv))


def _joint_error(motion: Callable[[float], Any], result: rbi.SimulationResult) -> Array:
    """Largest distance of a joint from its desired motion, whatever a soft start has it follow meanwhile."""
    assert result.plant is not None
    pairs = zip(result.t.tolist(), result.q, strict=True)
    return np.array([np.abs(result.plant.difference(q, motion(t).q)).max() for t, q in pairs])


def _joint_pid(task: Any, poles: float, limits: Any) -> rbi.baselines.PIDImpedance:
    return rbi.baselines.PIDImpedance(task.model, task.impedance, poles, DT, limits=limits)


def at_tool(robot: str) -> Start:
    """The tool off by `OFF_AT_TOOL`, the case of docs/tool.md."""
    setting = case(robot)
    arm, q, _ = setting
    R, p = arm.frame_placement(q)
    there = rbi.Pose(R, p + np.array([0.0, OFF_AT_TOOL, 0.0]))
    goal = rbi.CartesianReference(there, np.zeros(6), np.zeros(6))
    laws: dict[str, Callable[[Any], Any]] = {
        "super-twisting, default gains": lambda limits: rbi.CartesianController(
            arm, IMPEDANCE, dt=DT, limits=limits
        )
    }
    for poles in POLES_AT_TOOL:
        laws[f"PID on x_r, poles {poles}"] = partial(_tool_pid, arm, float(poles))
    return Start(setting.plant(), q, lambda _: goal, laws, _tool_error, NEAR_AT_TOOL, np.zeros(6))


def _tool_pid(arm: rbi.ArmModel, poles: float, limits: Any) -> rbi.baselines.CartesianPID:
    return rbi.baselines.CartesianPID(arm, IMPEDANCE, poles, DT, limits=limits)


def _tool_error(result: rbi.SimulationResult) -> Array:
    """Distance of the tool from where it should come to, whatever a soft start has it follow meanwhile."""
    assert result.tool is not None
    p = result.tool.position
    return np.asarray(np.linalg.norm(p[0] + np.array([0.0, OFF_AT_TOOL, 0.0]) - p, axis=1))


def measured(start: Start, law: str) -> dict[str, Any]:
    """First torque without limits, and the start with them, hard and soft."""
    make, plant, q = start.laws[law], start.plant, start.q
    free = make(None)
    still = np.zeros(plant.nv)
    output, _ = free.step(free.init(), q, still, start.motion(0.0), start.rest)
    limited = make(plant.effort_limit)
    return {
        "first_torque": np.abs(output.tau - free.arm.bias(q, still)).max(),
        "hard": _run(start, limited),
        "soft": _run(start, rbi.SoftStart(limited, SOFT)),
    }


def _run(start: Start, controller: Any) -> dict[str, float] | None:
    """Figures of a run; None where the arm was lost."""
    plant = start.plant
    try:
        result = rbi.simulate(controller, plant, start.motion, q0=start.q, duration=DURATION)
    except rbi.DivergenceError:
        return None
    error = start.deviation(result)
    far = np.flatnonzero(error > start.near)
    at_limit = (np.abs(result.tau) >= plant.effort_limit * (1.0 - 1e-9)).any(axis=1)
    return {
        "ticks_at_limit": int(at_limit.sum()),
        "speed": (np.abs(result.v) / plant.velocity_limit).max(),
        "arrives": result.t[far[-1]] if len(far) else 0.0,
        "left": error[result.t >= LATE].max(),
    }


def _cells(row: dict[str, Any]) -> list[str]:
    cells = [row["law"], f"{row['first_torque']:.0f}"]
    for kind in ("hard", "soft"):
        run = row[kind]
        if run is None:
            cells += ["lost", "–", "–"]
            continue
        has_arrived = run["arrives"] < DURATION - 2.0 * DT
        cells += [str(run["ticks_at_limit"]), f"{run['speed']:.2f}"]
        cells.append(f"{run['arrives']:.2f}" if has_arrived else "never")
    return [*cells, pages.power((row["soft"] or {}).get("left"))]


def tables(rows: list[dict[str, Any]], where: str) -> dict[str, str]:
    """Return the tables of a page by name, one for each arm."""
    found: dict[str, list[list[str]]] = {}
    for row in rows:
        if row["where"] == where:
            found.setdefault(f"start of {row['robot']}", []).append(_cells(row))
    return {name: pages.markdown(HEADER, lines) for name, lines in found.items()}


def main() -> None:
    """Measure, write and tabulate."""
    parser = pages.parser(__doc__)
    parser.add_argument("--tabulate", action="store_true", help="only tabulate what is there")
    asked = parser.parse_args()
    path = asked.out / "large_errors.json"
    if not asked.tabulate:
        rows = []
        runs = [("joints", robot, in_joints) for robot in IN_JOINTS]
        runs += [("tool", robot, at_tool) for robot in AT_TOOL]
        with bar() as progress:
            task = progress.add_task("arms", total=len(runs))
            for where, robot, make in runs:
                start = make(robot)
                for law in start.laws:
                    row = {"where": where, "robot": robot, "law": law} | measured(start, law)
                    rows.append(pages.plain(row))
                progress.advance(task)
        path.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    rows = json.loads(path.read_text("utf-8"))
    pages.rewrite(asked.docs / "standard-study.md", tables(rows, "joints"))
    pages.rewrite(asked.docs / "tool.md", tables(rows, "tool"))


if __name__ == "__main__":
    main()
