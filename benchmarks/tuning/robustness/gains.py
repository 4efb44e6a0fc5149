"""Proposed gains on plants that they have not seen: rotors known, only ranges known, noise and delay, and beyond."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from benchmarks.arms import ARMS, DT, load, motion
from benchmarks.pages import markdown, power
from rbimpedance.tuning import GainProposal, PlantSample, Uncertainty

from .common import Figures, Job, Options, Part, as_rows, by_arm, on_every_arm
from .trials import knowing, propose, run, said, summary

NOISE: dict[str, Any] = {"position_noise": 1e-4, "velocity_noise": 1e-3, "delay": 2}
NOISY_ACCURACY = 2e-3  # a delay of two ticks alone is worth 4e-4 rad at this motion's speed
PLANTS_IN_A_JOB = 10
BEYOND = (
    *((factor, lever, DT) for lever in (0.0, 0.1) for factor in (1, 2, 4, 8, 16)),
    *((1, lever, dt) for lever in (0.0, 0.1) for dt in (2e-3, 5e-3, 1e-2)),
)
"""Factor on the largest payload, its distance from the tool [m], and the period [s]."""
GAIN_CASES = (
    *((noise, 2) for noise in (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)),
    *((0.0, delay) for delay in (0, 1, 3, 4)),
)
"""Noise in units of `NOISE`, and delay in ticks."""


# --- rotors known -------------------------------------------------------------------------------------------------


def rotors_known(name: str, scale: float, viscous: float, seed: int) -> Figures:
    """Rotors known; the plant with all ranges at their upper ends."""
    arm = load(name, armature=0.1)
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=scale, viscous=viscous)
    proposal = propose(arm, unknown, motion(arm), DT, seed=seed)
    row = said(proposal) | {"links": scale, "viscous": viscous}
    if not proposal.feasible:
        return row
    worst = unknown.sample(arm, 1)[0]
    measured, best = run(proposal, worst), knowing(worst.plant, motion(arm))
    ratio = measured["variation"] / best["variation"]
    return row | measured | {"ratio_knowing": ratio, "knowing": best["error"]}


def rotors_jobs(options: Options) -> list[Job]:
    """Two plants for each arm."""
    cases = ((1.1, 0.0), (1.3, 1.0))
    return [Job(rotors_known, (n, *case, options.seed)) for n in options.arms for case in cases]


def rotors_tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Part A."""
    rows = [
        (
            *(row["arm"], f"×{row['links']}", f"{row['viscous']:g}", power(row.get("error"))),
            *(power(row.get("knowing")), f"{row.get('ratio_knowing', np.nan):.2f}"),
        )
        for row in data["rows"]
    ]
    header = (
        *("arm", "links", "friction [N·m·s/rad]", "error [rad]"),
        *("of a controller that knows the plant [rad]", "variation over that controller's"),
    )
    return {"rotors": markdown(header, rows)}


# --- only the ranges known ----------------------------------------------------------------------------------------


def ranges_known(name: str, first: int, last: int, count: int, seed: int) -> Figures:
    """Some of the sampled plants, with the proposal's gains and with a controller that knows each."""
    proposal = _for_ranges(name, seed)
    row = said(proposal)
    if not proposal.feasible:
        return row | {"tests": []}
    samples = proposal.uncertainty.sample(proposal.nominal, count, seed=seed + 1)[first:last]
    return row | {"tests": [_beside_knowing(proposal, sample) for sample in samples]}


@cache
def _for_ranges(name: str, seed: int) -> GainProposal:
    """The same for every job of a process."""
    arm = load(name)
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=1.1)
    return propose(arm, unknown, motion(arm), DT, seed=seed)


def _beside_knowing(proposal: GainProposal, sample: PlantSample) -> Figures:
    measured, best = run(proposal, sample), knowing(sample.plant, proposal.trajectory)
    return measured | {"ratio_knowing": measured["variation"] / best["variation"]}


def ranges_jobs(options: Options) -> list[Job]:
    """Many plants for each arm, in small jobs."""
    starts = range(0, options.plants, PLANTS_IN_A_JOB)
    return [
        Job(ranges_known, (n, i, i + PLANTS_IN_A_JOB, options.plants, options.seed))
        for n in options.arms
        for i in starts
    ]


def ranges_collect(options: Options, answers: list[Any]) -> Figures:
    """One row for each arm."""
    rows = []
    for name, group in groupby(answers, lambda answer: answer["arm"]):
        parts = list(group)
        tests = [test for part in parts for test in part["tests"]]
        row = {key: value for key, value in parts[0].items() if key != "tests"}
        if tests:
            largest = max(test["payload"] for test in tests)
            row |= summary(tests) | {
                "ratio_knowing": max(test["ratio_knowing"] for test in tests),
                "payload_share": [round(test["payload"] / largest, 3) for test in tests],
                "errors": [float(f"{test['error']:.2g}") for test in tests],
            }
        rows.append(row | {"arm": name, "payload": ARMS.get(name, np.nan)})
    return {"rows": rows, "plants": options.plants}


def ranges_tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Part B."""
    rows = [
        (
            row["arm"],
            f"{row['payload']:g}, {row['carried']:.1f}",
            f"{row['gain'][0]:.2f} to {row['gain'][1]:.2f}",
            f"{row['margin']:.1f}",
            power(row.get("median")),
            power(row.get("error")),
            f"{row.get('ratio', np.nan):.2f}",
            f"{row.get('ratio_knowing', np.nan):.2f}",
            f"{row.get('diverged', '–')} of {row.get('plants', 0)}",
        )
        for row in data["rows"]
    ]
    header = (
        *("arm", "largest payload, payload in the model [kg]", "input gain", "margin"),
        *("error, median [rad]", "error, worst [rad]"),
        "variation over what the motion needs, worst",
        "… over that of a controller that knows the same plant, worst",
        "diverged",
    )
    return {"ranges": markdown(header, rows)}


def draw_ranges(data: Mapping[str, Any], out: Path) -> None:
    """Error at 5 s over payload, one colour for each arm."""
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    for row in data["rows"]:
        if row["feasible"]:
            axes.semilogy(row["payload_share"], row["errors"], ".", ms=4, label=row["arm"])
    axes.axhline(1e-4, color="0.4", linewidth=0.8, linestyle="--")
    axes.set(xlabel="payload / largest payload", ylabel=r"largest $|e_1|$ at 5 s [rad]")
    axes.legend(fontsize=8, ncols=2)
    axes.grid(alpha=0.3)
    figure.savefig(out / "robustness_gains.png", dpi=150)
    plt.close(figure)


# --- noise and delay ----------------------------------------------------------------------------------------------


def noisy(name: str, plants: int, seed: int) -> Figures:
    """Noise and delay on top."""
    arm = load(name)
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=1.1, **NOISE)
    proposal = propose(arm, unknown, motion(arm), DT, seed=seed, accuracy=NOISY_ACCURACY)
    if not proposal.feasible:
        return said(proposal)
    samples = unknown.sample(arm, plants, seed=seed + 1)
    return said(proposal) | summary([run(proposal, sample) for sample in samples])


def gains_under(noise: float, delay: int, seed: int) -> Figures:
    """What noise and delay do to panda's gains."""
    arm = load("panda")
    imperfect: dict[str, Any] = {
        "position_noise": 1e-4 * noise,
        "velocity_noise": 1e-3 * noise,
        "delay": delay,
    }
    unknown = Uncertainty(payload=2.0, inertia_scale=1.1, **imperfect)
    proposal = propose(arm, unknown, motion(arm), DT, seed=seed, accuracy=1e-2)
    row = said(proposal) | {"noise": noise, "delay": delay}
    return row | {"k1": proposal.k1.tolist(), "k2": proposal.k2.tolist()}


def noise_jobs(options: Options) -> list[Job]:
    """The arms, and panda's gains."""
    arms = [Job(noisy, (name, options.few, options.seed)) for name in options.arms]
    return arms + [Job(gains_under, (*case, options.seed)) for case in GAIN_CASES]


def noise_collect(options: Options, answers: list[Any]) -> Figures:
    """Rows of the arms and of the gains."""
    arms = len(options.arms)
    return {"rows": answers[:arms], "gains": answers[arms:]}


def noise_tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Part C."""
    rows = [
        (
            *(row["arm"], f"{row['margin']:.1f}", power(row.get("median")), power(row.get("late"))),
            f"{row.get('diverged', '–')} of {row.get('plants', 0)}",
        )
        for row in data["rows"]
    ]
    header = (
        *("arm", "margin", "error, median at 5 s [rad]"),
        *("error, worst from 3 s on [rad]", "diverged"),
    )
    gains = [
        (
            *(f"{row['noise']:g}", row["delay"], f"{row['k1'][5]:.3g}", f"{row['k2'][5]:.3g}"),
            *(f"{row['margin']:.3g}", f"{2.0 / (row['margin'] * DT):.3g}"),
        )
        for row in data["gains"]
    ]
    names = ("noise", "delay [ticks]", "k1", "k2", "margin", "2/(margin·h) [1/s]")
    return {"noise": markdown(header, rows), "noise-gains": markdown(names, gains)}


# --- beyond -------------------------------------------------------------------------------------------------------


def beyond(name: str, factor: float, lever: float, dt: float, plants: int, seed: int) -> Figures:
    """More payload, a longer lever, a slower period; feasible proposals are validated on held-out plants."""
    arm = load(name)
    unknown = Uncertainty(
        payload=factor * ARMS[name], inertia_scale=1.1, payload_com=(0.0, 0.0, lever)
    )
    proposal = propose(arm, unknown, motion(arm), dt, seed=seed)
    row = said(proposal) | {"factor": factor, "lever": lever, "dt": dt}
    if not proposal.feasible:
        return row
    samples = unknown.sample(arm, plants, seed=seed + 1)
    return row | summary([run(proposal, sample) for sample in samples])


def beyond_jobs(options: Options) -> list[Job]:
    """Every case on every arm."""
    return on_every_arm(options, beyond, BEYOND, max(options.few // 3, 2))


def beyond_tables(data: Mapping[str, Any]) -> dict[str, str]:
    """One row for each case, one column for each arm."""
    rows = data["rows"]
    cases = {
        f"×{factor}, {lever:g} m, {1e3 * dt:g} ms": {"factor": factor, "lever": lever, "dt": dt}
        for factor, lever, dt in BEYOND
    }
    accepted = [row for row in rows if row["feasible"]]
    diverged = sum(row["diverged"] for row in accepted)
    worst = max((row["error"] for row in accepted), default=np.nan)
    words = (
        f"{len(accepted)} of {len(rows)} are feasible; {diverged} of their "
        f"{sum(row['plants'] for row in accepted)} runs diverged; the worst error is {worst:.0e} rad."
    )
    table = by_arm("payload, lever, period", rows, cases, _beyond_cell)
    return {"beyond": f"{words}\n\n{table}"}


def _beyond_cell(row: Mapping[str, Any]) -> str:
    return f"{row['error']:.0e}" if row["feasible"] else f"infeasible: {row['joint']}"


PARTS: dict[str, Part] = {
    "rotors": Part(rotors_jobs, as_rows, rotors_tables),
    "ranges": Part(ranges_jobs, ranges_collect, ranges_tables, draw_ranges),
    "noise": Part(noise_jobs, noise_collect, noise_tables),
    "beyond": Part(beyond_jobs, as_rows, beyond_tables),
}
