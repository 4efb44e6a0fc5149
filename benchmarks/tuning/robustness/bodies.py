"""Payloads with extent and offset, which change a wrist's inertia far more than a point mass at the tool."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.arms import ARMS, DT, load, motion
from benchmarks.pages import power
from rbimpedance.tuning import GainProposal, MotionMargin, Uncertainty
from rbimpedance.tuning.mismatch import measure
from rbimpedance.tuning.motions import sample_motions

from .common import DURATION, Figures, Job, Options, Part, as_rows, by_arm, on_every_arm
from .trials import propose, run, said, summary

BODIES = (
    *((1, 0.0, 0.0), (1, 0.05, 0.05), (1, 0.1, 0.1), (1, 0.2, 0.1)),
    *((2, 0.2, 0.1), (4, 0.2, 0.1), (8, 0.25, 0.15), (16, 0.3, 0.2), (32, 0.4, 0.3)),
)
"""Factor on the largest payload, its radius of gyration and its distance from the tool [m]."""
GEARED = 0.1  # kg·m²


def body(
    name: str, factor: float, gyration: float, lever: float, plants: int, seed: int
) -> Figures:
    """Any payload from none to the largest; feasible proposals are validated, and a remedy of infeasible ones."""
    arm = load(name)
    unknown = Uncertainty(
        payload=factor * ARMS[name],
        inertia_scale=1.1,
        payload_com=(0.0, 0.0, lever),
        payload_gyration=(gyration, gyration),
    )
    proposal = propose(arm, unknown, motion(arm), DT, seed=seed)
    motions = sample_motions(arm, motion(arm), DURATION, DT, 25, seed, MotionMargin())
    empty = measure(arm, unknown.extremes(arm), motions, DT).rho
    row = said(proposal) | {"factor": factor, "gyration": gyration, "lever": lever, "empty": empty}
    if proposal.feasible:
        return row | _tested(proposal, unknown, plants, seed)
    geared = load(name, armature=GEARED)
    known = propose(geared, unknown, motion(geared), DT, seed=seed)
    way = said(known)
    return row | {
        "way": way | _tested(known, unknown, plants, seed) if known.feasible else way,
        "remedies": proposal.remedies,
    }


def _tested(proposal: GainProposal, unknown: Uncertainty, plants: int, seed: int) -> Figures:
    samples = unknown.sample(proposal.nominal, plants, seed=seed + 1)
    return summary([run(proposal, sample) for sample in samples])


def jobs(options: Options) -> list[Job]:
    """Every body on every arm."""
    return on_every_arm(options, body, BODIES, max(options.few // 2, 4))


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """One row for each body, one column for each arm; and the largest mismatches of feasible proposals."""
    rows = data["rows"]
    cases = {
        f"×{factor}, {gyration:g} m, {lever:g} m": {
            "factor": factor,
            "gyration": gyration,
            "lever": lever,
        }
        for factor, gyration, lever in BODIES
    }
    accepted = [row for row in rows if row["feasible"]]
    ways = [row["way"] for row in rows if not row["feasible"]]
    geared = [way for way in ways if way["feasible"]]
    most = max(accepted, key=lambda row: row["rho"])
    empty = max(accepted, key=lambda row: row["empty"])
    words = [
        f"{len(accepted)} of {len(rows)} are feasible, up to ρ = {most['rho']:.3g} ({most['arm']}), which without a "
        f"payload in the model would be {most['empty']:.3g}; the largest ρ without one is {empty['empty']:.3g} "
        f"({empty['arm']}). Of {sum(row['plants'] for row in accepted)} runs "
        f"{sum(row['diverged'] for row in accepted)} diverged; the worst error is "
        f"{power(max(row['error'] for row in accepted))} rad."
    ]
    if geared:
        words.append(
            f"With rotors of {GEARED:g} kg·m² known, {len(geared)} of the {len(ways)} infeasible cases are feasible; "
            f"the worst error of their {sum(way['plants'] for way in geared)} runs is "
            f"{power(max(way['error'] for way in geared))} rad, {sum(way['diverged'] for way in geared)} diverged."
        )
    table = by_arm("payload, radius of gyration, lever", rows, cases, _cell)
    return {"bodies": " ".join(words) + "\n\n" + table}


def _cell(row: Mapping[str, Any]) -> str:
    rho = f"ρ {row['empty']:.3g} → {row['rho']:.3g}"
    if row["feasible"]:
        return f"{rho}: {row['error']:.0e}"
    way = f"{row['way']['error']:.0e}" if row["way"]["feasible"] else "infeasible"
    return f"{rho}: infeasible, {row['joint']}; rotors known: {way}"


PARTS = {"bodies": Part(jobs, as_rows, tables)}
