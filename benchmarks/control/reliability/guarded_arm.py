"""The arms of the tables, their law and their guard."""

from __future__ import annotations

from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks import arms
from benchmarks.arms import Array
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.guards.faults import OperatingRange

PEAK_RATE = 1000.0  # N·m/s
CENTERS = {
    "kinova": (1.0, 0.0, 2.6, 1.3, 1.0, 0.0, 1.5, 1.0, 0.0),
    "panda": (0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.5),
    "ur5": (0.0, -1.2, 1.5, -1.8, -1.5, 0.0),
}


def load(name: str) -> tuple[rbi.ArmModel, Array]:
    """Return an arm and the configuration that it moves about."""
    arm = arms.load(name, armature=0.1)
    return arm, np.array(CENTERS[name])


def law(arm: rbi.ArmModel, share: float = 1.0, stiffness: float = 100.0) -> rbi.ImpedanceController:
    """Return the controller of the table, with a share of the arm's effort limits."""
    limits = rbi.Limits(share * arm.effort_limit, PEAK_RATE)
    impedance = rbi.Impedance(1.0, 20.0, stiffness)
    return arms.law(arm, rbi.SuperTwisting(15.0, 50.0), impedance, limits=limits)


def guarded(controller: Any) -> FaultGuard:
    """Return the guard of the table."""
    arm = controller.arm
    return FaultGuard(controller, "hold", range=OperatingRange(arm, acceleration=200.0))
