"""M_d, D_d and K_d as motion and torque show them, on six arms, with the exact model and with an unknown payload."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance import trajectories
from rbimpedance.control import baselines
from rbimpedance.interaction.estimators import MomentumObserver

from .common import Figures, Job, Options, Part, as_rows, simulate
from .pushed import PAYLOAD, law, load, recipe

CASES = {
    "exact": "exact model",
    "heavy": f"{PAYLOAD:g} kg at the tool that the controller does not know",
}
LAWS = {
    "super-twisting": "**super-twisting**",
    "with a momentum observer": "the same with a momentum observer for a sensor (200 rad/s)",
    "computed torque": "computed torque (Hogan)",
    "PD+": "PD+",
    "first order, boundary layer": "first-order sliding mode, boundary layer",
    "Slotine-Li": "Slotine–Li",
}
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
        "with a momentum observer": (mine, MomentumObserver(arm, 200.0, DT)),
        "computed torque": (baselines.ComputedTorqueImpedance(arm, impedance, DT), None),
        "PD+": (baselines.PDPlus(arm, impedance, DT), None),
        "first order, boundary layer": (smooth, None),
        "Slotine-Li": (baselines.SlotineLi(arm, impedance, 5.0, 20.0, DT), None),
    }


def achieved(name: str, case: str, law_name: str, seed: int) -> Figures:
    """Largest relative errors over the joints, and the torque that keeps the arm off its rest pose."""
    arm = load(name)
    q, loaded = best_pose(arm, seed), arm.with_payload(PAYLOAD)
    plant = arm if case == "exact" else loaded
    controller, sensor = laws(arm, recipe(arm, [arm, loaded], q, seed))[law_name]
    row: Figures = {"arm": name, "case": case, "law": law_name}
    try:
        result = simulate(
            controller,
            plant,
            trajectories.hold(plant, q),
            environment=chirp(18.0, 2.0),
            sensor=sensor,
            q0=q,
            duration=20.0,
            substeps=2,
        )
    except rbi.DivergenceError as error:
        return row | {"diverges at [s]": error.time, "joint": error.joint}
    found = identify(result, plant, q, 3.0)
    errors = np.abs(found[:, :3] / WANTED - 1.0).max(axis=0)
    return row | {
        "M_d": errors[0],
        "D_d": errors[1],
        "K_d": errors[2],
        "offset [N m]": np.abs(found[:, 3]).max(),
        "tau variation [N m/s]": result.metrics()["tau_variation"].max(),
    }


def worst(row: Mapping[str, Any]) -> float:
    """The largest error of the three."""
    return max(float(row.get(x, np.nan)) for x in ("M_d", "D_d", "K_d"))


def jobs(options: Options) -> list[Job]:
    """Every law on every arm in both cases."""
    return [
        Job(achieved, (name, case, law_name, options.seed))
        for name in options.arms
        for case in CASES
        for law_name in LAWS
    ]


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """One table for each case; one row for each law, one column for each arm."""
    rows = {(row["arm"], row["case"], row["law"]): row for row in data["rows"]}
    arms = list(dict.fromkeys(row["arm"] for row in data["rows"]))
    parts = [
        markdown(
            (CASES[case], *arms),
            [
                (words, *(_percent(rows[arm, case, name]) for arm in arms))
                for name, words in LAWS.items()
            ],
        )
        for case in CASES
    ]
    offsets = [
        [
            row["offset [N m]"]
            for row in data["rows"]
            if row["case"] == "heavy" and row["law"] in names
        ]
        for names in (
            ("super-twisting",),
            ("computed torque", "PD+", "first order, boundary layer", "Slotine-Li"),
        )
    ]
    words = (
        f"With the payload unknown, the offset that the fit needs, the torque that holds the arm off its rest pose, is "
        f"at most {max(offsets[0]):.1g} N·m; for the baselines it is {min(offsets[1]):.2g} to "
        f"{max(offsets[1]):.2g} N·m: "
        f"they sag."
    )
    return {"achieved": "\n\n".join([*parts, words])}


def _percent(row: Mapping[str, Any]) -> str:
    if "joint" in row:
        return "diverges"
    error = 100.0 * worst(row)
    return f"{error:.2f} %" if error < 1.0 else f"{error:.3g} %"


def draw(data: Mapping[str, Any], out: Path) -> None:
    """Both cases side by side."""
    rows = {(row["arm"], row["case"], row["law"]): row for row in data["rows"]}
    arms = list(dict.fromkeys(row["arm"] for row in data["rows"]))
    figure, both = plt.subplots(1, 2, figsize=(10.0, 4.6), sharey=True, layout="constrained")
    for axes, case in zip(both, CASES, strict=True):
        for i, name in enumerate(LAWS):
            errors = np.array([worst(rows[arm, case, name]) for arm in arms])
            places = np.arange(len(arms)) + 0.1 * (i - 2.5)
            axes.semilogy(places, 100.0 * errors, "o", label=name)
        axes.axhline(1.0 if case == "exact" else 5.0, color="k", linestyle=":")
        axes.set_xticks(range(len(arms)), arms)
        axes.set_title(CASES[case])
    both[0].set_ylabel("largest error of M_d, D_d, K_d [%]")
    figure.legend(*both[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(out / "achieved.png", dpi=150)
    plt.close(figure)


PARTS = {"achieved": Part(jobs, as_rows, tables, draw)}
