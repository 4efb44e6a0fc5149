"""What a run logs at every tick, as it is compared with limits and references."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

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
