"""How far the torque jumps when the target changes while the arm is pushed: at once, and in a ramp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance import trajectories
from rbimpedance.law.impedance_changes import blend, check_variation

from .common import Figures, Job, Options, Part, as_rows, simulate
from .pushed import FIRST, SETTINGS, law, load, recipe

RAMPS = (0.0, 0.1, 0.5, 1.0)  # s


class Scheduled:
    """A controller whose target changes from tick to tick; from the last one on it stays."""

    def __init__(self, controllers: list[rbi.ImpedanceController]) -> None:
        self.controllers = controllers
        self.arm, self.dt = controllers[0].arm, controllers[0].dt

    def init(self) -> rbi.ControllerState:
        """Return the first controller's state."""
        return self.controllers[0].init()

    def step(self, state: rbi.ControllerState, *inputs: Any) -> Any:
        """One tick of the controller whose turn it is."""
        current = self.controllers[min(state.ticks, len(self.controllers) - 1)]
        return current.step(state, *inputs)

    def impedance_error(self, output: rbi.ControllerOutput, a: Array) -> Array:
        """e_im of the last target."""
        return self.controllers[-1].impedance_error(output, a)


def change(ramp: float, seed: int) -> Figures:
    """K_d from 20 to 100 N·m/rad under 20 N."""
    arm, pose = load("panda"), SETTINGS[FIRST].q
    soft = rbi.Impedance(1.0, damping_ratio=1.0, stiffness=20.0)
    stiff = rbi.Impedance(1.0, damping_ratio=1.0, stiffness=100.0)
    ticks = max(round(ramp / DT), 1)
    shares = [0.0] * 2000 + list(np.linspace(0.0, 1.0, ticks + 1)[1:])
    targets = [blend(soft, stiff, float(share), arm.nv) for share in shares]
    first = law(arm, targets[0], recipe(arm, [arm], pose, seed))
    controllers = [first] * 2000 + [first.with_impedance(target) for target in targets[2000:]]
    result = simulate(
        Scheduled(controllers),
        arm,
        trajectories.hold(arm, pose),
        environment=rbi.FrameWrench([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]),
        q0=pose,
        duration=5.0,
    )
    jumps = np.abs(np.diff(result.tau, axis=0)).max(axis=1)
    report = check_variation(targets[1990:] + [stiff] * 10, DT, arm.nv)
    return {
        "ramp": ramp,
        "jump": jumps[1995 : 2000 + ticks + 5].max(),
        "stable": report.stable,
        "margin": report.margin.min(),
    }


def jobs(options: Options) -> list[Job]:
    """Every ramp."""
    return [Job(change, (ramp, options.seed)) for ramp in RAMPS]


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Largest steps of the torque."""
    rows = [
        (
            f"over {row['ramp']:g} s" if row["ramp"] else "at once",
            f"{row['jump']:.2g} N·m",
            "stable" if row["stable"] else "not proven",
        )
        for row in data["rows"]
    ]
    header = ("change", "largest step of the torque from tick to tick", "`check_variation`")
    return {"variable": markdown(header, rows)}


PARTS = {"variable": Part(jobs, as_rows, tables)}
