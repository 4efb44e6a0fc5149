"""Do the compiled RNEA, ABA and CRBA agree with Pinocchio's, on every robot there is?

    python -m benchmarks.robot.compiled_agreement [--corpus ../shared/urdf_corpus] [--states 1000] [--only panda ur5]

Every fixed-base robot of example-robot-data, and every URDF file of a folder, at random states. One line a robot: the
largest difference, relative to the largest entry of Pinocchio's result, over the states. Exit code 1 if one is
larger than the bound with which an arm is served.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from example_robot_data.robots_loader import ROBOTS

import rbimpedance as rbi
from benchmarks.pages import ROOT
from rbimpedance.robot.compiled.dynamics import AGREEMENT, CompiledDynamics


def main() -> int:
    """Compare, print, and return the exit code."""
    arguments = _arguments()
    worst = 0.0
    for name, source in _sources(arguments.corpus, arguments.only):
        try:
            arm = load(source)
            differences = agreement(arm, arguments.states)
        except rbi.RBImpedanceError as error:
            print(f"{name:32} refused: {error}")
            continue
        worst = max(worst, *differences.values())
        figures = "  ".join(f"{key} {value:.1e}" for key, value in differences.items())
        print(f"{name:32} nv = {arm.nv:3}  {figures}", flush=True)
    print(f"largest: {worst:.1e}, bound: {AGREEMENT:g}")
    return int(worst > AGREEMENT)


def load(source: str | Path) -> rbi.ArmModel:
    """Load a robot as its refusals propose: with rotors, or with the unsupported joints locked."""
    locked: tuple[str, ...] = ()
    armature = None
    for _ in range(3):
        try:
            arm = rbi.load_robot(source, lock=locked, armature=armature)
            arm.rigid_bodies()
            break
        except rbi.ModelError as error:
            if "armature=" in str(error):
                armature = 0.05
            elif isinstance(error, rbi.UnsupportedJointError):
                locked = (*locked, *error.joints)
            else:
                raise
    return rbi.load_robot(source, lock=locked, armature=armature).with_friction(0.3, 0.5)


def agreement(arm: rbi.ArmModel, states: int) -> dict[str, float]:
    """Largest relative difference of each algorithm over random states."""
    rng, mine, judge = np.random.default_rng(5), CompiledDynamics(arm), arm.raw_dynamics
    worst = dict.fromkeys(("RNEA", "ABA", "CRBA"), 0.0)
    for _ in range(states):
        q = arm.random_configuration(rng)
        v, x = rng.normal(size=(2, arm.nv))
        pairs: dict[str, tuple[Any, Any]] = {
            "RNEA": (mine.inverse_dynamics(q, v, x), judge.inverse_dynamics(q, v, x)),
            "ABA": (mine.forward_dynamics(q, v, x), judge.forward_dynamics(q, v, x)),
            "CRBA": (mine.mass_matrix(q), judge.mass_matrix(q)),
        }
        for key, (got, truth) in pairs.items():
            worst[key] = max(worst[key], float(np.abs(got - truth).max() / np.abs(truth).max()))
    return worst


def _sources(corpus: Path, only: list[str]) -> Iterator[tuple[str, str | Path]]:
    yield "two_link", "two_link"
    for name, description in ROBOTS.items():
        if not description.free_flyer and (not only or name in only):
            yield name, name
    for path in sorted(corpus.glob("*.urdf")) if not only else ():
        yield path.stem, path


def _arguments() -> Any:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--corpus", type=Path, default=ROOT.parent / "shared" / "urdf_corpus")
    parser.add_argument("--states", type=int, default=1000)
    parser.add_argument("--only", nargs="*", default=[])
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
