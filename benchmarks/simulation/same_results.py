"""Whether two versions of the package compute the same: section 4 of the paper, runs on six arms, a small study.

    python -m benchmarks.simulation.same_results OTHER_CHECKOUT

Each version runs in a process of its own, from its `src`. The ten largest differences are printed, each relative to the
largest entry of its array. Exit code 1 if one is above 1e-12.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.study import Experiment, Study, Task

BOUND = 1e-12
CHANNELS = ("q", "v", "q_r", "e1", "e2", "e_im", "s", "tau", "tau_ext")
ARMS: dict[str, tuple[tuple[float, ...], tuple[str, ...]]] = {
    "panda": (
        (0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8),
        ("panda_finger_joint1", "panda_finger_joint2"),
    ),
    "ur5": ((0.0, -1.2, 1.6, -1.9, -1.5, 0.0), ()),
    "z1": ((0.0, 1.0, -1.2, 0.2, 0.0, 0.0), ("jointGripper",)),
    "xarm7": ((0.0, -0.4, 0.0, 1.2, 0.0, 1.6, 0.0), ()),
    "kinova": ((0.0, 2.9, 1.9, 0.6, 2.6, 0.0), ()),
    "talos_arm": ((0.6, 0.2, -1.4, 0.0, 0.0, 0.0), ("gripper_left_joint",)),
}
"""Angles from the zero configuration [rad], and joints that are locked."""
Results = dict[str, NDArray[np.float64]]


def law() -> tuple[rbi.FastTerminalSurface, rbi.SuperTwisting]:
    """Return the surface and the reaching law of every run."""
    return rbi.FastTerminalSurface(2.0, 3.0, 0.6), rbi.SuperTwisting(15.0, 40.0)


def runs() -> Iterator[tuple[str, rbi.SimulationResult]]:
    """Section 4, published and corrected; each arm under load, with both backends.

    Arguments have the names of version 0.1, which later versions still take.
    """
    yield "paper", rbi.scenarios.paper(duration=2.0).simulate()
    corrected = rbi.scenarios.paper(surface="fast-terminal", scheme="matched", duration=2.0)
    yield "paper, corrected", corrected.simulate()
    for name, (angles, lock) in ARMS.items():
        arm = rbi.load_robot(name, lock=lock, armature=0.1)
        center = arm.integrate(arm.zero, angles)
        motion = rbi.trajectories.cosine(arm, center=center, amplitude=0.05, period=3.0)
        plant = arm.with_payload(0.5).with_scaled_inertia(1.1).with_friction(0.5, 0.2)
        for backend in ("pinocchio", "compiled"):
            made: Any = rbi.ImpedanceController(
                arm,
                rbi.Impedance(1.0, 10.0, 20.0),
                *law(),
                1e-3,
                limits=rbi.Limits(300.0, rate=2e4),
                backend=backend,
            )
            wrench = rbi.FrameWrench([3.0, -2.0, 1.0, 0.1, 0.2, -0.3])
            start: Any = {
                "q0": motion(0.0).q,
                "duration": 0.5,
                "wrench": wrench,
                "backend": backend,
            }
            yield f"{name}, {backend}", rbi.simulate(made, plant, motion, **start)


def spring(task: Task) -> Any:
    """A baseline for the study."""
    return rbi.baselines.PDGravity(task.arm, task.impedance, task.dt)


def ours(task: Task) -> Any:
    """The law for the study."""
    return rbi.ImpedanceController(task.arm, task.impedance, *law(), task.dt)


def payload(task: Task, rng: np.random.Generator) -> Experiment:
    """A load that is drawn at random."""
    motion = rbi.trajectories.cosine(task.arm, center=0.5, amplitude=0.2, period=1.0)
    mass = rng.uniform(0.1, 0.5)
    plant = task.arm.with_payload(mass)
    return Experiment(plant=plant, trajectory=motion, q0=motion(0.0).q, inputs={"payload": mass})


def robot(name: str) -> Task:
    """What the study's controllers are made for."""
    arm = rbi.load_robot(name)
    return Task(robot=name, arm=arm, impedance=rbi.Impedance(1.0, 10.0, 20.0), dt=1e-3)


STUDY = Study(
    name="same",
    robots={"two_link": partial(robot, "two_link")},
    controllers={"spring": spring, "ours": ours},
    disturbances={"payload": payload},
    samples=3,
    duration=0.5,
    after=0.2,
    seed=5,
)


def compute() -> Results:
    """Return every array of the version that is imported."""
    found = {
        f"{name}: {channel}": np.asarray(getattr(result, channel))
        for name, result in runs()
        for channel in CHANNELS
    }
    with tempfile.TemporaryDirectory() as folder:
        rows = rbi.run_study(STUDY, Path(folder) / "study").to_pylist()
    for i, row in enumerate(rows):
        measured = {key: value for key, value in row.items() if isinstance(value, float)}
        found |= {
            f"study, row {i}: {k}": np.array(v) for k, v in measured.items() if k != "seconds"
        }
    return found


def results_of(checkout: Path, file: Path) -> Results:
    """Let the version of a checkout compute, and return its arrays."""
    environment = os.environ | {"PYTHONPATH": str(checkout / "src")}
    command = [sys.executable, __file__, "--write", str(file)]
    subprocess.run(command, env=environment, check=True)
    with np.load(file) as archive:
        return dict(archive)


def difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the largest difference, relative to the largest entry; infinite for other shapes."""
    if one.shape != other.shape:
        return float("inf")
    if np.array_equal(one, other, equal_nan=True):
        return 0.0
    return float(np.abs(one - other).max() / max(np.abs(one).max(), np.finfo(float).tiny))


def main() -> int:
    """Compare, print, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, nargs="?", help="a checkout of the other version")
    parser.add_argument("--write", type=Path, help="only compute, into this file")
    given = parser.parse_args()
    if given.write is not None:
        warnings.simplefilter("ignore", DeprecationWarning)
        np.savez(given.write, **compute())  # type: ignore[arg-type]
        return 0
    here = Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory() as folder:
        before = results_of(given.other.resolve(), Path(folder) / "before.npz")
        after = results_of(here, Path(folder) / "after.npz")
    worst = {name: difference(before[name], after[name]) for name in before.keys() & after.keys()}
    for name in sorted(before.keys() ^ after.keys()):
        print(f"only in one version: {name}")
    for name, value in sorted(worst.items(), key=lambda item: -item[1])[:10]:
        print(f"{value:.1e}  {name}")
    largest, equal = max(worst.values()), sum(value == 0.0 for value in worst.values())
    print(f"{len(worst)} arrays, {equal} equal to the bit, largest difference {largest:.1e}")
    return int(largest > BOUND)


if __name__ == "__main__":
    sys.exit(main())
