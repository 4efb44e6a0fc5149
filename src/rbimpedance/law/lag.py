"""A first-order lag under an input that is held: T·dy/dt = x - y, exact over a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._common.arrays import Array


class Lag(NamedTuple):
    """What a step of length h needs.

    Attributes:
        decay: e^(-h/T), shape (nv,); 0 where there is no lag.
        mean: Mean of e^(-t/T) over the step, (1 - e^(-h/T))·T/h, shape (nv,).
    """

    decay: Array
    mean: Array


def lag_of(time_constant: Array, h: float) -> Lag:
    """Return the lag of a step.

    Args:
        time_constant: T, 0 where there is no lag, shape (nv,) [s].
        h: Length of the step [s].
    """
    steps = np.divide(
        h, time_constant, out=np.full_like(time_constant, np.inf), where=time_constant > 0.0
    )
    decay = np.exp(-steps)
    return Lag(decay, (1.0 - decay) / steps)


def lagged(y: Array, x: Array, decay: Array, mean: Array) -> tuple[Array, Array]:
    """Return the mean of y over a step under a held x, and y at its end.

    Args:
        y: At the beginning.
        x: The input.
        decay: See `Lag`.
        mean: See `Lag`.
    """
    behind = y - x
    return x + behind * mean, x + behind * decay
