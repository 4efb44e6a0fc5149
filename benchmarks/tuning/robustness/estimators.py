"""What momentum observers report as contact: estimates during a motion with pushes, with model errors."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance import trajectories
from rbimpedance.interaction import Push, Sum
from rbimpedance.interaction.estimators import MomentumObserver, SuperTwistingMomentumObserver
from rbimpedance.simulation.replay import replay_sensor

from .achieved import WANTED
from .common import Figures, Job, Options, Part, as_rows, simulate
from .pushed import FIRST, SETTINGS, law, load, recipe

LACKS = (
    *("nothing", "a payload of 2 kg", "10 % of the links' mass", "Coulomb friction of 1 N·m"),
    "viscous friction of 1 N·m·s/rad",
)


def _plant(lack: str, arm: rbi.ArmModel) -> rbi.ArmModel:
    """What the model lacks."""
    plants = (
        *(arm, arm.with_payload(2.0), arm.with_scaled_inertia(1.1)),
        *(arm.with_friction(coulomb=1.0), arm.with_friction(viscous=1.0)),
    )
    return plants[LACKS.index(lack)]


def estimate(lack: str, seed: int) -> Figures:
    """One swing, seen by every estimator."""
    arm, pose = load("panda"), SETTINGS[FIRST].q
    plant = _plant(lack, arm)
    truth = Sum(
        Push([0.0, 0.0, -15.0, 0.0, 0.0, 0.0], 1.0, 1.5),
        Push([10.0, 10.0, 0.0, 0.0, 0.0, 0.0], 3.0, 0.5, 0.02),
    )
    means: dict[str, Any] = {
        "momentum, 50 rad/s": MomentumObserver(arm, 50.0, DT),
        "momentum, 200 rad/s": MomentumObserver(arm, 200.0, DT),
        "super-twisting": SuperTwistingMomentumObserver(arm, rbi.SuperTwisting(98.0, 2000.0), DT),
    }
    swing = trajectories.cosine(arm, center=pose, amplitude=0.2, period=4.0)
    controller = law(arm, rbi.Impedance(*WANTED), recipe(arm, [arm, plant], pose, seed))
    result = simulate(
        controller, plant, swing, environment=truth, q0=swing(0.0).q, duration=5.0, integrator="rk4"
    )
    rng = np.random.default_rng((seed, LACKS.index(lack)))
    noisy = dataclasses.replace(result, v=result.v + 1e-3 * rng.standard_normal(result.v.shape))
    unknown = _unknown_torque(result, arm, plant)
    seen = {name: _estimator_row(result, noisy, unknown, one) for name, one in means.items()}
    curves = {name: replay_sensor(result, one) for name, one in means.items()}
    return {"lack": lack, "seen": seen, "_t": result.t, "_truth": result.tau_ext, "_told": curves}


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

    told = replay_sensor(result, estimator)
    error = told - result.tau_ext
    return {
        "torque of the contact, rms [N m]": rms(result.tau_ext),
        "torque that the model lacks, rms [N m]": rms(unknown),
        "error of the estimate, rms [N m]": rms(error),
        "the same less what the model lacks, rms [N m]": rms(error - unknown),
        "added by 1e-3 rad/s of velocity noise, rms [N m]": rms(
            replay_sensor(noisy, estimator) - told
        ),
    }


def jobs(options: Options) -> list[Job]:
    """Everything that the model may lack."""
    return [Job(estimate, (lack, options.seed)) for lack in LACKS]


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Errors of all estimators."""
    error, clean = (
        "error of the estimate, rms [N m]",
        "the same less what the model lacks, rms [N m]",
    )
    lines = []
    for row in data["rows"]:
        seen = list(row["seen"].values())
        lacks = seen[0]["torque that the model lacks, rms [N m]"]
        lines.append(
            (
                row["lack"],
                f"{lacks:.2f}",
                *(", ".join(f"{one[key]:.2f}" for one in seen) for key in (error, clean)),
            )
        )
    header = (
        *("model error", "torque error of the model"),
        "error of the estimate (momentum 50 rad/s, 200 rad/s, super-twisting)",
        "the same, minus the torque error of the model",
    )
    added = data["rows"][0]["seen"].values()
    noise = ", ".join(
        f"{one['added by 1e-3 rad/s of velocity noise, rms [N m]']:.2f}" for one in added
    )
    words = f"1e-3 rad/s of noise on the velocity adds {noise} N·m."
    return {"estimators": f"{markdown(header, lines)}\n\n{words}"}


def draw(data: Mapping[str, Any], out: Path) -> None:
    """Two joints, with the exact model."""
    row = data["rows"][0]
    figure, both = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    for axes, joint in zip(both, (1, 0), strict=True):
        axes.plot(row["_t"], row["_truth"][:, joint], "k", label="truth")
        for i, (name, torque) in enumerate(row["_told"].items()):
            axes.plot(row["_t"], torque[:, joint], f"C{i}--", label=name)
        axes.set(xlabel="t [s]", title=f"joint {joint + 1}")
    both[1].set_xlim(2.95, 3.15)
    both[0].set_ylabel("tau_ext [N·m]")
    both[0].legend()
    figure.savefig(out / "estimators.png", dpi=150)
    plt.close(figure)


PARTS = {"estimators": Part(jobs, as_rows, tables, draw)}
