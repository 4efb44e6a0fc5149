"""What a run logs at every tick, as it is compared with limits and references."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._common.arrays import Array, BoolArray
from .tool_log import ToolLog


@dataclass(frozen=True, eq=False, kw_only=True)
class RunLog:
    """The channels of a run; `SimulationResult` describes them."""

    t: Array
    q: Array
    v: Array
    q_r: Array
    e1: Array
    e2: Array
    e_im: Array
    s: Array
    tau: Array
    tau_ext: Array
    saturated: BoolArray
    rate_limited: BoolArray
    clipped: BoolArray
    reference_limited: BoolArray
    provenance: Mapping[str, Any]
    tool: ToolLog | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns."""
        return tuple(self.provenance["plant"]["joint_names"])


def settling_time(t: Array, errors: Array, tolerance: float) -> Array:
    """Return the first time from which abs(errors) stays within a tolerance, shape (n,) [s]; infinite if never.

    Args:
        t: Times, shape (N,) [s].
        errors: Errors, shape (N, n).
        tolerance: Error allowed.
    """
    outside = np.abs(errors) > tolerance
    after_last = len(t) - np.argmax(outside[::-1], axis=0)
    times = np.append(t, np.inf)[after_last]
    settled: Array = np.where(outside.any(axis=0), times, t[0])
    return settled
