"""Does what `propose_gains(…, hardware=…)` promises hold? Sampled arms, hardware and unknown plants.

    python -m benchmarks.control.hardware.promise [--cases 200] [--seed 0] [--first 0]

Every case draws an arm, its hardware and a plant within what is stated as unknown, runs what is proposed on it, and
counts runs that diverge, whose error is more than 1.2 times what was promised, or whose torque varies by more than 1.2
times as much, and 2 N·m/s. Writes docs/figures/hardware_promise.json after every case, so that it may be stopped.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import rbimpedance as rbi
from benchmarks import pages
from benchmarks.arms import ARMS
from benchmarks.progress import bar

from .cases import Case, ours, run
from .linear_laws import TARGET

LENGTH = 5.0  # s
ROOM = 1.2
FLOOR = 2.0  # N·m/s


def drawn(seed: int, number: int) -> tuple[str, float, rbi.Hardware, dict[str, float]]:
    """Arm, largest dry friction, hardware, and where the plant is within its ranges."""
    rng = np.random.default_rng((seed, number))
    name = str(rng.choice(list(ARMS)))
    hardware = rbi.Hardware(
        encoder_bits=int(rng.integers(16, 25)),
        torque_lag=float(rng.uniform(1e-3, 5e-3)),
        delay=int(rng.integers(1, 5)),
        ripple=float(rng.uniform(0.0, 0.05)),
        stribeck=float(rng.uniform(0.0, 0.5)),
    )
    coulomb = float(rng.uniform(0.0, 10.0))
    shares = {key: float(rng.uniform()) for key in ("payload", "coulomb", "viscous")}
    return name, coulomb, hardware, shares | {"links": float(rng.uniform(0.9, 1.1))}


class Sampled(Case):
    """A case whose plant is somewhere within what is unknown."""

    shares: dict[str, float]

    def plant(self) -> rbi.ArmModel:
        """The sampled plant."""
        shares, arm = self.shares, self.arm().with_scaled_inertia(self.shares["links"])
        loaded = arm.with_payload(shares["payload"] * ARMS[self.name])
        return loaded.with_friction(shares["viscous"], shares["coulomb"] * self.coulomb)

    def unknown(self) -> rbi.Uncertainty:
        """Links up to 10 % lighter, too."""
        return super().unknown().but(inertia_scale=(0.9, 1.1))


def outcome(seed: int, number: int) -> dict[str, Any]:
    """One case."""
    name, coulomb, hardware, shares = drawn(seed, number)
    case = Sampled(name, coulomb)
    object.__setattr__(case, "shares", shares)
    found = {
        **{
            "case": number,
            "arm": name,
            "coulomb": coulomb,
            "bits": int(hardware.encoder_bits or 0),
        },
        **{
            "lag": float(hardware.torque_lag),
            "delay": hardware.delay,
            "stribeck": hardware.stribeck,
        },
        "ripple": float(hardware.ripple),
        "shares": shares,
    }
    proposal = ours(case, hardware, LENGTH)
    promised = {"promised": float(proposal.error.max()), "multiple": proposal.variation}
    if not proposal.feasible:
        return found | promised | {"outcome": "refused", "reason": proposal.reason}
    law = rbi.QuantizedEncoders.for_(hardware, proposal.controller(TARGET))
    seen = run(case, law, hardware, case.motion(), None, LENGTH)
    need = proposal.demand.need
    found |= promised | {"error": seen["error"], "seen": seen["variation"] / need}
    if not np.isfinite(seen["error"]):
        return found | {"outcome": "diverged"}
    if seen["error"] > ROOM * promised["promised"]:
        return found | {"outcome": "error"}
    loud = seen["variation"] > ROOM * promised["multiple"] * need + FLOOR
    return found | {"outcome": "loud" if loud else "kept"}


def main() -> None:
    """Draw, run, count."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=pages.FIGURES)
    asked = parser.parse_args()
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    asked.out.mkdir(parents=True, exist_ok=True)
    path, rows = asked.out / "hardware_promise.json", []
    with bar() as progress:
        task = progress.add_task("cases", total=asked.cases)
        for number in range(asked.first, asked.first + asked.cases):
            rows.append(pages.plain(outcome(asked.seed, number)))
            counts = dict.fromkeys(("kept", "refused", "error", "loud", "diverged"), 0)
            for row in rows:
                counts[row["outcome"]] += 1
            path.write_text(json.dumps({"counts": counts, "cases": rows}, indent=1) + "\n", "utf-8")
            progress.advance(task)
    print(counts)


if __name__ == "__main__":
    main()
