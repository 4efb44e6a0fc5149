"""What a closed loop costs: `simulate` with both backends, `simulate_batch` over worlds and threads, cold start.

    python -m benchmarks.speed.closed_loop [--json FILE] [--worlds 1 4 16 64 256 1024 4096] [--ticks 1000] [--cold]

Panda, 7 joints, substeps=1, logs included. Every figure is a ratio to one `pin.rnea` and one `pin.aba` called from
Python, measured in the same run right before it; the best of several medians is taken, since others may use the
machine. Times are those of the process ("cpu") and of the clock on the wall ("wall"): on a machine that is busy
otherwise, only the first tells anything. Ends with the agreement of both backends over 5 s.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

import rbimpedance as rbi
from benchmarks import arms
from rbimpedance.trajectories import cosine, hold

CHANNELS = ("q", "v", "q_r", "e1", "e2", "e_im", "s", "tau", "tau_ext")


class Cost(NamedTuple):
    """Microseconds of the process and on the wall."""

    cpu: float
    wall: float


def main() -> int:
    """Measure, print, write, and return the exit code."""
    arguments = _arguments()
    report: dict[str, Any] = {"machine": _machine()}
    report["single"] = list(_single(10_000))
    report["batch"] = list(_batch(arguments.worlds, arguments.ticks, arguments.threads))
    report["agreement"] = {
        name: _agreement(name) for name in ("two_link", "panda", "ur5", "kinova")
    }
    if arguments.cold:
        report["cold"] = _cold()
    print(_markdown(report))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(report, indent=1), encoding="utf-8")
    return int(max(report["agreement"].values()) > 1e-9)


def panda() -> rbi.ArmModel:
    """The arm of all figures."""
    return arms.load("panda", armature=0.1)


def build(arm: rbi.ArmModel) -> rbi.ImpedanceController:
    """The controller of all figures."""
    return arms.law(arm, rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="matched"))


def cost(call: Callable[[], object], repeats: int) -> Cost:
    """Best cost of a call."""
    costs = []
    for _ in range(repeats):
        cpu, wall = time.process_time(), time.perf_counter()
        call()
        costs.append((time.process_time() - cpu, time.perf_counter() - wall))
    return Cost(*(1e6 * min(x) for x in zip(*costs, strict=True)))


def base(arm: rbi.ArmModel, calls: int = 1000) -> Cost:
    """Best cost of one `pin.rnea` and one `pin.aba` from Python."""
    model, q, v = arm.model, arm.neutral, np.ones(arm.nv)
    data = model.createData()

    def both() -> None:
        for _ in range(calls):
            pin.rnea(model, data, q, v, v)
        for _ in range(calls):
            pin.aba(model, data, q, v, v)

    both()
    return Cost(*(x / calls for x in cost(both, 20)))


def _single(ticks: int) -> Any:
    """`simulate` by backend, trajectory and environment, per tick."""
    arm = panda()
    controller, plant = build(arm), arm.with_payload(1.5)
    motions = {"cosine": cosine(arm, amplitude=0.3, period=4.0), "hold": hold(arm)}
    wrenches = {"free": None, "environment": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]}
    backends: tuple[Literal["pinocchio", "compiled"], ...] = ("pinocchio", "compiled")
    for backend in backends:
        for motion, trajectory in motions.items():
            for name, wrench in wrenches.items():
                made = controller.with_backend(backend)

                def run(c: Any = made, t: Any = trajectory, w: Any = wrench) -> None:
                    rbi.simulate(c, plant, t, environment=w, duration=1e-3 * ticks, substeps=1)

                run()
                unit, mine = base(arm), cost(run, 7)
                yield {"backend": backend, "motion": motion, "environment": name} | _ratios(
                    mine, unit, ticks
                )


def _batch(worlds: list[int], ticks: int, threads: list[int]) -> Any:
    """`simulate_batch` with figures of merit, per world and step; each world has a plant of its own."""
    arm = panda()
    controller, trajectory = build(arm), cosine(arm, amplitude=0.3, period=4.0)
    plants = [arm.with_payload(mass) for mass in np.linspace(0.5, 2.0, max(worlds))]
    for n in worlds:
        for count in threads:

            def run(k: int = n, t: int = count) -> None:
                rbi.simulate_batch(
                    controller, plants[:k], trajectory, duration=1e-3 * ticks, substeps=1, threads=t
                )

            start = time.perf_counter()
            run()
            first = time.perf_counter() - start
            unit, mine = base(arm), cost(run, 5 if n < 1000 else 2)
            figures = _ratios(mine, unit, n * ticks)
            yield {"worlds": n, "threads": count, "first_run_s": first} | figures


def _ratios(mine: Cost, unit: Cost, steps: int) -> dict[str, float]:
    return {
        "cpu_us": mine.cpu / steps,
        "wall_us": mine.wall / steps,
        "cpu_ratio": mine.cpu / steps / unit.cpu,
        "wall_ratio": mine.wall / steps / unit.wall,
    }


def _agreement(name: str) -> float:
    """Largest difference of the compiled run to the readable one over 5 s, relative to each channel's largest entry."""
    arm = panda() if name == "panda" else rbi.load_robot(name)
    plant = arm.with_payload(0.5).with_friction(0.2, 0.3)
    controller, given = build(arm), (plant, cosine(arm, amplitude=0.3, period=2.0))
    settings: Any = {"environment": [1.0, -2.0, 3.0, 0.1, 0.0, 0.2], "duration": 5.0, "substeps": 2}
    mine = rbi.simulate(controller.with_backend("compiled"), *given, **settings)
    truth = rbi.simulate(controller.with_backend("numpy"), *given, **settings)
    return max(
        float(np.abs(getattr(mine, x) - getattr(truth, x)).max())
        / max(float(np.abs(getattr(truth, x)).max()), 1.0)
        for x in CHANNELS
    )


def _cold() -> dict[str, float]:
    """Seconds until the first compiled run is done, without and with a cache on disk."""
    code = (
        "import time, rbimpedance as rbi\n"
        "arm = rbi.load_robot('two_link')\n"
        "parts = rbi.Impedance(1, 10, 20), rbi.PowerSurface(3, 1.5), rbi.SuperTwisting(8, 10)\n"
        "c = rbi.ImpedanceController(arm, *parts, 1e-3, backend='compiled')\n"
        "given = c, arm, rbi.trajectories.hold(arm)\n"
        "t = time.process_time()\n"
        "rbi.simulate(*given, duration=0.01)\n"
        "print(time.process_time() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        seconds = [
            float(
                subprocess.run(
                    [sys.executable, "-c", code],
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=True,
                ).stdout
            )
            for _ in range(2)
        ]
    return {"compile_s": seconds[0], "from_disk_s": seconds[1]}


def _markdown(report: dict[str, Any]) -> str:
    lines = [
        "| `simulate`, substeps=1 | motion | environment | cpu | wall |",
        "| --- |" + " --- |" * 4,
    ]
    for row in report["single"]:
        name = f"{row['backend']} | {row['motion']} | {row['environment']}"
        lines.append(f"| {name} | {row['cpu_ratio']:.2f} | {row['wall_ratio']:.2f} |")
    lines += ["", "| worlds | threads | cpu | wall | first run [s] |", "| --- |" + " --- |" * 4]
    for row in report["batch"]:
        costs = f"{row['cpu_ratio']:.3f} | {row['wall_ratio']:.3f} | {row['first_run_s']:.2f}"
        lines.append(f"| {row['worlds']} | {row['threads']} | {costs} |")
    lines += ["", "| 5 s, both backends | largest difference |", "| --- | --- |"]
    lines += [f"| {name} | {x:.1e} |" for name, x in report["agreement"].items()]
    for name, seconds in report.get("cold", {}).items():
        lines.append(f"\n{name}: {seconds:.1f}")
    return "\n".join(lines)


def _machine() -> dict[str, Any]:
    versions = {"python": platform.python_version(), "pin": pin.__version__}
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return versions | {"cores": os.cpu_count(), "processor": platform.machine(), "load": load}


def _arguments() -> Any:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 4, 16, 64, 256, 1024, 4096])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--ticks", type=int, default=1000)
    parser.add_argument("--cold", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
