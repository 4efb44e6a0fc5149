"""Does what `propose_gains(…, hardware=…)` promises hold? Sampled arms, hardware and unknown plants.

    python -m benchmarks.control.hardware.promise [--cases 2000] [--seed 0] [--log promise.jsonl] [--table]

Draws arms with their hardware, asks for a proposal, and runs it on several plants anywhere within what is stated as
unknown. Broken is a promise where a run diverges, where its error is more than 1.2 times what was promised, or where
its torque varies by more than 1.2 times as much, and 2 N·m/s. Every case is a line of the log, and depends on the seed
and its number alone: a sweep that was stopped goes on where it ended. `--table` only writes
docs/figures/hardware_promise.json and the table in docs/hardware-limits.md.
"""

from __future__ import annotations

import argparse
import functools
import json
import logging
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import rbimpedance as rbi
from benchmarks import pages
from benchmarks.arms import ARMS
from benchmarks.progress import bar
from rbimpedance.simulation.plants.elasticity import enough_substeps
from rbimpedance.tuning import hardware_proposal

from . import promise_page
from .cases import VISCOUS, Case, evaluated, ours
from .linear_laws import DT, TARGET

LENGTH = 5.0  # s
PLANTS = 4
"""Cases with the same hardware."""
ROOM = 1.2
FLOOR = 2.0  # N·m/s
CHANNELS = ("q", "q_r", "tau")


class Sampled(Case):
    """An arm whose links may be up to 10 % lighter, too, and any plant of it."""

    def unknown(self) -> rbi.Uncertainty:
        """What is not known."""
        return super().unknown().but(inertia_scale=(0.9, 1.1))

    def anywhere(self, shares: Shares) -> rbi.ArmModel:
        """A plant within its ranges."""
        heavy = self.arm().with_scaled_inertia(0.9 + 0.2 * shares.links)
        loaded = heavy.with_payload(shares.payload * ARMS[self.name])
        return loaded.with_friction(shares.viscous * VISCOUS, shares.coulomb * self.coulomb)


class Shares(NamedTuple):
    """Where a plant is within its ranges, from 0 to 1."""

    payload: float
    links: float
    coulomb: float
    viscous: float


def drawn(seed: int, number: int) -> tuple[Sampled, rbi.Hardware]:
    """Arm with its largest dry friction, and hardware."""
    rng = np.random.default_rng((seed, number))
    name = str(rng.choice(list(ARMS)))
    hardware = rbi.Hardware(
        encoder_bits=int(rng.integers(16, 25)),
        torque_lag=float(rng.uniform(1e-3, 5e-3)),
        delay=int(rng.integers(1, 5)),
        ripple=float(rng.uniform(0.0, 0.05)),
        stribeck=float(rng.uniform(0.0, 0.5)),
    )
    return Sampled(name, float(rng.uniform(0.0, 10.0))), hardware


def plants_drawn(seed: int, number: int) -> list[Shares]:
    """Plants for the hardware of that number."""
    rng = np.random.default_rng((seed, number, 1))
    return [Shares(*rng.uniform(size=4).tolist()) for _ in range(PLANTS)]


def outcomes(seed: int, number: int) -> Iterator[dict[str, Any]]:
    """The cases with the hardware of that number."""
    case, hardware = drawn(seed, number)
    proposal, plants = ours(case, hardware, LENGTH), plants_drawn(seed, number)
    given = described(case, hardware) | {
        "promised": float(proposal.error.max()),
        "multiple": proposal.variation,
        "softer": proposal.softer,
    }
    if proposal.feasible:
        need = proposal.demand.need
        seen = [verdict(given, run, need) for run in runs(case, hardware, proposal, plants)]
    else:
        seen = [{"outcome": "refused", "reason": proposal.reason}] * PLANTS
    for i, (shares, shown) in enumerate(zip(plants, seen, strict=True)):
        yield {"seed": seed, "case": PLANTS * number + i, **given, **shares._asdict(), **shown}


def described(case: Sampled, hardware: rbi.Hardware) -> dict[str, Any]:
    """Arm and hardware in figures."""
    return {
        "arm": case.name,
        "bits": int(hardware.encoder_bits or 0),
        "lag": float(hardware.torque_lag),
        "delay": hardware.delay,
        "friction": case.coulomb,
        "stribeck": hardware.stribeck,
        "ripple": float(hardware.ripple),
    }


def runs(
    case: Sampled, hardware: rbi.Hardware, proposal: rbi.HardwareProposal, plants: list[Shares]
) -> list[dict[str, Any]]:
    """What the proposal makes of plants."""
    arms, q0 = [case.anywhere(shares) for shares in plants], np.array(case.arm().neutral)
    batch = rbi.simulate_batch(
        proposal.controller(TARGET),
        arms,
        case.motion(),
        q0=q0,
        duration=LENGTH,
        substeps=enough_substeps(rbi.DrivenPlant.for_(hardware, arms[0], DT), q0, DT),
        hardware=hardware,
        channels=CHANNELS,
        metrics=False,
        threads=1,
    )
    return [
        evaluated(arm, batch.t, *(batch[name][i] for name in CHANNELS))
        for i, arm in enumerate(arms)
    ]


def verdict(given: dict[str, Any], run: dict[str, Any], need: float) -> dict[str, Any]:
    """Whether the promise was kept."""
    if not np.isfinite(run["error"]):
        return {"outcome": "diverged"}
    outcome = "kept"
    if run["variation"] > ROOM * given["multiple"] * need + FLOOR:
        outcome = "loud"
    if run["error"] > ROOM * given["promised"]:
        outcome = "error"
    return {"outcome": outcome, "error": run["error"], "seen": run["variation"] / need}


def measured_once() -> None:
    """Keep what is measured of an arm: of one with rigid joints it does not depend on its hardware."""
    used: Any = hardware_proposal
    measure, found = used.measure_task, dict[str, Any]()

    def kept(task: Any) -> Any:
        if task.arm.name not in found:
            found[task.arm.name] = measure(task)
        return found[task.arm.name]

    used.measure_task = functools.wraps(measure)(kept)


def swept(log: Path, seed: int, cases: int) -> None:
    """Append the cases that are not there yet."""
    pieces = -(-cases // PLANTS)
    done = {row["case"] // PLANTS for row in promise_page.read(log) if row["seed"] == seed}
    with bar() as progress, log.open("a", encoding="utf-8") as lines:
        task = progress.add_task("hardware", total=pieces, completed=len(done))
        for number in (each for each in range(pieces) if each not in done):
            rows = [json.dumps(pages.plain(row)) for row in outcomes(seed, number)]
            lines.write("\n".join(rows) + "\n")
            lines.flush()
            progress.advance(task)


def main() -> None:
    """Draw, run, tabulate."""
    parser = pages.parser(__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--log", type=Path, default=Path("promise.jsonl"))
    parser.add_argument("--table", action="store_true", help="only tabulate what is there")
    asked: argparse.Namespace = parser.parse_args()
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    if not asked.table:
        measured_once()
        swept(asked.log, asked.seed, asked.cases)
    promise_page.write(promise_page.read(asked.log), asked.out, asked.docs)


if __name__ == "__main__":
    main()
