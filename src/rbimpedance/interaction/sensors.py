"""Measurement of tau_ext: sensors with delay or a low-pass.

A `Sensor` is between the environment and the controller; `simulate(..., sensor=...)` uses it. Wrench sensors in the
wrist are in wrench_sensor.py; estimators that need no force sensor have the same form and are in estimators.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number, whole_number

StateT = TypeVar("StateT")


class Sensor(Protocol[StateT]):
    """A measurement or an estimate of tau_ext. `step` is pure; all its memory is in the state."""

    def init(self) -> StateT:
        """Return the state before the first tick."""

    def step(
        self, state: StateT, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, StateT]:
        """Return the measured tau_ext, shape (nv,) [N·m or N], and the next state.

        Args:
            state: From `init` or from the tick before.
            q: Configuration now, shape (nq,).
            v: Velocity now, shape (nv,) [rad/s or m/s].
            tau: Motor torque held since the tick before, shape (nv,) [N·m or N]; zeros at the first tick.
            tau_ext: True external torque now, shape (nv,) [N·m or N]. Estimators do not use it.
        """


@dataclass(frozen=True)
class Perfect:
    """The true torque, without delay."""

    def init(self) -> None:
        """Return nothing: there is nothing to remember."""

    def step(
        self, state: None, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, None]:
        """Return tau_ext; see `Sensor.step`."""
        del state, q, v, tau
        return tau_ext, None


PastTorques: TypeAlias = tuple[Array, ...]
"""Torques of past ticks, the oldest first."""


@dataclass(frozen=True)
class Delay:
    """The true torque some ticks ago; in the first ticks, that of the first tick.

    Attributes:
        ticks: Delay in control periods, a whole number, at least 0.

    Raises:
        ParameterError: Anything else.
    """

    ticks: int

    def __post_init__(self) -> None:
        whole_number("ticks", self.ticks, meaning="control periods")

    def init(self) -> PastTorques:
        """Return the state before the first tick: no past."""
        return ()

    def step(
        self, state: PastTorques, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, PastTorques]:
        """Return the tau_ext of `ticks` ago; see `Sensor.step`."""
        del q, v, tau
        past = (state or (tau_ext,) * self.ticks) + (tau_ext,)
        return past[0], past[1:]


@dataclass(frozen=True)
class LowPass:
    """First-order low-pass, y⁺ = y + (1 - exp(-ω h))·(x - y), starting at its first input.

    Attributes:
        cutoff: Corner frequency ω/2π [Hz].
        dt: Control period h [s].

    Raises:
        ParameterError: A parameter that is not a positive number.
    """

    cutoff: float
    dt: float

    def __post_init__(self) -> None:
        positive_number("cutoff", self.cutoff, "corner frequency in Hz")
        positive_number("dt", self.dt, "control period in seconds")

    @property
    def delay(self) -> float:
        """Delay of slow signals [s]: 1/ω, minus about half a period, by the sampling."""
        pole = self._pole()
        return self.dt * pole / (1.0 - pole)

    def response(self, frequency: ArrayLike) -> Any:
        """Return the complex gain at frequencies in Hz, of their shape.

        Args:
            frequency: Frequencies, below half of the sampling rate [Hz].
        """
        turn = np.exp(-2j * np.pi * np.asarray(frequency, dtype=np.float64) * self.dt)
        pole = self._pole()
        return (1.0 - pole) / (1.0 - pole * turn)

    def phase_loss(self, frequency: ArrayLike) -> Array:
        """Return how far the output lags behind the input at frequencies in Hz [rad], of their shape.

        Args:
            frequency: Frequencies, below half of the sampling rate [Hz].
        """
        return np.asarray(-np.angle(self.response(frequency)), dtype=np.float64)

    def init(self) -> Array | None:
        """Return the state before the first tick: no input seen."""
        return None

    def step(
        self, state: Array | None, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, Array]:
        """Return the filtered tau_ext; see `Sensor.step`."""
        del q, v, tau
        y = self.smooth(state, tau_ext)
        return y, y

    def smooth(self, state: Array | None, x: Array) -> Array:
        """Return the output at this tick, which is also the next state.

        Args:
            state: Output of the tick before, or None at the first.
            x: Input at this tick, of any shape.
        """
        if state is None:
            return x.copy()
        smoothed: Array = state + (1.0 - self._pole()) * (x - state)
        return smoothed

    def _pole(self) -> float:
        return float(np.exp(-2.0 * np.pi * self.cutoff * self.dt))


class Chain:
    """Sensors in series: the output of each is the input of the next.

    Args:
        *sensors: The first one is nearest to the arm.
    """

    def __init__(self, *sensors: Sensor[Any]) -> None:
        self.sensors = sensors

    def __repr__(self) -> str:
        return f"Chain({', '.join(map(repr, self.sensors))})"

    def init(self) -> tuple[Any, ...]:
        """Return the states before the first tick."""
        return tuple(sensor.init() for sensor in self.sensors)

    def step(
        self, state: tuple[Any, ...], q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, tuple[Any, ...]]:
        """Return the output of the last sensor; see `Sensor.step`."""
        following = []
        for sensor, own in zip(self.sensors, state, strict=True):
            tau_ext, own_next = sensor.step(own, q, v, tau, tau_ext)
            following.append(own_next)
        return tau_ext, tuple(following)
