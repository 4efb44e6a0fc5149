"""A wall of 1e4 N/m at 0.2 m/s: force, bounces and energy, beside the target impedance alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance.interaction import normal_impedance
from rbimpedance.interaction.estimators import MomentumObserver, SuperTwistingMomentumObserver
from rbimpedance.simulation.energy import energy_balance

from . import pushed
from .common import Figures, Job, Options, Part
from .pushed import DEPTH, FIRST, PAYLOAD, SETTINGS, TOOL_STIFFNESS, UP, WALL

LENGTH, WAY = 4.0, 0.2  # s, m
PLANTS = {"exact": "exact model", "heavy": f"{PAYLOAD:g} kg and 10 % unknown"}
SENSORS = (
    *("measured", "momentum observer, 200 rad/s", "momentum observer, 50 rad/s"),
    "super-twisting observer",
)


def _sensor(name: str, arm: rbi.ArmModel) -> Any:
    """What tells the controller the torque of the wall."""
    sensors: dict[str, Any] = {
        "measured": None,
        "momentum observer, 200 rad/s": MomentumObserver(arm, 200.0, DT),
        "momentum observer, 50 rad/s": MomentumObserver(arm, 50.0, DT),
        "super-twisting observer": SuperTwistingMomentumObserver(
            arm, rbi.SuperTwisting(98.0, 2000.0), DT
        ),
    }
    return sensors[name]


def meet(place: str, plant_name: str, sensor_name: str, seed: int) -> Figures:
    """One contact."""
    setting = SETTINGS[place]
    arm, impedance, wall, reaching = pushed.at_wall(setting, seed)
    trajectory = pushed.approach(arm, setting.q, WAY)
    alone = pushed.target_alone(arm, impedance, trajectory, wall, round(LENGTH / DT) + 1)
    plant = arm if plant_name == "exact" else pushed.heavy(arm)
    law = pushed.law(arm, impedance, reaching)
    how: Any = {"sensor": _sensor(sensor_name, arm), "duration": LENGTH, "integrator": "rk4"}
    result = pushed.met(law, plant, trajectory, wall, **how)
    force = pushed.forces(result, plant, wall)
    share = float(np.sum((UP @ arm.jacobian(setting.q)[:3]) ** 2))
    return {
        "place": place,
        "plant": plant_name,
        "sensor": sensor_name,
        "M_x, D_x, K_x": list(normal_impedance(arm, setting.q, impedance, UP)),
        "M_d / M_x [m^2]": share,
        "alone": {
            "peak [N]": alone.max(),
            "steady [N]": alone[-1],
            "contacts": pushed.contacts(alone),
        },
        "_curves": {"t": result.t, "force": force, "alone": alone},
        "_energy": _energies(result, plant),
    } | _contact_row(result, plant, force, alone)


def _energies(result: rbi.SimulationResult, plant: rbi.ArmModel) -> dict[str, Array]:
    energy = energy_balance(result, plant)
    return {
        "motors, less the height": energy.motors - energy.potential,
        "wall": energy.environment,
        "motion": energy.kinetic,
        "acceleration_deficit": energy.residual,
    }


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
        "contacts": pushed.contacts(force),
        "largest difference of force, share of the peak": np.abs(force - alone).max() / alone.max(),
        "first contact [s]": result.t[touched[0]] if len(touched) else None,
        "energy into the wall [J]": -energy.environment.min(),
        "energy residual [J]": np.abs(energy.residual).max(),
        "largest abs(e1) [rad]": np.abs(result.e1).max(),
    }


def jobs(options: Options) -> list[Job]:
    """Every place with the measured torque; estimators at the first."""
    cases = [(place, plant, SENSORS[0]) for place in SETTINGS for plant in PLANTS]
    cases += [(FIRST, plant, sensor) for sensor in SENSORS[1:] for plant in PLANTS]
    return [Job(meet, (*case, options.seed)) for case in cases]


def collect(options: Options, answers: list[Any]) -> Figures:
    """One row for each contact."""
    del options
    implied = TOOL_STIFFNESS * WALL / (TOOL_STIFFNESS + WALL) * DEPTH
    return {"rows": answers, "implied steady force [N]": implied}


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Contact at every place, and with an estimator."""
    measured = [row for row in data["rows"] if row["sensor"] == SENSORS[0]]
    rows = [(row["place"], PLANTS[row["plant"]], *_cells(row)) for row in measured]
    header = (
        *("arm, pose", "plant", "contacts (alone)", "peak force [N] (alone)"),
        *("steady force [N] (alone)", "largest difference, share of the peak"),
        *("energy into the wall [mJ]", "residual of the balance [mJ]"),
    )
    first = [row for row in data["rows"] if row["place"] == FIRST]
    sensed = [
        (row["sensor"], PLANTS[row["plant"]], *_sensed_cells(row))
        for sensor in SENSORS
        for row in first
        if row["sensor"] == sensor
    ]
    names = ("torque of the wall", "plant", "peak force [N]", "steady force [N]", "contacts")
    one = first[0]
    mass, damping, stiffness = one["M_x, D_x, K_x"]
    words = (
        f"For this wall at 1 kHz the rule gives M_x = {mass:.3g} kg, D_x = {damping:.3g} N·s/m, with K_x = "
        f"{stiffness:.3g} N/m; in panda's joints in the middle pose M_d = {one['M_d / M_x [m^2]'] * mass:.3g} kg·m² "
        f"(M_d/M_x = nᵀJJᵀn). K_x k_w/(K_x + k_w)·{DEPTH:g} m is {data['implied steady force [N]']:.4g} N."
    )
    return {
        "contact": f"{words}\n\n{markdown(header, rows)}",
        "contact-estimators": markdown(names, sensed),
    }


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    alone = row["alone"]
    peak = row["peak over that of the target alone"]
    steady = row["steady over that of the target alone"]
    return (
        f"{row['contacts']} ({alone['contacts']})",
        f"{row['peak [N]']:.2f} ({alone['peak [N]']:.2f}, {peak:+.1%})",
        f"{row['steady [N]']:.3f} ({alone['steady [N]']:.3f}, {steady:+.1e})",
        f"{row['largest difference of force, share of the peak']:.1%}",
        f"{1e3 * row['energy into the wall [J]']:.1f}",
        f"{1e3 * row['energy residual [J]']:.2f} "
        f"({row['energy residual [J]'] / row['energy into the wall [J]']:.1%})",
    )


def _sensed_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    peak = f"{row['peak [N]']:.1f} ({row['peak over that of the target alone']:+.0%})"
    return peak, f"{row['steady [N]']:.2f}", str(row["contacts"])


def draw(data: Mapping[str, Any], out: Path) -> None:
    """Force and energy of the first place."""
    rows = [row for row in data["rows"] if row["place"] == FIRST and row["sensor"] == SENSORS[0]]
    figure, (whole, impact) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    curves = [("target alone", rows[0]["_curves"]["t"], rows[0]["_curves"]["alone"], "k-")]
    for row, style in zip(rows, ("C0--", "C1:"), strict=True):
        curves.append((PLANTS[row["plant"]], row["_curves"]["t"], row["_curves"]["force"], style))
    for name, t, force, style in curves:
        whole.plot(t, force, style, label=name)
        impact.plot(t, force, style)
    impact.set_xlim(0.98, 1.15)
    whole.set(xlabel="t [s]", ylabel="contact force [N]", title="approach at 0.2 m/s, then hold")
    impact.set(xlabel="t [s]", title="the impact")
    whole.legend()
    figure.savefig(out / "contact.png", dpi=150)
    plt.close(figure)
    _draw_energy(rows[0], out / "contact_energy.png")


def _draw_energy(row: Mapping[str, Any], path: Path) -> None:
    figure, (parts, lost) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    t, energy = row["_curves"]["t"], row["_energy"]
    for name in ("motors, less the height", "wall", "motion"):
        parts.plot(t, energy[name], label=name)
    lost.plot(t, 1e3 * energy["acceleration_deficit"])
    parts.set(xlabel="t [s]", ylabel="[J]", title="where the energy goes")
    lost.set(xlabel="t [s]", ylabel="[mJ]", title="residual of the balance")
    parts.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


PARTS = {"contact": Part(jobs, collect, tables, draw)}
