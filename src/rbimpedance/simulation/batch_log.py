"""What the worlds of a batch leave behind."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._common.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchLog:
    """What the worlds leave behind; see `BatchResult`.

    Attributes:
        every: Ticks from one sample to the next.
        channels: Samples by channel, shape (N, samples, nq or nv).
        metrics: MetricSums of merit, each of shape (N, nv).
        q: Configuration at the end, shape (N, nq).
        v: Velocity at the end, shape (N, nv).
        divergence: Tick and joint of the worlds that diverged.
    """

    every: int
    channels: dict[str, Array]
    metrics: dict[str, Array]
    q: Array
    v: Array
    divergence: dict[int, tuple[int, str]] = field(default_factory=dict)

    def end_early(self, i: int, tick: int, joint: str) -> None:
        """Mark a world that has diverged in the period after a tick."""
        self.divergence[i] = tick, joint
        for channel in self.channels.values():
            channel[i, tick // self.every + 1 :] = False if channel.dtype == np.bool_ else np.nan
