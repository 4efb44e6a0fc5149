"""Do proposed gains hold on arms that the controller does not know? Six arms, sampled plants, one seed.

    python benchmarks/robustness_gains.py [--parts A B C beyond] [--plants 200] [--out docs/figures]

A: payload, heavier links and friction unknown, rotors known. B: no rotors, any payload up to the largest. C: noise
and delay. beyond: more payload, a longer lever, slower periods; every yes is put to the test. Writes
robustness_gains.json and, from part B, robustness_gains.png; prints the tables of docs/robustness.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from rich.console import Console
from rich.progress import track

import rbimpedance as rbi
from rbimpedance.trajectories import Trajectory, cosine
from rbimpedance.tuning import GainProposal, PlantSample, Uncertainty, propose_gains
from rbimpedance.tuning.worst_case import needed_variation, true_error

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[1]
ARMS = {"panda": 2.0, "ur5": 2.0, "z1": 1.0, "xarm7": 2.0, "kinova": 1.0, "talos_arm": 2.0}
"""Largest payload of each arm [kg]."""
LOCKED = {"panda": ("panda_finger_joint1", "panda_finger_joint2"), "z1": ("jointGripper",)}
DT, DURATION, LATE = 1e-3, 5.0, 3.0
REFERENCES = 8  # plants of part B that a controller which knows them runs on, too
NOISY_ACCURACY = 2e-3  # a delay of two ticks alone is worth 4e-4 rad at this motion's speed
NOISE: dict[str, Any] = {"position_noise": 1e-4, "velocity_noise": 1e-3, "delay": 2}


def load(name: str, armature: float | None = None) -> rbi.ArmModel:
    """Return an arm without its gripper's joints."""
    return rbi.load_robot(name, lock=LOCKED.get(name, ()), armature=armature)


def motion(arm: rbi.ArmModel) -> Trajectory:
    """All joints swing by 0.2 rad about neutral in 6 s; the arm starts at neutral, 0.2 rad off."""
    return cosine(arm, amplitude=0.2, period=6.0)


def run(proposal: GainProposal, sample: PlantSample) -> dict[str, Any]:
    """Put a proposal to the test on one plant."""
    arm = proposal.nominal
    figures: dict[str, Any] = {"payload": sample.payload, "inertia_scale": sample.inertia_scale}
    try:
        result = rbi.simulate(
            sample.around(proposal.controller()),
            sample.plant,
            proposal.trajectory,
            q0=arm.neutral,
            duration=DURATION,
        )
    except rbi.DivergenceError as error:
        return figures | {"diverged": error.joint, "error": np.inf, "late": np.inf}
    e1 = np.abs(true_error(sample.plant, result))
    late = result.t >= LATE
    needed = needed_variation(sample.plant, proposal.trajectory, result.t[late][::10])
    variation = result.metrics(after=LATE)["tau_variation"]
    return figures | {
        "diverged": None,
        "error": float(e1[-1].max()),
        "late": float(e1[late].max()),
        "variation": float(variation.sum()),
        "needed": float(needed.sum()),
    }


def knowing(plant: rbi.ArmModel, trajectory: Trajectory) -> dict[str, float]:
    """The same law with a controller that knows the plant: error and variation of the torque."""
    proposal = propose_gains(
        plant, Uncertainty(), trajectory, DT, q0=plant.neutral, duration=DURATION, samples=1
    )
    (case,) = proposal.worst
    return {
        "error": float(case.true_error[-1].max()),
        "variation": float(case.variation.sum()),
    }


def part_a(names: Sequence[str], seed: int) -> list[dict[str, Any]]:
    """Rotors known; two plants for each arm."""
    rows = []
    for name in track(names, "A", console=Console(stderr=True)):
        arm = load(name, armature=0.1)
        for scale, viscous in ((1.1, 0.0), (1.3, 1.0)):
            known = Uncertainty(payload=ARMS[name], inertia_scale=scale, viscous=viscous)
            proposal = propose_gains(arm, known, motion(arm), DT, seed=seed)
            worst = known.sample(arm, 1)[0]  # all ranges at their upper ends
            row = {"arm": name, "links": scale, "viscous": viscous, "feasible": proposal.feasible}
            if proposal.feasible:
                measured, best = run(proposal, worst), knowing(worst.plant, motion(arm))
                row |= measured | {"ratio": measured["variation"] / best["variation"]}
                row |= {"knowing": best["error"]}
            rows.append(row)
    return rows


def part_b(names: Sequence[str], plants: int, seed: int) -> list[dict[str, Any]]:
    """No rotors, any payload up to the largest: many plants for each arm."""
    rows = []
    for name in names:
        arm = load(name)
        known = Uncertainty(payload=ARMS[name], inertia_scale=1.1)
        proposal = propose_gains(arm, known, motion(arm), DT, seed=seed)
        row = proposal_row(name, proposal)
        samples = known.sample(arm, plants, seed=seed + 1)
        console = Console(stderr=True)
        if proposal.feasible:
            tests = [run(proposal, s) for s in track(samples, f"B {name}", console=console)]
            best = [knowing(s.plant, motion(arm)) for s in samples[:REFERENCES]]
            pairs = zip(tests, best, strict=False)
            row |= summary(tests) | {
                "ratio_knowing": max(t["variation"] / b["variation"] for t, b in pairs),
                "payload_share": [round(t["payload"] / ARMS[name], 3) for t in tests],
                "errors": [float(f"{t['error']:.2g}") for t in tests],
            }
        rows.append(row)
    return rows


def part_c(names: Sequence[str], plants: int, seed: int) -> dict[str, Any]:
    """Noise and delay: bounded everywhere; and what they do to the gains of panda."""
    rows = []
    for name in names:
        arm = load(name)
        known = Uncertainty(payload=ARMS[name], inertia_scale=1.1, **NOISE)
        proposal = propose_gains(arm, known, motion(arm), DT, seed=seed, accuracy=NOISY_ACCURACY)
        row = proposal_row(name, proposal)
        if proposal.feasible:
            samples = known.sample(arm, plants, seed=seed + 1)
            console = Console(stderr=True)
            row |= summary([run(proposal, s) for s in track(samples, f"C {name}", console=console)])
        rows.append(row)
    arm = load("panda")
    cases = [(noise, 2) for noise in (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)]
    cases += [(0.0, delay) for delay in (0, 1, 3, 4)]
    gains = []
    for noise, delay in track(cases, "C gains", console=Console(stderr=True)):
        imperfect: dict[str, Any] = {
            "position_noise": 1e-4 * noise,
            "velocity_noise": 1e-3 * noise,
            "delay": delay,
        }
        known = Uncertainty(payload=2.0, inertia_scale=1.1, **imperfect)
        proposal = propose_gains(arm, known, motion(arm), DT, seed=seed, accuracy=1e-2)
        row = proposal_row("panda", proposal) | {"noise": noise, "delay": delay}
        gains.append(row | {"k1": proposal.k1.tolist(), "k2": proposal.k2.tolist()})
    return {"arms": rows, "gains": gains}


def part_beyond(names: Sequence[str], plants: int, seed: int) -> list[dict[str, Any]]:
    """More payload, a longer lever, slower periods; every yes is tested on plants that it has not seen."""
    cases = [(factor, 0.0, DT) for factor in (1, 2, 4, 8, 16)]
    cases += [(factor, 0.1, DT) for factor in (1, 2, 4, 8, 16)]
    cases += [(1, lever, dt) for lever in (0.0, 0.1) for dt in (2e-3, 5e-3, 1e-2)]
    rows = []
    for name in names:
        arm = load(name)
        for factor, lever, dt in track(cases, f"beyond {name}", console=Console(stderr=True)):
            known = Uncertainty(
                payload=factor * ARMS[name], inertia_scale=1.1, payload_com=(0.0, 0.0, lever)
            )
            proposal = propose_gains(arm, known, motion(arm), dt, seed=seed)
            row = proposal_row(name, proposal) | {"factor": factor, "lever": lever, "dt": dt}
            if proposal.feasible:
                samples = known.sample(arm, plants, seed=seed + 1)
                row |= summary([run(proposal, s) for s in samples])
            rows.append(row)
    return rows


def proposal_row(name: str, proposal: GainProposal) -> dict[str, Any]:
    """What a proposal says, in figures."""
    mismatch = proposal.mismatch
    return {
        "arm": name,
        "feasible": proposal.feasible,
        "joint": proposal.joint,
        "reason": proposal.reason,
        "carried": proposal.payload,
        "rho": mismatch.rho,
        "gain": [mismatch.gain_low, mismatch.gain_high],
        "margin": float(proposal.margin[0]),
        "smoothing": float(getattr(proposal.surface, "smoothing", np.nan)),
        "predicted": float(proposal.error.max()),
    }


def summary(tests: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The worst of several plants."""
    sound = [test for test in tests if test["diverged"] is None]
    return {
        "plants": len(tests),
        "diverged": len(tests) - len(sound),
        "error": max(test["error"] for test in tests),
        "median": float(np.median([test["error"] for test in tests])),
        "late": max(test["late"] for test in tests),
        "ratio": max((test["variation"] / test["needed"] for test in sound), default=np.inf),
    }


def draw(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Error at 5 s over payload, one colour for each arm."""
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    for row in rows:
        axes.semilogy(row["payload_share"], row["errors"], ".", ms=4, label=row["arm"])
    axes.axhline(1e-4, color="0.4", linewidth=0.8, linestyle="--")
    axes.set(xlabel="payload / largest payload", ylabel=r"largest $|e_1|$ at 5 s [rad]")
    axes.legend(fontsize=8, ncols=2)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def print_tables(report: dict[str, Any]) -> None:
    """Print the tables as Markdown."""
    for row in report.get("A", []):
        print(
            f"| {row['arm']} | {row['links']} | {row['viscous']:g} | {row.get('error', np.nan):.1e} "
            f"| {row.get('knowing', np.nan):.1e} | {row.get('ratio', np.nan):.2f} |"
        )
    for row in report.get("B", []):
        print(
            f"| {row['arm']} | {row['carried']:.2f} | {row['gain'][0]:.2f}–{row['gain'][1]:.2f} "
            f"| {row['margin']:.1f} | {row['median']:.1e} | {row['error']:.1e} "
            f"| {row['ratio']:.2f} | {row['ratio_knowing']:.2f} | {row['diverged']} |"
        )
    for row in report.get("C", {}).get("arms", []):
        print(
            f"| {row['arm']} | {row['feasible']} | {row['margin']:.1f} "
            f"| {row.get('median', np.nan):.1e} | {row.get('late', np.nan):.1e} | {row.get('diverged', 0)} |"
        )
    for row in report.get("C", {}).get("gains", []):
        print(
            f"| {row['noise']:g} | {row['delay']} | {row['feasible']} | {row['k1'][5]:.3g} "
            f"| {row['k2'][5]:.3g} | {row['margin']:.3g} |"
        )
    for row in report.get("beyond", []):
        said = f"yes, {row['error']:.0e}" if row["feasible"] else f"no: {row['joint']}"
        print(f"| {row['arm']} | x{row['factor']} | {row['lever']:g} | {row['dt']:g} | {said} |")


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", nargs="*", default=["A", "B", "C", "beyond"])
    parser.add_argument("--arms", nargs="*", default=list(ARMS))
    parser.add_argument("--plants", type=int, default=200, help="of part B, for each arm")
    parser.add_argument("--few", type=int, default=12, help="plants of parts C and beyond")
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "robustness_gains.json"
    parts: dict[str, Callable[[], Any]] = {
        "A": lambda: part_a(options.arms, options.seed),
        "B": lambda: part_b(options.arms, options.plants, options.seed),
        "C": lambda: part_c(options.arms, options.few, options.seed),
        "beyond": lambda: part_beyond(options.arms, options.few, options.seed),
    }
    measured: dict[str, Any] = {}
    for name in options.parts:
        measured[name] = parts[name]()
        report = json.loads(path.read_text("utf-8")) if path.exists() else {}
        report |= {name: measured[name], "seed": options.seed, "dt": DT, "duration": DURATION}
        path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if "B" in measured:
        draw([row for row in measured["B"] if row["feasible"]], path.with_suffix(".png"))
    print_tables(measured)


if __name__ == "__main__":
    main()
