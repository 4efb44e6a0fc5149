"""Contact, achieved impedance and torque without a sensor: the figures of docs/robustness.md and docs/interaction.md.

    python benchmarks/robustness_contact.py [--out docs/figures] [--only contact delay achieved estimators variable]

Writes a JSON file and the figures. All randomness (poses, sampled motions, noise) comes from --seed.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.linalg import eigh

import rbimpedance as rbi
from rbimpedance import baselines, trajectories
from rbimpedance.energy import energy_balance
from rbimpedance.estimators import MomentumObserver, SuperTwistingMomentumObserver, sense
from rbimpedance.interaction import (
    Delay,
    LowPass,
    Push,
    Sum,
    Wall,
    contact_damping,
    impedance_for_wall,
    normal_impedance,
    recommended_mass,
    smallest_mass,
)
from rbimpedance.trajectories import Reference
from rbimpedance.variable_impedance import blend, check_variation

mpl.use("Agg")
from matplotlib import pyplot as plt

Array = np.ndarray[Any, np.dtype[np.float64]]
Figures = dict[str, Any]

DT = 1e-3  # s
ARMATURE = 0.1  # kg·m²
PAYLOAD = 2.0  # kg, unknown to the controller
WALL = 1e4  # N/m
SPEED = 0.2  # m/s
TOOL_STIFFNESS = 500.0  # N/m
DEPTH = 0.04  # m: how far the reference ends up in the wall
UP = np.array([0.0, 0.0, 1.0])
PANDA_POSE = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8])
ARMS: dict[str, dict[str, Any]] = {
    "panda": {"lock": ("panda_finger_joint1", "panda_finger_joint2")},
    "ur5": {},
    "z1": {"lock": ("jointGripper",)},
    "xarm7": {},
    "kinova": {},
    "talos_arm": {"lock": ("gripper_left_joint",)},
}
CONSOLE = Console(stderr=True)


def load(name: str) -> rbi.ArmModel:
    """An arm with rotors and without friction.

    The descriptions of z1, xarm7 and talos_arm give 1 to 10 N·m·s/rad and 1 to 2 N·m on every joint, wrists included.
    Plant and controller would share it, and the figures would be about friction compensation.
    """
    return rbi.load_robot(name, armature=ARMATURE, **ARMS[name]).with_friction(0.0, 0.0)


def recipe(
    model: rbi.ArmModel, plants: list[rbi.ArmModel], center: Array, seed: int
) -> rbi.SuperTwisting:
    """Gains by the recipe of docs/robustness.md: k2 = 3·tau/m and k1 = 2.2·√(k2·ρ).

    tau is the largest torque mismatch of a joint (at least 0.5 N·m) and m its smallest inertia 1/(M⁻¹)ᵢᵢ over sampled
    motions with abs(v) ≤ 1 rad/s and abs(a) ≤ 8 rad/s², as the pushes here cause them; ρ bounds the eigenvalues of
    M_true⁻¹·M_model and their inverses.
    """
    rng = np.random.default_rng(seed)
    mismatch, inertia, rho = np.full(model.nv, 0.5), np.full(model.nv, np.inf), 1.0
    for plant in plants:
        for _ in range(200):
            q = model.integrate(center, 0.3 * rng.uniform(-1.0, 1.0, model.nv))
            v, a = rng.uniform(-1.0, 1.0, model.nv), 8.0 * rng.uniform(-1.0, 1.0, model.nv)
            lack = plant.inverse_dynamics(q, v, a) - model.inverse_dynamics(q, v, a)
            mismatch = np.maximum(mismatch, np.abs(lack))
            true, known = plant.mass_matrix(q), model.mass_matrix(q)
            inertia = np.minimum(inertia, 1.0 / np.diag(np.linalg.inv(true)))
            ratios = eigh(known, true, eigvals_only=True)
            rho = max(rho, float(ratios[-1]), 1.0 / float(ratios[0]))
    k2 = 3.0 * mismatch / inertia
    return rbi.SuperTwisting(2.2 * np.sqrt(k2 * rho), k2, "matched")


def law(
    model: rbi.ArmModel, impedance: rbi.Impedance, reaching: rbi.SuperTwisting
) -> rbi.ImpedanceController:
    """The library's default law."""
    surface = rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6)
    return rbi.ImpedanceController(model, impedance, surface, reaching, DT)


# --- contact --------------------------------------------------------------------------------------------------------


def approach(arm: rbi.ArmModel, q: Array, way: float) -> Callable[[float], Reference]:
    """Move down at SPEED over a way to the wall, which q touches, and brake to rest DEPTH below it."""
    direction = np.linalg.pinv(arm.jacobian(q)[:3]) @ -UP
    reach, brake = way / SPEED, 2.0 * DEPTH / SPEED

    def trajectory(t: float) -> Reference:
        late = float(np.clip(t - reach, 0.0, brake))
        x = SPEED * min(t, reach) + SPEED * late * (1.0 - late / (2.0 * brake)) - way
        speed = SPEED * (1.0 - late / brake)
        slowing = -SPEED / brake if 0.0 < t - reach < brake else 0.0
        return Reference(arm.integrate(q, x * direction), speed * direction, slowing * direction)

    return trajectory


def target_alone(
    arm: rbi.ArmModel,
    impedance: rbi.Impedance,
    trajectory: Callable[[float], Reference],
    wall: Wall,
    ticks: int,
) -> Array:
    """Contact force of the target impedance itself at every tick: no arm, no controller, 20 steps per period."""
    steps = 20
    target = impedance.filter(arm.nv, DT / steps)
    q_e, v_e, force = np.zeros(arm.nv), np.zeros(arm.nv), np.empty(ticks)
    for k in range(ticks * steps):
        t = k * DT / steps
        desired = trajectory(t)
        q, v = arm.unchecked.integrate(desired.q, q_e), desired.v + v_e
        if k % steps == 0:
            force[k // steps] = wall.force(arm, t, q, v)
        q_e, v_e = target.advance(q_e, v_e, wall.torque(arm, t, q, v))
    return force


def forces(result: rbi.SimulationResult, arm: rbi.ArmModel, wall: Wall) -> Array:
    """Contact force along a run."""
    samples = zip(result.t, result.q, result.v, strict=True)
    return np.array([wall.force(arm, t, q, v) for t, q, v in samples])


def contacts(force: Array) -> int:
    """How often the tool comes to the wall."""
    return int(np.count_nonzero(np.diff((force > 0.0).astype(int), prepend=0) == 1))


def wall_setting(seed: int) -> tuple[rbi.ArmModel, rbi.Impedance, Wall, rbi.SuperTwisting]:
    """Arm, recommended impedance, wall and gains."""
    arm = load("panda")
    mass = recommended_mass(WALL, TOOL_STIFFNESS, DT)
    impedance = impedance_for_wall(
        arm, PANDA_POSE, UP, mass=mass, stiffness=TOOL_STIFFNESS, wall_stiffness=WALL
    )
    wall = Wall(arm.frame_placement(PANDA_POSE)[1], UP, WALL)
    heavy = arm.with_payload(PAYLOAD).with_scaled_inertia(1.1)
    return arm, impedance, wall, recipe(arm, [arm, heavy], PANDA_POSE, seed)


def contact(seed: int, out: Path) -> Figures:
    """A 1e4 N/m wall at 0.2 m/s: force, bounces and energy, against the target impedance alone."""
    arm, impedance, wall, reaching = wall_setting(seed)
    trajectory, duration = approach(arm, PANDA_POSE, 0.2), 4.0
    start, ticks = trajectory(0.0), round(duration / DT) + 1
    alone = target_alone(arm, impedance, trajectory, wall, ticks)
    plants = {"exact model": arm, "2 kg and 10 % unknown": _heavy(arm)}
    sensors: dict[str, Any] = {
        "measured": None,
        "momentum observer, 200 rad/s": MomentumObserver(arm, 200.0, DT),
        "momentum observer, 50 rad/s": MomentumObserver(arm, 50.0, DT),
        "super-twisting observer": SuperTwistingMomentumObserver(
            arm, rbi.SuperTwisting(98.0, 2000.0), DT
        ),
    }
    jobs = [(p, s) for s in sensors for p in plants]
    rows: Figures = {}
    curves: dict[str, tuple[Array, Array]] = {
        "target alone": (np.linspace(0.0, duration, ticks), alone)
    }
    for plant_name, sensor_name in track(jobs, "contact", console=CONSOLE):
        plant = plants[plant_name]
        result = rbi.simulate(
            law(arm, impedance, reaching),
            plant,
            trajectory,
            wrench=wall,
            sensor=sensors[sensor_name],
            q0=start.q,
            v0=start.v,
            duration=duration,
            integrator="rk4",
        )
        force = forces(result, plant, wall)
        rows[f"{plant_name}, {sensor_name}"] = _contact_row(result, plant, force, alone)
        if sensor_name == "measured":
            curves[plant_name] = (result.t, force)
            if plant is arm:
                _plot_energy(result, plant, out / "contact_energy.png")
    _plot_contact(curves, out / "contact.png")
    share = float(np.sum((UP @ arm.jacobian(PANDA_POSE)[:3]) ** 2))
    target = normal_impedance(arm, PANDA_POSE, impedance, UP)
    implied = TOOL_STIFFNESS * WALL / (TOOL_STIFFNESS + WALL) * DEPTH
    return {
        "M_x, D_x, K_x": list(target),
        "M_d / M_x [m^2]": share,
        "steady force implied by K_x and k_w at one configuration [N]": implied,
        "target alone": {
            "peak [N]": alone.max(),
            "steady [N]": alone[-1],
            "contacts": contacts(alone),
        },
        **rows,
    }


def _heavy(arm: rbi.ArmModel) -> rbi.ArmModel:
    return arm.with_scaled_inertia(1.1).with_payload(PAYLOAD)


def _contact_row(
    result: rbi.SimulationResult, plant: rbi.ArmModel, force: Array, alone: Array
) -> Figures:
    energy = energy_balance(result, plant)
    touched = np.flatnonzero(force > 0.0)
    return {
        "peak [N]": force.max(),
        "peak over that of the target alone": force.max() / alone.max() - 1.0,
        "steady [N]": force[-1],
        "steady over that of the target alone": force[-1] / alone[-1] - 1.0,
        "contacts": contacts(force),
        "largest difference of force, share of the peak": np.abs(force - alone).max() / alone.max(),
        "first contact [s]": result.t[touched[0]] if len(touched) else None,
        "energy into the wall [J]": -energy.environment.min(),
        "energy residual [J]": np.abs(energy.residual).max(),
        "largest abs(e1) [rad]": np.abs(result.e1).max(),
    }


def _plot_contact(curves: dict[str, tuple[Array, Array]], path: Path) -> None:
    figure, (whole, impact) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    styles = ("k-", "C0--", "C1:")
    for (name, (t, force)), style in zip(curves.items(), styles, strict=True):
        whole.plot(t, force, style, label=name)
        impact.plot(t, force, style)
    impact.set_xlim(0.98, 1.15)
    whole.set(xlabel="t [s]", ylabel="contact force [N]", title="approach at 0.2 m/s, then hold")
    impact.set(xlabel="t [s]", title="the impact")
    whole.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _plot_energy(result: rbi.SimulationResult, plant: rbi.ArmModel, path: Path) -> None:
    energy = energy_balance(result, plant)
    figure, (parts, lost) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    parts.plot(result.t, energy.motors - energy.potential, label="motors, less the height")
    parts.plot(result.t, energy.environment, label="wall")
    parts.plot(result.t, energy.kinetic, label="motion")
    lost.plot(result.t, 1e3 * energy.residual)
    parts.set(xlabel="t [s]", ylabel="[J]", title="where the energy goes")
    lost.set(xlabel="t [s]", ylabel="[mJ]", title="what the balance lacks")
    parts.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


# --- delay ----------------------------------------------------------------------------------------------------------


def delay(seed: int, out: Path) -> Figures:
    """The lightest tool mass with which contact is stable, against the age of the readings; damping by the rule."""
    ages = (0, 1, 2, 3, 5, 7, 10)
    ratios = (1.0, 0.7, 0.3)
    cutoffs = (100.0, 50.0, 20.0, 10.0)
    measured: Figures = {}
    jobs: list[tuple[float, Any]] = [(r, Delay(n)) for r in ratios for n in ages]
    jobs += [(r, LowPass(f, DT)) for r in (1.0, 0.3) for f in cutoffs]
    for ratio, sensor in track(jobs, "delay", console=CONSOLE):
        lightest = _lightest(ratio, sensor, seed)
        if isinstance(sensor, Delay):
            theory = smallest_mass(WALL, (sensor.ticks + 0.5) * DT, TOOL_STIFFNESS, ratio)
            rule = recommended_mass(WALL, TOOL_STIFFNESS, DT, sensor.ticks * DT, ratio)
            name = f"{sensor.ticks} ms"
        else:
            theory, name = _lightest_low_pass(ratio, sensor.cutoff), f"{sensor.cutoff:g} Hz"
            rule = recommended_mass(WALL, TOOL_STIFFNESS, DT, sensor.delay, ratio)
        force = _meet(ratio, rule, sensor, seed)
        measured.setdefault(f"damping ratio {ratio:g}", {})[name] = {
            "M_x measured [kg]": lightest,
            "M_x of the target alone [kg]": theory,
            "M_x recommended [kg]": rule,
            "contacts with it": contacts(force),
            "peak with it [N]": force.max(),
            "steady with it [N]": force[-1],
        }
    _plot_delay(measured, ages, ratios, out / "contact_delay.png")
    arm = load("panda")
    share = float(np.sum((UP @ arm.jacobian(PANDA_POSE)[:3]) ** 2))
    return {"M_d / M_x [m^2]": share, **measured}


def _lightest(ratio: float, sensor: Any, seed: int) -> float:
    """Smallest stable M_x by bisection on its logarithm, to 4 %."""
    low, high = 1e-3, 10.0
    while high / low > 1.04:
        middle = float(np.sqrt(low * high))
        stable = _dies_out(_meet(ratio, middle, sensor, seed))
        low, high = (low, middle) if stable else (middle, high)
    return high


def _meet(ratio: float, mass: float, sensor: Any, seed: int) -> Array:
    """Contact force at every tick of 2.5 s, from 0.02 m before the wall on; NaN from where the run diverges."""
    arm, _, wall, reaching = wall_setting(seed)
    trajectory = approach(arm, PANDA_POSE, 0.02)
    start = trajectory(0.0)
    impedance = impedance_for_wall(
        arm,
        PANDA_POSE,
        UP,
        mass=mass,
        stiffness=TOOL_STIFFNESS,
        wall_stiffness=WALL,
        damping_ratio=ratio,
    )
    try:
        result = rbi.simulate(
            law(arm, impedance, reaching),
            arm,
            trajectory,
            wrench=wall,
            sensor=sensor,
            q0=start.q,
            v0=start.v,
            duration=2.5,
            substeps=2,
        )
    except rbi.DivergenceError as error:
        return np.append(forces(error.result, arm, wall), np.nan)
    return forces(result, arm, wall)


def _dies_out(force: Array) -> bool:
    """Whether contact lasts and its oscillation, what a parabola leaves of the force, shrinks or is below 0.1 N."""
    if not np.isfinite(force).all():
        return False
    swings = []
    for begin in (1700, 2100):
        window = force[begin : begin + 400]
        ticks = np.arange(len(window))
        fit = np.polynomial.Polynomial.fit(ticks, window, 2)
        swings.append(float(np.std(window - fit(ticks))))
    return bool(force[1700:].min() > 0.0 and swings[1] < max(0.9 * swings[0], 0.1))


def _lightest_low_pass(ratio: float, cutoff: float) -> float:
    """Smallest stable M_x behind a first-order low-pass, by Routh; 0 where every mass is stable.

    M t s³ + (M + D t)s² + (D + K t)s + K + k_w with t = 1/ω is stable where (M + D t)(D + K t) > M t (K + k_w).
    """
    lag = 1.0 / (2.0 * np.pi * cutoff)
    masses = np.geomspace(1e-4, 10.0, 5000)
    damping = np.array([contact_damping(m, TOOL_STIFFNESS, WALL, ratio) for m in masses])
    left = (masses + damping * lag) * (damping + TOOL_STIFFNESS * lag)
    unstable = left <= masses * lag * (TOOL_STIFFNESS + WALL)
    return float(masses[unstable][-1]) if unstable.any() else 0.0


def _plot_delay(
    measured: Figures, ages: tuple[int, ...], ratios: tuple[float, ...], path: Path
) -> None:
    figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
    for i, ratio in enumerate(ratios):
        rows = [measured[f"damping ratio {ratio:g}"][f"{n} ms"] for n in ages]
        axes.loglog(
            np.array(ages) + 0.5,
            [row["M_x measured [kg]"] for row in rows],
            f"C{i}o",
            label=f"on panda, ζ = {ratio:g}",
        )
        axes.loglog(
            np.array(ages) + 0.5,
            [row["M_x of the target alone [kg]"] for row in rows],
            f"C{i}-",
            label="target alone",
        )
    rule = [recommended_mass(WALL, TOOL_STIFFNESS, DT, n * DT) for n in ages]
    axes.loglog(np.array(ages) + 0.5, rule, "k--", label="recommended, ζ = 1")
    axes.set(
        xlabel="age of the force readings + half a period [ms]",
        ylabel="lightest M_x with stable contact [kg]",
    )
    axes.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


# --- achieved impedance ---------------------------------------------------------------------------------------------

WANTED = (1.0, 10.0, 20.0)  # M_d, D_d, K_d on every joint
CHIRP = (0.1, 1.5)  # Hz


def best_pose(arm: rbi.ArmModel, seed: int) -> Array:
    """The best-conditioned of 300 random configurations."""
    rng = np.random.default_rng(seed)
    poses = [arm.random_configuration(rng) for _ in range(300)]
    sizes = [np.linalg.svd(arm.jacobian(q), compute_uv=False)[-1] for q in poses]
    return poses[int(np.argmax(sizes))]


def chirp(duration: float, start: float) -> Callable[[float], Array]:
    """8 N and 2.5 N·m at the tool, each axis at a phase and a rate of its own, through 0.1 to 1.5 Hz."""
    size = np.array([8.0, 8.0, 8.0, 2.5, 2.5, 2.5])
    rates, phases = np.array([1.0, 0.93, 1.07, 0.97, 1.03, 0.9]), 2.4 * np.arange(6)
    slow, fast = CHIRP

    def wrench(t: float) -> Array:
        since = max(t - start, 0.0)
        angle = 2.0 * np.pi * (slow * since + (fast - slow) * since**2 / (2.0 * duration))
        swell = min(since, 1.0)
        return np.asarray(swell * size * np.sin(angle * rates + phases))

    return wrench


def identify(result: rbi.SimulationResult, arm: rbi.ArmModel, q_d: Array, after: float) -> Array:
    """Least squares of tau_ext = M a + D v + K (q - q_d) + c on each joint, shape (nv, 4)."""
    kept = result.t[1:-1] >= after
    a = (result.v[2:] - result.v[:-2])[kept] / (2.0 * DT)
    v, torque = result.v[1:-1][kept], result.tau_ext[1:-1][kept]
    x = np.array([arm.difference(q_d, q) for q in result.q[1:-1][kept]])
    ones = np.ones(len(v))
    columns = [np.column_stack([a[:, i], v[:, i], x[:, i], ones]) for i in range(arm.nv)]
    found = [np.linalg.lstsq(A, torque[:, i], rcond=None)[0] for i, A in enumerate(columns)]
    return np.array(found)


def laws(arm: rbi.ArmModel, reaching: rbi.SuperTwisting) -> dict[str, tuple[Any, Any]]:
    """Every law, with its sensor, around the same impedance."""
    impedance = rbi.Impedance(*WANTED)
    mine = law(arm, impedance, reaching)
    layer = np.maximum(reaching.k2 / 2.0, 1.0)
    smooth = baselines.FirstOrderSlidingMode(
        arm, impedance, 5.0, layer, DT, "boundary-layer", 5.0 * DT * layer
    )
    return {
        "super-twisting": (mine, None),
        "super-twisting, momentum observer 200 rad/s": (mine, MomentumObserver(arm, 200.0, DT)),
        "computed torque": (baselines.ComputedTorqueImpedance(arm, impedance, DT), None),
        "PD+": (baselines.PDPlus(arm, impedance, DT), None),
        "first order, boundary layer": (smooth, None),
        "Slotine-Li": (baselines.SlotineLi(arm, impedance, 5.0, 20.0, DT), None),
    }


def achieved(seed: int, out: Path) -> Figures:
    """M_d, D_d and K_d as motion and torque show them, on six arms, with the exact model and with unknown payload."""
    jobs = list(_achieved_jobs(seed))
    table: Figures = {}
    for arm_name, case, law_name, run in track(jobs, "achieved", console=CONSOLE):
        table.setdefault(arm_name, {}).setdefault(case, {})[law_name] = run()
    _plot_achieved(table, out / "achieved.png")
    return table


def _achieved_jobs(seed: int) -> Iterator[tuple[str, str, str, Callable[[], Figures]]]:
    for name in ARMS:
        arm = load(name)
        q = best_pose(arm, seed)
        loaded = arm.with_payload(PAYLOAD)
        reaching = recipe(arm, [arm, loaded], q, seed)
        for case, plant in (("exact", arm), ("2 kg unknown", loaded)):
            for law_name, (controller, sensor) in laws(arm, reaching).items():

                def run(
                    controller: Any = controller,
                    sensor: Any = sensor,
                    plant: rbi.ArmModel = plant,
                    q: Array = q,
                ) -> Figures:
                    return _achieved_row(controller, sensor, plant, q)

                yield name, case, law_name, run


def _achieved_row(controller: Any, sensor: Any, plant: rbi.ArmModel, q: Array) -> Figures:
    """Largest relative errors over the joints, and the torque that keeps the arm off its rest pose."""
    try:
        result = rbi.simulate(
            controller,
            plant,
            trajectories.hold(plant, q),
            wrench=chirp(18.0, 2.0),
            sensor=sensor,
            q0=q,
            duration=20.0,
            substeps=2,
        )
    except rbi.DivergenceError as error:
        return {"diverges at [s]": error.time, "joint": error.joint}
    found = identify(result, plant, q, 3.0)
    errors = np.abs(found[:, :3] / WANTED - 1.0).max(axis=0)
    return {
        "M_d": errors[0],
        "D_d": errors[1],
        "K_d": errors[2],
        "offset [N m]": np.abs(found[:, 3]).max(),
        "tau variation [N m/s]": result.metrics()["tau_variation"].max(),
    }


def _plot_achieved(table: Figures, path: Path) -> None:
    figure, both = plt.subplots(1, 2, figsize=(10.0, 4.6), sharey=True, layout="constrained")
    for axes, case in zip(both, ("exact", "2 kg unknown"), strict=True):
        names = next(iter(table.values()))[case]
        for i, law_name in enumerate(names):
            worst = [
                max(table[arm][case][law_name].get(x, np.nan) for x in ("M_d", "D_d", "K_d"))
                for arm in table
            ]
            places = np.arange(len(table)) + 0.1 * (i - 2.5)
            axes.semilogy(places, 100.0 * np.array(worst), "o", label=law_name)
        axes.axhline(1.0 if case == "exact" else 5.0, color="k", linestyle=":")
        axes.set_xticks(range(len(table)), list(table))
        axes.set_title(case)
    both[0].set_ylabel("largest error of M_d, D_d, K_d [%]")
    figure.legend(*both[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=150)
    plt.close(figure)


# --- estimators -----------------------------------------------------------------------------------------------------


def estimators(seed: int, out: Path) -> Figures:
    """What is taken for contact: estimates of a swing that is pushed, while the model lacks this and that."""
    arm = load("panda")
    truth = Sum(
        Push([0.0, 0.0, -15.0, 0.0, 0.0, 0.0], 1.0, 1.5),
        Push([10.0, 10.0, 0.0, 0.0, 0.0, 0.0], 3.0, 0.5, 0.02),
    )
    lacks = {
        "nothing": arm,
        "payload of 2 kg": arm.with_payload(2.0),
        "10 % of the links' mass": arm.with_scaled_inertia(1.1),
        "Coulomb friction of 1 N m": arm.with_friction(coulomb=1.0),
        "viscous friction of 1 N m s/rad": arm.with_friction(viscous=1.0),
    }
    means: dict[str, Any] = {
        "momentum, 50 rad/s": MomentumObserver(arm, 50.0, DT),
        "momentum, 200 rad/s": MomentumObserver(arm, 200.0, DT),
        "super-twisting": SuperTwistingMomentumObserver(arm, rbi.SuperTwisting(98.0, 2000.0), DT),
    }
    rng = np.random.default_rng(seed)
    swing = trajectories.cosine(arm, center=PANDA_POSE, amplitude=0.2, period=4.0)
    rows: Figures = {}
    for lack, plant in track(lacks.items(), "estimators", console=CONSOLE):
        controller = law(arm, rbi.Impedance(*WANTED), recipe(arm, [arm, plant], PANDA_POSE, seed))
        result = rbi.simulate(
            controller, plant, swing, wrench=truth, q0=swing(0.0).q, duration=5.0, integrator="rk4"
        )
        noisy = dataclasses.replace(result, v=result.v + 1e-3 * rng.standard_normal(result.v.shape))
        unknown = _unknown_torque(result, arm, plant)
        for name, estimator in means.items():
            rows.setdefault(lack, {})[name] = _estimator_row(result, noisy, unknown, estimator)
        if lack == "nothing":
            told = {name: sense(result, estimator) for name, estimator in means.items()}
            _plot_estimators(result, told, out / "estimators.png")
    return rows


def _unknown_torque(
    result: rbi.SimulationResult, model: rbi.ArmModel, plant: rbi.ArmModel
) -> Array:
    """What the motion costs by the model more than the plant pays, shape (N, nv)."""
    rows = []
    for q, v, tau, tau_ext in zip(result.q, result.v, result.tau, result.tau_ext, strict=True):
        a = plant.forward_dynamics(q, v, tau, tau_ext)
        rows.append(model.inverse_dynamics(q, v, a) - plant.inverse_dynamics(q, v, a))
    return np.array(rows)


def _estimator_row(
    result: rbi.SimulationResult, noisy: rbi.SimulationResult, unknown: Array, estimator: Any
) -> Figures:
    """Root-mean-square errors of the worst joint, after the first half second."""
    late = result.t >= 0.5

    def rms(x: Array) -> float:
        return float(np.sqrt(np.mean(x[late] ** 2, axis=0)).max())

    told = sense(result, estimator)
    error = told - result.tau_ext
    return {
        "torque of the contact, rms [N m]": rms(result.tau_ext),
        "torque that the model lacks, rms [N m]": rms(unknown),
        "error of the estimate, rms [N m]": rms(error),
        "the same less what the model lacks, rms [N m]": rms(error - unknown),
        "added by 1e-3 rad/s of velocity noise, rms [N m]": rms(sense(noisy, estimator) - told),
    }


def _plot_estimators(result: rbi.SimulationResult, told: dict[str, Array], path: Path) -> None:
    figure, both = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    for axes, joint in zip(both, (1, 0), strict=True):
        axes.plot(result.t, result.tau_ext[:, joint], "k", label="truth")
        for i, (name, torque) in enumerate(told.items()):
            axes.plot(result.t, torque[:, joint], f"C{i}--", label=name)
        axes.set(xlabel="t [s]", title=f"joint {joint + 1}")
    both[1].set_xlim(2.95, 3.15)
    both[0].set_ylabel("tau_ext [N·m]")
    both[0].legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


# --- variable impedance ---------------------------------------------------------------------------------------------


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


def variable(seed: int, out: Path) -> Figures:
    """How far the torque jumps when K_d goes from 20 to 100 while the arm is pushed: at once, and in a ramp."""
    del out
    arm = load("panda")
    reaching = recipe(arm, [arm], PANDA_POSE, seed)
    soft = rbi.Impedance(1.0, damping_ratio=1.0, stiffness=20.0)
    stiff = rbi.Impedance(1.0, damping_ratio=1.0, stiffness=100.0)
    push = rbi.FrameWrench([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    rows: Figures = {}
    for ramp in track((0.0, 0.1, 0.5, 1.0), "variable", console=CONSOLE):
        ticks = max(round(ramp / DT), 1)
        shares = [0.0] * 2000 + list(np.linspace(0.0, 1.0, ticks + 1)[1:])
        targets = [blend(soft, stiff, float(share), arm.nv) for share in shares]
        first = law(arm, targets[0], reaching)
        controllers = [first] * 2000 + [first.with_impedance(x) for x in targets[2000:]]
        result = rbi.simulate(
            Scheduled(controllers),
            arm,
            trajectories.hold(arm, PANDA_POSE),
            wrench=push,
            q0=PANDA_POSE,
            duration=5.0,
        )
        jumps = np.abs(np.diff(result.tau, axis=0)).max(axis=1)
        changed = slice(1995, 2000 + ticks + 5)
        report = check_variation(targets[1990:] + [stiff] * 10, DT, arm.nv)
        rows[f"over {ramp:g} s"] = {
            "largest change of the torque from tick to tick [N m]": jumps[changed].max(),
            "stable by check_variation": report.stable,
            "margin": report.margin.min(),
        }
    return rows


# --- all of it ------------------------------------------------------------------------------------------------------

SECTIONS = {
    "contact": contact,
    "delay": delay,
    "achieved": achieved,
    "estimators": estimators,
    "variable": variable,
}


def plain(value: Any) -> Any:
    """Turn NumPy's numbers into JSON's."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def main() -> None:
    """Measure, print, and write JSON and figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs" / "figures")
    parser.add_argument("--only", nargs="*", choices=SECTIONS, default=list(SECTIONS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "robustness_contact.json"
    measured = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for name in options.only:
        measured[name] = {"seed": options.seed, **plain(SECTIONS[name](options.seed, options.out))}
        path.write_text(json.dumps(measured, indent=2) + "\n", encoding="utf-8")
        print(json.dumps({name: measured[name]}, indent=2))


if __name__ == "__main__":
    main()
