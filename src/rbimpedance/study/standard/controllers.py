"""The ten controllers of the standard study.

All are made from the same knowledge: the model with the payload that the proposal puts into it, the proposal's bounds
for the rest, and the period. The sliding modes and Slotine-Li get what these bounds allow: a gain that exceeds the
largest disturbance, and a bandwidth at which a first-order loop keeps a phase margin of about 50° behind the largest
delay and the highest input gain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from ..._common.arrays import Array
from ...control.baselines import (
    ComputedTorqueImpedance,
    FirstOrderSlidingMode,
    PDGravity,
    PDPlus,
    SlotineLi,
    Smoothing,
)
from ...control.controller import ImpedanceController
from ...control.pid import PIDImpedance
from ...control.protocol import Controller
from ...law.super_twisting import SuperTwisting
from ...law.surfaces import PowerSurface
from ..definition import Task
from .arms import DELAY

PHASE_LAG = 0.5
"""Of the baselines' inner loop at its bandwidth, from delay alone [rad]."""

RATE_RATIO = 4.0
"""Bandwidth of that loop over the rate of the surface that it holds."""

HEADROOM = 1.5
"""Gain of the first-order sliding modes over the largest disturbance."""


class FirstOrderGains(NamedTuple):
    """What the proposal's bounds allow a first-order sliding mode.

    Attributes:
        rate: Of the surface, λ [1/s].
        bandwidth: Of the loop that holds it [rad/s].
        gain: k, shape (nv,) [rad/s²].
    """

    rate: float
    bandwidth: float
    gain: Array


def first_order_gains(task: Task) -> FirstOrderGains:
    """Return the gains of the baselines that hold a sliding variable."""
    mismatch = task.known.mismatch
    bandwidth = PHASE_LAG / (mismatch.gain_high * (DELAY + 1) * task.dt)
    return FirstOrderGains(
        bandwidth / RATE_RATIO, bandwidth, HEADROOM * mismatch.disturbance / mismatch.gain_low
    )


def super_twisting_terminal(task: Task) -> ImpedanceController:
    """Return what the library proposes."""
    return task.known.controller(task.impedance)


def papers_law(task: Task) -> ImpedanceController:
    """Return the paper's law with the paper's gains, as sampled, with the whole model."""
    return _power(task, SuperTwisting(k1=8.0, k2=10.0, scheme="explicit"))


def papers_law_with_proposed_gains(task: Task) -> ImpedanceController:
    """Return the paper's law with the gains that the library proposes."""
    return _power(task, SuperTwisting(task.known.k1, task.known.k2, scheme="explicit"))


def computed_torque(task: Task) -> ComputedTorqueImpedance:
    """Return impedance control by inverse dynamics."""
    return ComputedTorqueImpedance(task.model, task.impedance, task.dt)


def pd_gravity(task: Task) -> PDGravity:
    """Return joint stiffness with gravity compensation."""
    return PDGravity(task.model, task.impedance, task.dt)


def pd_plus(task: Task) -> PDPlus:
    """Return the same with feed-forward of the desired motion."""
    return PDPlus(task.model, task.impedance, task.dt)


def sign(task: Task) -> FirstOrderSlidingMode:
    """Return the first-order sliding mode that switches."""
    return _first_order(task, "sign")


def boundary_layer(task: Task) -> FirstOrderSlidingMode:
    """Return the first-order sliding mode with the thinnest layer that its bandwidth allows."""
    return _first_order(task, "boundary-layer")


def dead_zone(task: Task) -> FirstOrderSlidingMode:
    """Return the first-order sliding mode that rests within the same width."""
    return _first_order(task, "dead-zone")


def slotine_li(task: Task) -> SlotineLi:
    """Return the passivity-based law, its gain the bandwidth times the smallest effective inertia of each joint."""
    rate, bandwidth, _ = first_order_gains(task)
    gain = bandwidth * task.known.mismatch.inertia
    return SlotineLi(task.model, task.impedance, rate, gain, task.dt)


CONTROLLERS: Mapping[str, Callable[[Task], Controller[Any]]] = MappingProxyType(
    {
        "super-twisting terminal": super_twisting_terminal,
        "paper's law": papers_law,
        "paper's law, proposed gains": papers_law_with_proposed_gains,
        "computed torque": computed_torque,
        "PD, gravity": pd_gravity,
        "PD+": pd_plus,
        "sliding, sign": sign,
        "sliding, boundary layer": boundary_layer,
        "sliding, dead zone": dead_zone,
        "Slotine-Li": slotine_li,
    }
)
"""By name; the first one is what the others are compared with."""


def pid(task: Task, bandwidth: float) -> PIDImpedance:
    """Return inverse dynamics with a PID around the reference, its three poles at a bandwidth [rad/s]."""
    return PIDImpedance(task.model, task.impedance, bandwidth, task.dt)


PID_POLES = (40, 100, 200)
"""Of the PIDs [rad/s], whatever the bounds are; behind two ticks of delay the first has about 45° of phase margin."""

WITH_AN_INTEGRAL: Mapping[str, Callable[[Task], Controller[Any]]] = MappingProxyType(
    {
        "super-twisting terminal": super_twisting_terminal,
        **{f"PID, poles {p}": partial(pid, bandwidth=float(p)) for p in PID_POLES},
    }
)
"""Our law and linear ones that also have an integral, likewise."""


def _power(task: Task, reaching: SuperTwisting) -> ImpedanceController:
    surface = PowerSurface(gamma=3.0, exponent=5.0 / 3.0)
    return ImpedanceController(task.model, task.impedance, surface, reaching, task.dt)


def _first_order(task: Task, smoothing: Smoothing) -> FirstOrderSlidingMode:
    rate, bandwidth, gain = first_order_gains(task)
    width = None if smoothing == "sign" else gain / bandwidth
    return FirstOrderSlidingMode(task.model, task.impedance, rate, gain, task.dt, smoothing, width)
