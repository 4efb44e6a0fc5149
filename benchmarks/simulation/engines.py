"""Every number of docs/engines.md: both physics engines beside each other, one command.

    python -m benchmarks.simulation.engines [--quick] [--arms panda ur5 ...]

Writes docs/figures/engines.json and the tables of docs/engines.md. `--quick` measures two arms and short runs, and
prints the tables instead.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import track

import rbimpedance as rbi
from benchmarks import arms, pages
from benchmarks.arms import Array
from benchmarks.pages import markdown, plain, power
from benchmarks.tuning.robustness import pushed
from benchmarks.tuning.robustness.trials import propose
from rbimpedance.interaction import as_interaction, recommended_mass
from rbimpedance.robot import pinocchio_dynamics
from rbimpedance.robot.pinocchio_dynamics import COULOMB_SMOOTHING
from rbimpedance.simulation.plants import RigidPlant
from rbimpedance.simulation.plants.agreement import free_motion_apart
from rbimpedance.simulation.plants.mujoco_plant import MujocoState

FIGURES, PAGE = pages.FIGURES / "engines.json", pages.DOCS / "engines.md"
H = 2.5e-4  # s: a physics step
STARTS = 8  # random ones of free motion
SHIFT = 1e-9  # rad or m
DRY, ROTORS = 0.5, 0.1  # N·m, kg·m²
TOLD = (0.5, 1.0, 2.0, 4.0)  # N·m
ADDED = "payload, rotors, friction"
Rows = Sequence[Mapping[str, Any]]
TOUCHED = ("panda, middle", "ur5")
WALL_RULE = (pushed.WALL, pushed.TOOL_STIFFNESS, arms.DT)
RADIUS = 0.02  # m, of the tool's sphere
METRICS = (
    *("e1_max", "e1_rms", "e2_max", "e2_rms", "e_im_max", "e_im_rms"),
    *("settling_1e-2", "settling_1e-3", "settling_1e-4", "tau_peak", "tau_variation"),
)


class Options(NamedTuple):
    """What was asked for."""

    arms: tuple[str, ...]
    duration: float


# --- agreement --------------------------------------------------------------------------------------------------


def variants(name: str) -> dict[str, rbi.ArmModel]:
    """An arm as loaded, and with what a URDF does not give."""
    arm = arms.load(name)
    carrying = arm.with_payload(arms.ARMS[name], (0.02, -0.01, 0.06), 1e-3 * np.eye(3))
    return {"as loaded": arm, ADDED: carrying.with_armature(ROTORS).with_friction(viscous=1.0)}


def agreement(name: str, variant: str) -> dict[str, Any]:
    """How far the engines agree on an arm."""
    arm = variants(name)[variant]
    found = rbi.simulation.plants.engine_agreement(arm)
    plant = rbi.MujocoPlant(arm.with_friction(coulomb=0.0), limits=False)
    rng = np.random.default_rng(0)
    starts = [(arm.random_configuration(rng), rng.standard_normal(arm.nv)) for _ in range(STARTS)]
    steps = round(1.0 / H)
    apart = [free_motion_apart(plant, q, v, steps, H) for q, v in starts]
    worst = int(np.argmax(apart))
    return {
        "arm": name,
        "variant": variant,
        **found._asdict(),
        "replaced": len(plant.replaced),
        "thrown": apart[worst],
        "growth": growth(plant.arm, *starts[worst], steps),
    }


def growth(arm: rbi.ArmModel, q: Array, v: Array, steps: int) -> float:
    """By how much ABA's free motion enlarges a shift of its start."""
    rigid, nothing, rest = (
        RigidPlant(arm, friction_at_end=True),
        as_interaction(None),
        np.zeros(arm.nv),
    )
    ends = []
    for start in (q, arm.integrate(q, np.full(arm.nv, SHIFT))):
        state = rigid.begin(start, v, H)
        for k in range(steps):
            state = rigid.step(state, rest, nothing, k * H, H)
        ends.append(state.q)
    return float(np.abs(arm.raw_dynamics.difference(*ends)).max()) / SHIFT


# --- control ----------------------------------------------------------------------------------------------------


class SmoothFriction(rbi.MujocoPlant):
    """MuJoCo with ABA's law of dry friction, tau_c·tanh(v / v_c), as damping of that slope."""

    def acceleration(self, state: MujocoState, tau: Array, tau_ext: Array) -> Array:
        """The same with that friction."""
        self._set_slope(state.velocity)
        return super().acceleration(state, tau, tau_ext)

    def step(
        self, state: MujocoState, tau: Array, environment: rbi.Interaction, t: float, h: float
    ) -> MujocoState:
        """The same with that friction."""
        self._set_slope(state.velocity)
        return super().step(state, tau, environment, t, h)

    def _set_slope(self, v: Array) -> None:
        x = v / COULOMB_SMOOTHING
        secant = np.divide(np.tanh(x), x, out=np.ones_like(x), where=np.abs(x) > 1e-8)
        model, dofs = self._built.model, self._built.dofs
        model.dof_frictionloss[dofs] = 0.0
        model.dof_damping[dofs] = self.arm.viscous + self.arm.coulomb / COULOMB_SMOOTHING * secant


class Case(NamedTuple):
    """Dry friction whose size the controller does not know, and the two laws of it.

    Attributes:
        coulomb: Its size [N·m]; with rotors where there is some.
        smoothing: ABA's v_c [rad/s].
        engine: The second engine.
    """

    coulomb: float
    smoothing: float
    engine: Callable[..., rbi.MujocoPlant]


CASES = {
    "viscous": Case(0.0, COULOMB_SMOOTHING, rbi.MujocoPlant),
    "dry": Case(DRY, COULOMB_SMOOTHING, rbi.MujocoPlant),
    "dry, smooth on both": Case(DRY, COULOMB_SMOOTHING, SmoothFriction),
    "dry, sharp on both": Case(DRY, 1e-3, rbi.MujocoPlant),
}


@contextmanager
def smoothing(speed: float) -> Iterator[None]:
    """Let ABA's dry friction turn within another speed [rad/s]."""
    pinocchio_dynamics.COULOMB_SMOOTHING = speed
    try:
        yield
    finally:
        pinocchio_dynamics.COULOMB_SMOOTHING = COULOMB_SMOOTHING


def arm_of(name: str, coulomb: float) -> rbi.ArmModel:
    """An arm as modelled: without dry friction, and with rotors where the plant has some."""
    arm = arms.load(name).with_friction(coulomb=0.0)
    return arm.with_armature(ROTORS) if coulomb else arm


def proposal_for(name: str, coulomb: float) -> Any:
    """Gains for an arm whose payload is not known, nor its dry friction."""
    arm = arm_of(name, coulomb)
    unknown = rbi.Uncertainty(payload=arms.ARMS[name], coulomb=coulomb)
    return propose(arm, unknown, arms.motion(arm))


def plant_of(name: str, coulomb: float) -> rbi.ArmModel:
    """The arm with the largest payload and the friction."""
    return arm_of(name, coulomb).with_payload(arms.ARMS[name]).with_friction(coulomb=coulomb)


def run(proposal: Any, plant: Any, duration: float) -> rbi.SimulationResult:
    """The controller of a proposal, pushed."""
    push = rbi.interaction.Push([0.0, 10.0, 5.0, 0.0, 0.0, 0.0], 0.3 * duration, 0.2 * duration)
    trajectory = proposal.trajectory
    return rbi.simulate(
        proposal.controller(), plant, trajectory, environment=push, duration=duration
    )


def control(name: str, case: str, duration: float) -> dict[str, Any]:
    """The same controller on both engines: relative differences of every metric."""
    coulomb, speed, engine = CASES[case]
    proposal, plant = proposal_for(name, coulomb), plant_of(name, coulomb)
    with smoothing(speed):
        results = [run(proposal, one, duration) for one in (plant, engine(plant, limits=False))]
        at_end = run(proposal, RigidPlant(plant, friction_at_end=True), duration).metrics()
    ours, theirs = (result.metrics() for result in results)
    late = [result.metrics(after=0.6 * duration)["e1_max"] for result in results]
    return {
        "arm": name,
        "case": case,
        **{key: apart(ours[key], theirs[key]) for key in METRICS},
        "at_end": max(apart(at_end[key], theirs[key]) for key in METRICS),
        "late": [float(one.max()) for one in late],
    }


def told(coulomb: float, duration: float) -> dict[str, Any]:
    """Gains for a range of dry friction, on the panda that has `DRY` of it, on MuJoCo."""
    plant = rbi.MujocoPlant(plant_of("panda", DRY), limits=False)
    result = run(proposal_for("panda", coulomb), plant, duration)
    figures = result.metrics(after=0.6 * duration)
    variation = float(figures["tau_variation"].sum())
    return {"coulomb": coulomb, "late": float(figures["e1_max"].max()), "variation": variation}


def apart(ours: Array, theirs: Array) -> float:
    """The largest relative difference of any joint; settled never by either is the same."""
    same = ours == theirs
    with np.errstate(invalid="ignore"):
        share = np.abs(theirs - ours) / np.abs(ours)
    return float(np.where(same, 0.0, share).max())


# --- contact ----------------------------------------------------------------------------------------------------

SURFACES = {
    "wall": "`Wall`, 1e4 N/m",
    "soft": "MuJoCo's plane, as soft",
    "rigid": "MuJoCo's plane",
    "rough": "MuJoCo's plane, rough",
}
TOUCHES = (
    *(("wall", "light"), ("soft", "light"), ("rigid", "light")),
    *(("wall", "heavy"), ("rigid", "heavy"), ("rough", "heavy")),
)
"""Surface and target mass: the one recommended for the wall, or the arm's own at the tool."""
GEOMS = {
    "soft": 'condim="1" solimp="0.05 0.05 0.001" solref="-{stiffness} -1"',
    "rigid": 'condim="1"',
    "rough": 'condim="3"',
}
UNIT = 1000.0  # of MuJoCo's stiffness, whose force depends on the arm


def contact(place: str, surface: str, mass: str) -> dict[str, Any]:
    """A tool that comes down on a surface at 0.2 m/s and presses on it."""
    stiffness = UNIT
    if surface == "soft":
        first = touch(place, surface, mass, stiffness)
        stiffness *= pushed.WALL * first["depth"] / first["rest"]
    return {"place": place, "surface": surface} | touch(place, surface, mass, stiffness)


def touch(place: str, surface: str, mass: str, stiffness: float) -> dict[str, Any]:
    """One run of that."""
    setting = pushed.SETTINGS[place]
    arm, q = pushed.load(setting.arm), setting.q
    row = pushed.UP @ arm.jacobian(q)[:3]
    own = 1.0 / float(row @ np.linalg.solve(arm.mass_matrix(q), row))
    arm, impedance, wall, reaching = pushed.at_wall(setting, 4, own if mass == "heavy" else None)
    trajectory = pushed.approach(arm, q, 0.2)
    plant: Any = arm
    if surface != "wall":
        place_of = f'type="plane" size="5 5 1" pos="0 0 {wall.point[2] - RADIUS}"'
        geom = f"<geom {place_of} {GEOMS[surface].format(stiffness=stiffness)}/>"
        scene = f"<mujoco><worldbody>{geom}</worldbody></mujoco>"
        plant = rbi.MujocoPlant(arm, limits=False, scene=scene, tool_radius=RADIUS)
    result = rbi.simulate(
        pushed.law(arm, impedance, reaching),
        plant,
        trajectory,
        environment=wall if surface == "wall" else None,
        q0=trajectory(0.0).q,
        v0=trajectory(0.0).v,
        duration=4.0,
        substeps=8,
    )
    force = normal_forces(arm, result, 0.0 if surface == "wall" else RADIUS)
    touching = force > 0.0
    first = int(np.argmax(touching))
    return {
        "own": own,
        "mass": own if mass == "heavy" else recommended_mass(*WALL_RULE),
        "peak": float(force.max()),
        "rest": float(force[-100:].mean()),
        "depth": float(wall.point[2] - arm.frame_placement(result.q[-1])[1][2]),
        "lifts": int(np.count_nonzero(touching[first:-1] & ~touching[first + 1 :])),
        "ripple": float(np.ptp(force[-500:])),
    }


def normal_forces(arm: rbi.ArmModel, result: rbi.SimulationResult, radius: float) -> Array:
    """The push along z, at the tool's lowest point, that explains the logged torque best, at every tick [N]."""
    forces = np.zeros(len(result.t))
    for k in np.flatnonzero(result.tau_ext.any(axis=1)):
        J = arm.jacobian(result.q[k])
        at_point = J[:3] + np.cross(J[3:].T, [0.0, 0.0, -radius]).T
        forces[k] = np.linalg.lstsq(at_point.T, result.tau_ext[k], rcond=None)[0][2]
    return forces


# --- tables -----------------------------------------------------------------------------------------------------


def percent(share: float) -> str:
    """A share in percent, with the digits that count."""
    return "∞" if not np.isfinite(share) else f"{100.0 * share:.2g}"


def tables(figures: Mapping[str, Any]) -> dict[str, str]:
    """The tables of the page, by their marks."""
    told = [
        (f"{r['coulomb']:g}", power(r["late"]), f"{r['variation']:.1f}") for r in figures["told"]
    ]
    return {
        "agreement": _agreement_table(figures["agreement"]),
        **{
            case: _control_table([r for r in figures["control"] if r["case"] == case])
            for case in CASES
        },
        "range": markdown(
            ("range given [N·m]", "late e1_max [rad]", "torque variation [N·m/s]"), told
        ),
        "contact": _contact_table(figures["contact"]),
    }


def _agreement_table(rows: Rows) -> str:
    header = ("arm", "", "M", "bias", "Jacobian", "1 s from rest", "1 s thrown", "growth")
    keys = ("mass_matrix", "bias", "jacobian", "motion", "thrown", "growth")
    return markdown(
        (*header, "replaced"),
        [(r["arm"], r["variant"], *(power(r[key]) for key in keys), r["replaced"]) for r in rows],
    )


def _control_table(rows: Rows) -> str:
    cells = [
        (
            *(r["arm"], *(percent(r[key]) for key in (*METRICS, "at_end"))),
            ", ".join(map(power, r["late"])),
        )
        for r in rows
    ]
    header = ("arm", *METRICS, "all, friction at the end", "late e1_max [rad]: ABA, MuJoCo")
    return markdown(header, cells)


def _contact_table(rows: Rows) -> str:
    header = ("pose", "surface", "target mass, arm's own [kg]", "peak [N]", "at rest [N]")
    cells = [
        (
            *(r["place"], SURFACES[r["surface"]], f"{r['mass']:.1f}, {r['own']:.1f}"),
            *(f"{r['peak']:.1f}", f"{r['rest']:.1f}", f"{1e3 * r['depth']:.2f}"),
            *(r["lifts"], f"{r['ripple']:.1g}"),
        )
        for r in rows
    ]
    return markdown((*header, "depth [mm]", "lifts off", "ripple at the end [N]"), cells)


# --- the whole --------------------------------------------------------------------------------------------------


def jobs(options: Options) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """All that is measured, as calls, each with the list of figures that it belongs to."""
    for name in options.arms:
        for variant in ("as loaded", ADDED):
            yield "agreement", partial(agreement, name, variant)
    for case in CASES:
        for name in options.arms:
            yield "control", partial(control, name, case, options.duration)
    for coulomb in TOLD:
        yield "told", partial(told, coulomb, options.duration)
    for place in TOUCHED:
        for surface, mass in TOUCHES:
            yield "contact", partial(contact, place, surface, mass)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write, tabulate."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--arms", nargs="*", choices=arms.ARMS, default=list(arms.ARMS))
    parser.add_argument("--quick", action="store_true", help="two arms, short runs; printed only")
    asked = parser.parse_args(arguments)
    options = Options(("panda", "kinova"), 1.0) if asked.quick else Options(tuple(asked.arms), 5.0)
    figures: dict[str, Any] = {"agreement": [], "control": [], "told": [], "contact": []}
    todo, console = list(jobs(options)), Console(stderr=True)
    for kind, job in track(todo, "engines", console=console):
        figures[kind].append(job())
    made = tables(plain(figures))
    if asked.quick:
        print("\n\n".join(made.values()))
        return
    FIGURES.write_text(json.dumps(plain(figures), indent=1) + "\n", "utf-8")
    pages.rewrite(PAGE, made)


if __name__ == "__main__":
    main()
