"""The linear laws that users have, around the impedance reference, and where the search for their settings begins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np

import rbimpedance as rbi
from rbimpedance.control.baseline_law import (
    Baseline,
    BaselineState,
    BaselineTorque,
    MemorylessBaseline,
    baseline_output,
)
from rbimpedance.control.errors import Tracking, track
from rbimpedance.control.observed import ObservedController
from rbimpedance.control.protocol import Measured, checked_period
from rbimpedance.control.telemetry import ControllerOutput
from rbimpedance.interaction.estimators import MomentumState

Array = np.ndarray[Any, np.dtype[np.float64]]
TARGET = rbi.Impedance(1.0, 10.0, 20.0)
DT = 1e-3


@dataclass(frozen=True, eq=False, init=False)
class PDAroundReference(MemorylessBaseline):
    """PD with gravity compensation around q_r, with the effective inertia of every joint as its unit."""

    bandwidth: float

    def __init__(self, arm: rbi.ArmModel, bandwidth: float) -> None:
        super().__init__(arm, TARGET, DT)
        object.__setattr__(self, "bandwidth", bandwidth)

    def _law(self, tick: Tracking, integral: Array | None = None) -> tuple[BaselineTorque, Array]:
        del integral
        dynamics, omega, zero = self.arm.raw_dynamics, self.bandwidth, np.zeros_like(tick.v)
        m = 1.0 / np.diag(dynamics.inverse_mass_matrix(tick.q))
        u = omega * omega * tick.e1 + 2.0 * omega * tick.e2
        tau = dynamics.bias(tick.q, zero) + m * u - tick.tau_ext
        return BaselineTorque(tau, zero, u), zero


class ObserverPDState(NamedTuple):
    """Impedance filter, momentum observer and the torque of the tick before."""

    filter: BaselineState
    observer: MomentumState
    tau: Array


@dataclass(frozen=True, eq=False, init=False)
class ObserverPD(Baseline[ObserverPDState]):
    """Computed torque with a PD around q_r, and a momentum observer for what the model misses."""

    bandwidth: float
    observer: rbi.MomentumObserver

    def __init__(self, arm: rbi.ArmModel, bandwidth: float, observer: float) -> None:
        super().__init__(arm, TARGET, DT)
        object.__setattr__(self, "bandwidth", bandwidth)
        object.__setattr__(self, "observer", rbi.MomentumObserver(arm, observer, DT))

    def init(self) -> ObserverPDState:
        """Return the state before the first tick."""
        return ObserverPDState(self._filter_at_rest(), self.observer.init(), np.zeros(self.arm.nv))

    def _step(
        self, state: ObserverPDState, given: Measured
    ) -> tuple[ControllerOutput, ObserverPDState]:
        tick = track(self.arm, self._filter, state.filter.q_e, state.filter.v_e, given)
        before = state.tau + tick.tau_ext
        missed, observer = self.observer.step(
            state.observer, tick.q, tick.v, before, np.zeros(self.arm.nv)
        )
        omega = self.bandwidth
        u = omega * omega * tick.e1 + 2.0 * omega * tick.e2
        tau = self.arm.raw_dynamics.inverse_dynamics(tick.q, tick.v, tick.a_r + u)
        tau = tau - tick.tau_ext - missed
        answer = BaselineTorque(tau, np.zeros_like(u), u)
        output = baseline_output(tick, answer, state.filter.q_e, state.filter.v_e)
        return output, ObserverPDState(
            self._filter_after(state.filter, tick.tau_ext), observer, tau
        )

    def _elapsed(self, state: ObserverPDState, period: float) -> ObserverPDState:
        period = checked_period(period, self.dt)
        return state._replace(filter=self._filter_elapsed(state.filter, period))


def _counted(law: Any, hardware: rbi.Hardware, low_pass: float) -> Any:
    """A law on counts and their differences behind a low-pass in rad/s."""
    count = hardware.count(law.arm)
    return rbi.QuantizedEncoders(law, resolution=count, bandwidth=low_pass / (2.0 * np.pi))


def _observed(law: Any, hardware: rbi.Hardware, bandwidth: float) -> Any:
    return rbi.QuantizedEncoders.for_(hardware, ObservedController(law, hardware, bandwidth))


Settings: TypeAlias = tuple[float, ...]
"""Rates in rad/s: of the loop first, then of what is filtered or observed."""


PD, INTEGRAL, DISTURBANCE, OBSERVED = range(4)
"""Kinds of laws in compiled code."""


class Law(NamedTuple):
    """A linear law and where the search for its settings begins.

    Attributes:
        kind: Its number in compiled code.
        build: Makes it from a model, the hardware and settings.
        grid: Settings that cover what encoders of 17 to 24 bits call for.
    """

    kind: int
    build: Callable[[rbi.ArmModel, rbi.Hardware, Settings], Any]
    grid: tuple[Settings, ...]


def _pd(arm: rbi.ArmModel, hardware: rbi.Hardware, at: Settings) -> Any:
    return _counted(PDAroundReference(arm, at[0]), hardware, at[1])


def _integral(arm: rbi.ArmModel, hardware: rbi.Hardware, at: Settings) -> Any:
    return _counted(rbi.baselines.PIDImpedance(arm, TARGET, at[0], DT), hardware, at[1])


def _disturbance(arm: rbi.ArmModel, hardware: rbi.Hardware, at: Settings) -> Any:
    return _counted(ObserverPD(arm, at[0], at[2]), hardware, at[1])


def _integral_observed(arm: rbi.ArmModel, hardware: rbi.Hardware, at: Settings) -> Any:
    return _observed(rbi.baselines.PIDImpedance(arm, TARGET, at[0], DT), hardware, at[1])


LOW_PASS = (12.0, 25.0, 50.0, 100.0, 200.0, 400.0)
RATIOS = (0.7, 1.0, 1.5, 2.2, 4.0)
LAWS = {
    "PD + gravity, differences": Law(
        PD, _pd, (*product((10.0, 16.0, 25.0, 40.0, 63.0), LOW_PASS),)
    ),
    "computed torque + integral, differences": Law(
        INTEGRAL, _integral, (*product((8.0, 13.0, 20.0, 32.0, 50.0), LOW_PASS),)
    ),
    "computed torque + momentum observer, differences": Law(
        DISTURBANCE,
        _disturbance,
        (*product((8.0, 13.0, 20.0, 32.0, 50.0), (12.0, 30.0, 80.0, 240.0), (8.0, 25.0)),),
    ),
    "computed torque + integral, our observer": Law(
        OBSERVED,
        _integral_observed,
        tuple((w, r * w) for w, r in product((12.0, 20.0, 33.0, 55.0, 90.0), RATIOS)),
    ),
}

FINER = (1.3, 1.2, 1.1)
"""Factors between neighbours in the three rounds of six runs that follow a grid."""


def around(best: Settings, factor: float) -> list[Settings]:
    """Return six settings around one: every rate up and down by a factor; of two rates both together, too."""
    steps = [s * row for row in np.eye(len(best)) for s in (1.0, -1.0)]
    if len(best) == 2:
        steps += [np.ones(2), -np.ones(2)]
    return [tuple((np.array(best) * factor**step).tolist()) for step in steps]
