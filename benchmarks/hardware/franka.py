"""Laws on a Franka, or on a server that simulates one, through the maker's own client: one row a law.

    franky-sim -s mujoco --hostname 127.0.0.1
    python -m benchmarks.hardware.franka --urdf fr3.urdf --duration 600

With limits enforced, and a heavier flange (franka-sim compensates the weight of all bodies, so its inertia alone is
unknown):

    python -m benchmarks.hardware.franka --heavier fr3.xml --mass 2 > heavy.xml
    FR3_MJCF=heavy.xml run-franka-sim-server --enforce-comm-constraints --enforce-motion-limits
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

import rbimpedance as rbi
from rbimpedance.control.wrapper import ControllerWrapper
from rbimpedance.hardware import franka, run

ROTORS = (0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074)
"""Reflected inertia of the rotors, as in the model of the servers [kg·m²]."""

LIMITS = rbi.Limits(franka.FR3.effort, 0.9 * franka.FR3.torque_rate)
AMPLITUDE = np.array([0.15, 0.1, 0.15, 0.15, 0.2, 0.2, 0.3])


class Limited(ControllerWrapper[Any, Any]):
    """A law without limits of its own: those of the robot cut it off."""

    def __init__(self, controller: Any) -> None:
        object.__setattr__(self, "controller", controller)

    @property
    def limits(self) -> rbi.Limits:
        """Those of the robot."""
        return LIMITS

    def init(self) -> Any:
        """Return the state of the law."""
        return self.controller.init()

    def _step(self, state: Any, given: Any) -> Any:
        return self.controller.step(state, *given)

    def _elapsed(self, state: Any, period: float) -> Any:
        return self.controller.elapsed(state, period)

    def handover(self, state: Any, now: Any) -> Any:
        """Hand over to the law."""
        return self.controller.handover(state, now)


def laws(arm: rbi.ArmModel) -> dict[str, Callable[[], Any]]:
    """The laws by name."""
    soft = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)

    def pd() -> Any:
        stiff = rbi.Impedance(mass=1.0, damping=80.0, stiffness=1600.0)
        return Limited(rbi.baselines.ComputedTorqueImpedance(arm, stiff, 1e-3))

    def pid(bandwidth: float) -> Any:
        return rbi.baselines.PIDImpedance(arm, soft, bandwidth, 1e-3, limits=LIMITS)

    def observer(bandwidth: float) -> Any:
        return rbi.HardwareController(
            arm,
            rbi.Hardware(delay=2),
            soft,
            bandwidths=(bandwidth, bandwidth),
            dt=1e-3,
            limits=LIMITS,
        )

    return {
        "default": lambda: rbi.ImpedanceController(arm, soft, dt=1e-3, limits=LIMITS),
        "observer 20": lambda: observer(20.0),
        "observer 40": lambda: observer(40.0),
        "PD": pd,
        "PID 20": lambda: pid(20.0),
        "PID 40": lambda: pid(40.0),
        "PID 60": lambda: pid(60.0),
    }


def swing(q0: Any) -> Callable[[float], rbi.Reference]:
    """All joints swing about the start, from rest within 2 s."""

    def motion(t: float) -> rbi.Reference:
        x, w = min(t / 2.0, 1.0), np.pi / 2.0
        b = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        db = 15.0 * x**2 * (1.0 - x) ** 2
        ddb = 15.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        s, c = np.sin(w * t), np.cos(w * t)
        return rbi.Reference(
            q0 + AMPLITUDE * b * s,
            AMPLITUDE * (db * s + b * w * c),
            AMPLITUDE * (ddb * s + 2.0 * db * w * c - b * w**2 * s),
        )

    return motion


def heavier(model: Path, mass: float) -> str:
    """Return a MuJoCo model with a mass at the flange that its gravity compensation does not hold."""
    tree = etree.parse(str(model))
    compiler = tree.find("compiler")
    compiler.set("meshdir", str(model.parent.resolve() / "meshes"))
    flange = next(each for each in tree.iter("body") if each.get("name").endswith("link7"))
    body = etree.SubElement(flange, "body", name="payload", pos="0 0 0.2", gravcomp="0")
    inertia = f"{0.4 * mass * 0.05**2:g} " * 3
    etree.SubElement(body, "inertial", pos="0 0 0", mass=f"{mass:g}", diaginertia=inertia.strip())
    return etree.tostring(tree, encoding="unicode")


def main() -> None:
    """Drive the robot with every law."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--urdf", type=Path)
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--law", nargs="*")
    parser.add_argument("--heavier", type=Path)
    parser.add_argument("--mass", type=float, default=2.0)
    options = parser.parse_args()
    if options.heavier is not None:
        print(heavier(options.heavier, options.mass))
        return
    arm = rbi.load_robot(str(options.urdf), armature=ROTORS)
    print("| law | ended | error rms, mrad | largest | torque step rms, N·m | limited | late |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for name, make in laws(arm).items():
        if options.law and name not in options.law:
            continue
        robot, law = franka.Franka(options.host, arm), make()
        law.warm_up()
        try:
            report = run(robot, law, swing(robot.read().q), duration=options.duration).report
        except rbi.RobotError as error:
            if error.run is None:
                raise
            report = error.run.report
        error, most = 1e3 * report.error_rms.max(), 1e3 * report.error_largest.max()
        row = f"| {name} | {report.ended}, {report.ticks} ticks | {error:.3f} | {most:.2f} "
        work = f"work {1e6 * report.work_p50:.0f}, {1e6 * report.work_p999:.0f} µs"
        print(
            f"{row}| {report.step_rms.max():.3f} | {report.limited} | {report.late} | {work}",
            flush=True,
        )


if __name__ == "__main__":
    main()
