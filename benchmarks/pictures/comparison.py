"""Make the pictures of README.md and docs/claims.md, PNG for the pages and PDF to print in out/figures.

python -m benchmarks.pictures.comparison [panda] [paper]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rich.progress import track

import rbimpedance as rbi
from benchmarks.pages import FIGURES
from rbimpedance import baselines
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.control.protocol import Controller
from rbimpedance.pictures import figures
from rbimpedance.pictures.figures.style import STYLE, name_lines
from rbimpedance.simulation.scenarios import paper_comparison

PRINTED = Path("out") / "figures"

DT = 1e-3
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
"""The panda's usual posture, in the middle of its joints' ranges [rad]."""

SENSORS: dict[str, Any] = {"position_noise": 1e-5, "velocity_noise": 1e-3, "delay": 1}
"""Of all controllers: standard deviations [rad, rad/s] and ticks."""

START = 0.05
"""How far every joint is from the reference at the start [rad]."""

DURATION = 3.6
"""Of a run [s]."""

SETTLED = 1.0
"""When the start is over [s]."""

PUSHED = 2.0, 3.0
"""From when to when a hand pushes with 20 N [s]."""

BANDWIDTHS = [30.0, 40.0, 50.0]
"""Among which the PID with our torque variation is looked for [rad/s]."""


def panda() -> None:
    """Draw a panda with 2 kg that no controller knows of, and print the figures of the caption."""
    arm = rbi.load_robot("panda", lock=("panda_finger_joint1", "panda_finger_joint2"), armature=0.1)
    target = rbi.Impedance(mass=1.0, damping=20.0, stiffness=100.0)
    motion = rbi.trajectories.cosine(arm, center=READY, amplitude=0.2, period=4.0)
    proposal = rbi.propose_gains(
        arm,
        rbi.Uncertainty(payload=2.0, **SENSORS),
        motion,
        DT,
        impedance=target,
        q0=motion(0.0).q,
        limits=arm.effort_limit,
    )
    ours = proposal.controller(target)
    model, limits = ours.arm, arm.effort_limit
    push = rbi.interaction.Push(
        [0, 20, 0, 0, 0, 0], start=PUSHED[0], duration=PUSHED[1] - PUSHED[0]
    )

    def run(controller: Controller[Any], offset: float = START) -> rbi.SimulationResult:
        return rbi.simulate(
            ImperfectController(controller, **SENSORS),
            arm.with_payload(2.0),
            motion,
            environment=push,
            q0=motion(0.0).q - offset,
            duration=DURATION,
        )

    def pid(bandwidth: float) -> baselines.PIDImpedance:
        return baselines.PIDImpedance(model, target, bandwidth, DT, limits=limits)

    def variation(result: rbi.SimulationResult) -> float:
        return float(result.metrics(after=SETTLED)["tau_variation"].sum())

    found = run(ours)
    variations = [variation(run(pid(p), 0.0)) for p in track(BANDWIDTHS, "PID's bandwidth")]
    as_rough = float(np.interp(variation(found), variations, BANDWIDTHS))
    results = {
        "computed torque": run(baselines.ComputedTorqueImpedance(model, target, DT)),
        f"PID, {as_rough:.0f} rad/s": run(pid(as_rough)),
        "PID, 10 rad/s": run(pid(10.0)),
        "ours": found,
    }
    for name, result in results.items():
        settled = result.t >= SETTLED
        apart = millimetres(arm, result)
        print(
            f"{name}: {np.sqrt((apart[settled] ** 2).mean()):.2f} mm rms and {apart[settled].max():.2f} mm at most "
            f"from {SETTLED:g} s on, below 2 mm from {result.t[np.flatnonzero(apart > 2.0)[-1]]:.2f} s; "
            f"torque varies by {variation(result):.0f} N·m/s, at most {shares(result, limits).max():.2f} of a limit; "
            f"speed at most {np.abs(result.v / arm.velocity_limit).max():.2f} of a limit; "
            f"{int(result.saturated.any(axis=1).sum())} ticks at a limit"
        )
    write(panda_figure(arm, results), "panda")


def millimetres(arm: rbi.ArmModel, result: rbi.SimulationResult) -> np.ndarray[Any, Any]:
    """Distance of the tool from where the impedance reference has it, shape (N,) [mm]."""
    tools = [
        [arm.frame_placement(q)[1] for q in (q, q_r)]
        for q, q_r in zip(result.q, result.q_r, strict=True)
    ]
    return np.asarray(1e3 * np.linalg.norm(np.diff(tools, axis=1)[:, 0], axis=1))


def shares(result: rbi.SimulationResult, limits: Any) -> np.ndarray[Any, Any]:
    """Torque of the joint that is nearest to its limit, as a share of that limit, shape (N,)."""
    return np.asarray(np.abs(result.tau / limits).max(axis=1))


def panda_figure(arm: rbi.ArmModel, results: dict[str, rbi.SimulationResult]) -> Figure:
    """Distance of the tool from its reference above, share of the torque limits below."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.6, 4.6))
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for name, result in results.items():
            width = 1.8 if name == "ours" else 1.1
            upper.semilogy(result.t, millimetres(arm, result), label=name, linewidth=width)
            lower.plot(result.t, shares(result, arm.effort_limit), label=name, linewidth=width)
        upper.set_ylim(0.05, 100.0)
        upper.yaxis.set_major_formatter("{x:g}")
        lower.set_ylim(0.0, 1.05)
        for axes in (upper, lower):
            axes.margins(x=0.0)
            axes.axvspan(*PUSHED, color="0.93", zorder=0)
        name_lines(upper, upper.get_lines()[: len(results)])
        upper.text(
            np.mean(PUSHED),
            0.95,
            "pushed, 20 N",
            transform=upper.get_xaxis_transform(),
            ha="center",
            va="top",
        )
        upper.set_ylabel("tool off its reference [mm]")
        lower.set_ylabel("torque / limit")
        lower.set_xlabel("time [s]")
    return figure


CORRECTIONS = (
    "paper's law, as sampled",
    "surface corrected",
    "surface corrected (nonsingular)",
    "scheme corrected",
    "both corrected",
    "both corrected (nonsingular)",
)
"""The implicit scheme is left out: its curves lie on those of the matched one."""

PAPERS_ARM = (
    "paper's law, as sampled",
    "computed torque (Hogan)",
    "computed torque, PID",
    "first-order, boundary layer",
    "both corrected",
)


def paper() -> None:
    """Draw the paper's arm under its law, the corrections and the baselines."""
    scenarios = paper_comparison()
    results = {name: scenarios[name].simulate() for name in track(scenarios, "paper's arm")}
    others = [name for name in results if "corrected" not in name]
    for title, names in {
        "corrections": CORRECTIONS,
        "baselines": (*others, "both corrected"),
        "paper": PAPERS_ARM,
    }.items():
        write(figures.comparison({name: results[name] for name in names}), title)


def write(figure: Figure, name: str) -> None:
    """Write a figure for the pages and for print."""
    PRINTED.mkdir(parents=True, exist_ok=True)
    print(figures.save(figure, FIGURES / f"{name}.png"))
    print(figures.save(figure, PRINTED / f"{name}.pdf"))


def main() -> None:
    """Draw what is asked for, everything by default."""
    drawn = {"panda": panda, "paper": paper}
    for name in sys.argv[1:] or drawn:
        drawn[name]()


if __name__ == "__main__":
    main()
