"""A bandwidth that is low while counts explain what the encoders show, and high while they do not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, not_negative, per_joint, positive, positive_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields

COUNTS = 4.0
"""Innovation at which the gate begins to open; at twice as many counts it is open."""

OPENING = 0.3
"""Share by which an opening gate comes closer to its goal in a tick."""

CLOSING = 0.5
"""Rate at which it closes, over the low bandwidth."""


def filtered_innovation(before: Array, innovation: Array, bandwidth: Array, h: float) -> Array:
    """Return the innovation behind a low-pass of twice the observer's bandwidth.

    Args:
        before: The same at the tick before.
        innovation: Measured less expected position.
        bandwidth: Of the observer [rad/s].
        h: Period [s].
    """
    return before + (1.0 - np.exp(-2.0 * bandwidth * h)) * (innovation - before)


def opened(
    opening: Array,
    innovation: Array,
    error: Array,
    count: Array,
    accuracy: Array,
    falls: Array,
    rises: float,
) -> Array:
    """Return how far the gate is open, from 0 to 1.

    Args:
        opening: The same at the tick before.
        innovation: From `filtered_innovation`.
        error: Of the position.
        count: The innovation at which the gate begins to open.
        accuracy: The error at which it does.
        falls: Share by which a closing gate comes closer to its goal.
        rises: The same of an opening one.
    """
    excess = np.maximum(np.abs(innovation) / count, np.abs(error) / accuracy) - 1.0
    goal = np.minimum(np.maximum(excess, 0.0), 1.0)
    share = falls + (rises - falls) * (goal > opening)
    return opening + share * (goal - opening)


class GateState(NamedTuple):
    """What the gate remembers, each of shape (nv,).

    Attributes:
        opening: From 0, closed, to 1, open.
        innovation: Behind its low-pass [rad or m].
    """

    opening: Array
    innovation: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class NoiseGate:
    """Bandwidth of an observer and its loop, by whether the noise of counting explains the innovation.

        ω = ω⁻·(1 + (ω⁺/ω⁻ - 1)·g),    g → clip(max(abs(ν_f)/(4·c), abs(e)/accuracy) - 1, 0, 1)

    with ν_f the innovation behind a low-pass of twice the observer's bandwidth and c a count. An innovation of up to
    four counts is what counting does to a loop at rest or in slow motion: the gate stays closed, and the torque is
    quiet. A disturbance, such as dry friction at a reversal, moves ν_f beyond that within some ticks: g rises by 30 %
    of the way a tick, and falls at half of the low bandwidth. An error e beyond the accuracy opens it, too: a joint
    that sticks moves no count, and its error grows.

    Attributes:
        low: ω⁻ of the loop, shape (nv,) [rad/s].
        high: ω⁺ of the loop, shape (nv,) [rad/s].
        count: c, shape (nv,) [rad or m].
        accuracy: Error of the position at which the gate begins to open, shape (nv,); infinite for never [rad or m].
        ratio: Bandwidth of the observer over that of the loop.
        dt: Period [s].

    Raises:
        ParameterError: A number that is not positive, or a count below 0.
        DimensionError: Numbers for another number of joints.
    """

    low: Array
    high: Array
    count: Array
    accuracy: Array
    ratio: float
    dt: float

    def __init__(
        self,
        low: ArrayLike,
        high: ArrayLike,
        count: ArrayLike,
        dt: float,
        ratio: float = 3.0,
        accuracy: ArrayLike = np.inf,
    ) -> None:
        low, high = positive("low", low), positive("high", high)
        nv = max(low.size, high.size)
        set_fields(
            self,
            low=per_joint("low", low, nv),
            high=per_joint("high", high, nv),
            count=not_negative("count", count, nv),
            accuracy=per_joint("accuracy", np.asarray(accuracy, dtype=np.float64), nv),
            ratio=positive_number("ratio", ratio, "ratio of two bandwidths"),
            dt=positive_number("dt", dt, "control period in seconds"),
        )

    def init(self) -> GateState:
        """Return the state of a closed gate."""
        zero = np.zeros(len(self.low))
        return GateState(zero, zero)

    def bandwidth(self, state: GateState) -> Array:
        """Return the bandwidth of the loop, shape (nv,) [rad/s]; that of the observer is `ratio` times as high."""
        bandwidth: Array = self.low + (self.high - self.low) * state.opening
        return bandwidth

    def step(self, state: GateState, innovation: Array, error: Array | None = None) -> GateState:
        """Return the state after an innovation.

        Args:
            state: From `init` or the tick before.
            innovation: Measured less expected position, shape (nv,) [rad or m].
            error: Of the expected position, shape (nv,); none by default [rad or m].
        """
        error = np.zeros_like(innovation) if error is None else error
        omega = self.ratio * self.bandwidth(state)
        nu = filtered_innovation(state.innovation, innovation, omega, self.dt)
        opening = opened(
            *(state.opening, nu, error, self.threshold, self.accuracy, self.falls), OPENING
        )
        return GateState(opening, nu)

    @property
    def threshold(self) -> Array:
        """Innovation at which the gate begins to open, shape (nv,) [rad or m]."""
        threshold: Array = np.maximum(COUNTS * self.count, _LEAST)
        return threshold

    @property
    def falls(self) -> Array:
        """Share by which a closing gate comes closer to its goal in a tick, shape (nv,)."""
        return np.asarray(-np.expm1(-CLOSING * self.low * self.dt))


_LEAST = 1e-9  # rad: an encoder without counts
