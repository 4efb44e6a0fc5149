"""Plants in closed loop with a law, from one start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import Array
from rbimpedance.simulation import simulate_batch
from rbimpedance.trajectories.reference import difference_each
from rbimpedance.tuning import GainProposal

CHANNELS = ("q", "q_r", "e1", "e2", "tau")
LATE = 0.6
"""Share of a run after which its error is the one that stays."""


class Start(NamedTuple):
    """Where a run begins.

    Attributes:
        q: Configuration, shape (nq,).
        duration: Of the run [s].
    """

    q: Array
    duration: float


def run(
    law: rbi.ImpedanceController, samples: Sequence[Any], proposal: GainProposal, start: Start
) -> dict[str, Array]:
    """The channels of all plants from a start, with the true error; shape (plants, samples, nv) each."""
    every = max(round(1e-3 / proposal.dt), 1)
    ticks = max(round(start.duration / proposal.dt), 10)
    batch = simulate_batch(
        [sample.wrap(law) for sample in samples],
        [sample.plant for sample in samples],
        proposal.trajectory,
        q0=start.q,
        duration=ticks * proposal.dt,
        channels=CHANNELS,
        every=every,
        metrics=False,
    )
    log: dict[str, Array] = {name: batch[name] for name in CHANNELS}
    true = [
        difference_each(proposal.nominal, q, q_r)
        for q, q_r in zip(log["q"], log["q_r"], strict=True)
    ]
    times = np.tile(batch.t, (len(samples), 1))
    return log | {"true": np.array(true), "diverged": np.array(batch.diverged), "t": times}
