"""The linear laws that users have, around the impedance reference, and the grids over which they are tuned."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

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

    def _law(self, tick: Tracking) -> BaselineTorque:
        dynamics, omega, zero = self.arm.raw_dynamics, self.bandwidth, np.zeros_like(tick.v)
        m = 1.0 / np.diag(dynamics.inverse_mass_matrix(tick.q))
        u = omega * omega * tick.e1 + 2.0 * omega * tick.e2
        tau = dynamics.bias(tick.q, zero) + m * u - tick.tau_ext
        return BaselineTorque(tau, zero, u)


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


class Candidate(NamedTuple):
    """A law with its settings in words."""

    words: str
    controller: Callable[[rbi.ArmModel, rbi.Hardware], Any]


def _pd() -> Iterator[Candidate]:
    for omega, low in product((12.0, 20.0, 40.0, 80.0), (30.0, 80.0, 400.0)):
        yield Candidate(
            f"ω = {omega:g}, low-pass {low:g}",
            lambda arm, hw, w=omega, f=low: _counted(PDAroundReference(arm, w), hw, f),
        )


def _integral() -> Iterator[Candidate]:
    for omega, low in product((8.0, 12.0, 20.0, 50.0), (40.0, 120.0, 400.0)):
        yield Candidate(
            f"p = {omega:g}, low-pass {low:g}",
            lambda arm, hw, w=omega, f=low: _counted(
                rbi.baselines.PIDImpedance(arm, TARGET, w, DT), hw, f
            ),
        )


def _disturbance() -> Iterator[Candidate]:
    for omega, low, observer in (*product((8.0, 12.0, 20.0), (40.0, 120.0), (8.0, 20.0)),):
        yield Candidate(
            f"ω = {omega:g}, low-pass {low:g}, observer {observer:g}",
            lambda arm, hw, w=omega, f=low, o=observer: _counted(ObserverPD(arm, w, o), hw, f),
        )


def _integral_observed() -> Iterator[Candidate]:
    for omega, ratio in product((10.0, 15.0, 25.0, 40.0, 60.0, 100.0), (1.0, 2.0)):
        yield Candidate(
            f"p = {omega:g}, observer {ratio * omega:g}",
            lambda arm, hw, w=omega, r=ratio: _observed(
                rbi.baselines.PIDImpedance(arm, TARGET, w, DT), hw, r * w
            ),
        )


GRIDS = {
    "PD + gravity, differences": tuple(_pd()),
    "computed torque + integral, differences": tuple(_integral()),
    "computed torque + momentum observer, differences": tuple(_disturbance()),
    "computed torque + integral, our observer": tuple(_integral_observed()),
}
"""Twelve settings of each law."""
