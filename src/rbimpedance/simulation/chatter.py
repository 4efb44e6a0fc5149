"""How much a torque shakes, beyond what its motion needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from .run_log import RunLog
from .violations import limit_of

RATIO = 10.0
"""Variation that chatters, relative to what the motion needs."""

RIPPLE, NOISY_RIPPLE = 1e-3, 0.1
"""Ripple of the torque that is noticed, relative to the joint's torque: without and with noise in the loop."""

_WINDOW, _FEWEST = 0.1, 4  # over which the slow part is the mean [s], and in samples
_WINDOWS = 10  # that a run has at least
_SETTLING = 0.2  # from a step of the torque at the start [s]


class Ripple(NamedTuple):
    """The torque's fast part, and how it compares; arrays of shape (nv,).

    Attributes:
        size: Root-mean-square of torque - slow part [N·m or N].
        share: The same relative to the joint's torque limit, or to its largest torque where it has none.
        variation: Of the torque [N·m/s or N/s].
        needed: Variation of its slow part and of the environment's torque [N·m/s or N/s].
    """

    size: Array
    share: Array
    variation: Array
    needed: Array


def ripple_of(result: RunLog, start: int) -> Ripple | None:
    """Return the ripple of the torque after a sample; None for a run with too few samples.

    The slow part is the mean over 0.1 s. It follows the motion, pushes and contact; an oscillation above about 10 Hz is
    in the fast part. The variation of the slow part stands for what the motion needs.

    Args:
        result: The run.
        start: Number of the sample.
    """
    dt = float(result.t[1] - result.t[0]) if len(result.t) > 1 else np.inf
    start = max(start, min(int(_SETTLING / dt), len(result.t) // 2))
    tau = result.tau[start:]
    count = min(round(_WINDOW / dt), len(tau) // _WINDOWS)
    if count < _FEWEST or not np.isfinite(tau).all():
        return None
    sums = np.cumsum(np.concatenate([np.zeros((1, tau.shape[1])), tau]), axis=0)
    slow = (sums[count:] - sums[:-count]) / count
    fast = tau[count // 2 : count // 2 + len(slow)] - slow
    limit, size = limit_of(result, "effort"), np.sqrt(np.mean(fast**2, axis=0))
    scale = np.where(np.isfinite(limit), limit, np.abs(result.tau).max(axis=0))
    return Ripple(
        size=size,
        share=size / np.where(scale > 0.0, scale, np.inf),
        variation=_variation(tau, dt),
        needed=_variation(slow, dt) + _variation(result.tau_ext[start:], dt),
    )


def chatters(result: RunLog, ripple: Ripple) -> BoolArray:
    """Return which joints chatter, shape (nv,).

    Without noise, a torque that varies more than ten times what its motion needs, with a ripple above a thousandth of
    the joint's torque. Where sensors are noisy, or drives and encoders are simulated, the torque has to vary; there
    it chatters if the ripple is above a tenth of the joint's torque.

    Args:
        result: The run.
        ripple: Of its torque.
    """
    least = NOISY_RIPPLE if _is_noisy(result.provenance) else RIPPLE
    found: BoolArray = (ripple.share > least) & (ripple.variation > RATIO * ripple.needed)
    return found


def _variation(values: Array, dt: float) -> Array:
    """Total variation in a second, shape (nv,)."""
    variation: Array = np.abs(np.diff(values, axis=0)).sum(axis=0) / (dt * (len(values) - 1))
    return variation


def _is_noisy(origin: Any) -> bool:
    """Whether what produced a run has sensors with noise, or an engine with drives and encoders."""
    if not isinstance(origin, Mapping):
        return False
    return any(
        (name.endswith("noise") and bool(np.any(value))) or name == "engine" or _is_noisy(value)
        for name, value in origin.items()
    )
