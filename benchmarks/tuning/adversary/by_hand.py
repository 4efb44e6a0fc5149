"""Whether a task that was refused can be tuned by hand: a small search over k1, k2 and the margin."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance.tuning import GainProposal
from rbimpedance.tuning.worst_case import (
    CHATTER_FLOOR,
    CHATTER_RATIO,
    needed_variation,
    usual_impedance,
)

from .closed_loops import LATE, run
from .plants import Plants

FEW = 8
MARGINS, K2, K1 = (1.0, 1.6, 3.0), (0.3, 1.0, 3.0, 10.0), (1.0, 1.5)
USUAL_MARGINS = (2.0, 4.0, 8.0)
"""Where the proposal has none."""


def tune(proposal: GainProposal, source: Plants, starts: Sequence[Any]) -> dict[str, float] | None:
    """Return factors on margin, k2 and k1 with which all plants do what was required; None where there are none."""
    points = source.first()
    few, rest = points[:FEW], points[FEW:]
    margin = float(proposal.margin.max())
    margins = [margin * x for x in MARGINS] if np.isfinite(margin) else USUAL_MARGINS
    for slow, firm, rooted in sorted(product(margins, K2, K1), key=lambda x: abs(np.log(x[1]))):
        k2 = firm * proposal.k2
        k1 = rooted * np.sqrt(firm) * proposal.k1
        reaching = rbi.SuperTwisting(k1, k2, "matched", slow)
        law = rbi.ImpedanceController(
            proposal.arm, usual_impedance(), proposal.surface, reaching, proposal.dt
        )
        if all(_holds(law, proposal, source, some, starts) for some in (few, rest)):
            return {"margin": slow, "k2": firm, "k1": rooted}
    return None


def _holds(
    law: rbi.ImpedanceController,
    proposal: GainProposal,
    source: Plants,
    points: Sequence[Any],
    starts: Sequence[Any],
) -> bool:
    """Whether no plant diverges, chatters, keeps an error or is thrown."""
    samples = [source.sample(point) for point in points]
    for start in starts:
        log = run(law, samples, proposal, start)
        if log["diverged"].any():
            return False
        t = log["t"][0]
        late = t >= LATE * t[-1]
        allowed = 1e-3 + proposal.uncertainty.delay * proposal.dt * np.abs(log["e2"][:, late]).max()
        far = 3.0 * np.abs(log["true"][:, 0]).max() + 0.1
        if np.abs(log["true"][:, late]).max() > allowed or np.abs(log["true"]).max() > far:
            return False
        if any(
            _chatters(sample, proposal, t[late], tau[late])
            for sample, tau in zip(samples, log["tau"], strict=True)
        ):
            return False
    return True


def _chatters(sample: Any, proposal: GainProposal, t: Any, tau: Any) -> bool:
    needed = needed_variation(sample.plant, proposal.trajectory, t[::10])
    variation = np.abs(np.diff(tau, axis=0)).sum(axis=0) / (t[-1] - t[0])
    has_noise = sample.position_noise > 0.0 or sample.velocity_noise > 0.0
    return (
        not has_noise
        and float(variation.sum()) > CHATTER_RATIO * float(needed.sum()) + CHATTER_FLOOR
    )
