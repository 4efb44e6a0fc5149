"""Which robots load, and do they run? Every robot of example-robot-data and, if there, a corpus of URDF files.

    python -m benchmarks.robot.robots_table [--corpus ../shared/urdf_corpus] [--out docs/robots.md] [--only panda ur5]

Each robot is loaded, its dynamics are held against two identities at random states, and a closed loop of two seconds is
run on a plant whose links are 10 % heavier than the controller knows. A robot that is refused is loaded again the way
that the refusal proposes. Writes the table as Markdown.
"""

from __future__ import annotations

import argparse
import platform
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from example_robot_data.robots_loader import ROBOTS
from rich.console import Console
from rich.progress import track

import rbimpedance as rbi
from benchmarks.arms import DT, law
from benchmarks.pages import DOCS, ROOT

STATES = 20
DURATION = 2.0  # s
ARMATURE = 0.1  # kg·m²

KINDS = (
    ("JointModelMimic", "mimic"),
    ("JointModelRUB", "continuous"),
    ("JointModelRevoluteUnb", "continuous"),
    ("JointModelR", "revolute"),
    ("JointModelP", "prismatic"),
)


@dataclass
class Row:
    """What is known of one robot."""

    name: str
    floating: bool = False
    refusal: str = ""
    arguments: str = ""
    arm: rbi.ArmModel | None = None
    identities: tuple[float, float] = (np.nan, np.nan)
    loop: str = ""
    geared: str = ""


def examine(name: str, source: str | Path) -> Row:
    """Load a robot, in the way that its refusals propose, and try it."""
    row = Row(name)
    arguments: dict[str, Any] = {}
    for _ in range(4):
        try:
            row.arm = rbi.load_robot(source, **arguments)
            break
        except rbi.UnsupportedJointError as error:
            row.floating = row.floating or error.joints == ("root_joint",)
            if error.joints != ("root_joint",):
                row.refusal = row.refusal or error.reason
            lock = (*arguments.get("lock", ()), *error.joints)
            geared = {"armature": ARMATURE, "massless": "massless=" in error.reason}
            arguments = {"lock": lock} if "lock=" in error.reason else geared
        except rbi.ModelError as error:
            row.refusal = row.refusal or str(error)
            break
    row.arguments = ", ".join(f"{key}={value!r}" for key, value in arguments.items())
    if row.arm is not None:
        row.identities = identities(row.arm)
        row.loop = closed_loop(row.arm)
        row.geared = closed_loop(row.arm.with_armature(ARMATURE))
    return row


def identities(arm: rbi.ArmModel) -> tuple[float, float]:
    """Largest relative errors of M a + bias against one RNEA, and of ABA after RNEA."""
    rng = np.random.default_rng(0)
    worst = np.zeros(2)
    for _ in range(STATES):
        q, v, a = arm.random_configuration(rng), rng.normal(size=arm.nv), rng.normal(size=arm.nv)
        tau = arm.inverse_dynamics(q, v, a)
        product = arm.mass_matrix(q) @ a + arm.bias(q, v)
        back = arm.forward_dynamics(q, v, tau)
        errors = norm(product - tau) / norm(tau), norm(back - a) / norm(a)
        worst = np.maximum(worst, errors)
    return float(worst[0]), float(worst[1])


def norm(x: np.ndarray[Any, Any]) -> float:
    """Euclidean norm."""
    return float(np.linalg.norm(x))


def closed_loop(arm: rbi.ArmModel) -> str:
    """Largest error over the last half second of a loop, or how it failed."""
    controller = law(arm, rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="matched"))
    trajectory = rbi.trajectories.cosine(arm, amplitude=0.05, period=2.0)
    q0 = arm.integrate(arm.neutral, np.full(arm.nv, 0.05))
    try:
        result = rbi.simulate(controller, arm, trajectory, q0=q0, duration=DURATION)
    except rbi.DivergenceError as error:
        return f"diverges at {error.time:.3g} s, `{error.joint}`"
    finite = all(np.isfinite(x).all() for x in (result.q, result.v, result.tau, result.e1))
    last = np.abs(result.e1[result.t >= DURATION - 0.5]).max()
    return f"{last:.1e}" if finite else "not finite"


def line(row: Row) -> str:
    """One line of the table."""
    arm = row.arm
    if arm is None:
        return f"| {row.name} | – | – | – | – | – | – | – | – | – | {escape(row.refusal)} |"
    model = arm.model
    kinds = Counter(
        next(kind for prefix, kind in KINDS if joint.shortname().startswith(prefix))
        for joint in list(model.joints)[1:]
    )
    joints = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    mass = sum(body.mass for body in list(model.inertias)[1:])
    given = int(np.isfinite(arm.effort_limit).sum())
    efforts = {arm.nv: "all", 0: "none"}.get(given, f"{given} of {arm.nv}")
    rnea, aba = row.identities
    figures = f"{arm.nq} | {arm.nv} | {joints} | {mass:.3g} | {efforts}"
    return f"| {row.name} | {figures} | {rnea:.0e} | {aba:.0e} | {row.loop} | {row.geared} | {remarks(row)} |"


def remarks(row: Row) -> str:
    """Why a robot was refused, what it was loaded with, and the loader's notes except those about meshes."""
    parts = ["floating base"] if row.floating else []
    if row.refusal:
        parts.append(f"refused as it is: {row.refusal}")
    if row.arguments:
        parts.append(f"loaded with `{row.arguments}`")
    notes = row.arm.notes if row.arm is not None else ()
    parts += [note for note in notes if "mesh files" not in note and "limit is 0" not in note]
    return escape("; ".join(parts))


def escape(text: str) -> str:
    """Keep a text inside one cell of a Markdown table."""
    return text.replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")


def document(sections: dict[str, list[Row]]) -> str:
    """Return the page."""
    versions = ", ".join(f"{n} {version(n)}" for n in ("pin", "example-robot-data", "numpy"))
    head = f"""# Robots

Made by `python -m benchmarks.robot.robots_table` with {versions}, Python {platform.python_version()}.

- **joints**: movable ones after loading; a *mimic* joint follows another one and has no degree of freedom of its own.
- **mass**: of what moves [kg]. **efforts**: for how many joints the description gives an effort limit (0: not given).
- **RNEA**: largest relative error of M(q)·a + bias(q, v) against one RNEA at {STATES} random states.
- **ABA**: largest relative error of ABA after RNEA at the same states.
- **loop**: largest error e1 [rad, m] in the last quarter of {DURATION:g} s of closed loop, or where it diverges: fast
  terminal surface, matched scheme, k1 = 8, k2 = 10, {DT * 1e3:g} ms, a swing of 0.05 about neutral, no load. These
  gains are not tuned to the arm: the figure says that the loop runs, not how well it could.
- **geared**: the same with `armature={ARMATURE:g}`, a reflected rotor inertia of {ARMATURE:g} kg·m² on each joint, as
  geared arms have and descriptions leave out. Where this helps, the friction that the description gives is too stiff
  for the bare links at this step: friction/inertia reaches thousands per second.
- A robot that is refused as it is was loaded again in the way that the refusal proposes; the figures are for that.
"""
    return head + "".join(section(title, rows) for title, rows in sections.items())


def section(title: str, rows: Iterable[Row]) -> str:
    """One heading with its table."""
    header = "| robot | nq | nv | joints | mass | efforts | RNEA | ABA | loop | geared | remarks |"
    rule = "| --- | --: | --: | --- | --: | --- | --: | --: | --: | --: | --- |"
    return "\n".join([f"\n## {title}\n", header, rule, *(line(row) for row in rows), ""])


def main() -> None:
    """Examine all robots and write the page."""
    parser = argparse.ArgumentParser(description="Which robots load, and do they run?")
    parser.add_argument("--corpus", type=Path, default=ROOT.parent / "shared" / "urdf_corpus")
    parser.add_argument("--out", type=Path, default=DOCS / "robots.md")
    parser.add_argument("--only", nargs="*", help="names of robots or files; all by default")
    options = parser.parse_args()
    sources: list[tuple[str, str | Path]] = [("two_link", "two_link")]
    sources += [(name, name) for name in sorted(ROBOTS)]
    sources += [(path.name, path) for path in sorted(options.corpus.glob("*.urdf"))]
    chosen = [s for s in sources if options.only is None or s[0] in options.only]
    console = Console(stderr=True)
    rows = [examine(*source) for source in track(chosen, "robots", console=console)]
    sections: dict[str, list[Row]] = {"Fixed base": [], "Floating base": [], "URDF files": []}
    for row, (name, source) in zip(rows, chosen, strict=True):
        floats = row.floating or (name in ROBOTS and ROBOTS[name].free_flyer)
        files = "Floating base" if floats else "Fixed base"
        sections["URDF files" if isinstance(source, Path) else files].append(row)
    sections = {title: found for title, found in sections.items() if found}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(document(sections), encoding="utf-8")
    print(f"{len(rows)} robots in {options.out}")


if __name__ == "__main__":
    main()
