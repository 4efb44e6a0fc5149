"""The six arms of the tables, their motion and their usual law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance.trajectories import Trajectory, cosine

Array = np.ndarray[Any, np.dtype[np.float64]]

ARMS = {"panda": 2.0, "ur5": 2.0, "z1": 1.0, "xarm7": 2.0, "kinova": 1.0, "talos_arm": 2.0}
"""Largest payload of each arm [kg]."""
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
LOCKED = {"panda": FINGERS, "z1": ("jointGripper",)}
GRIPPERS = {"talos_arm": ("gripper_left_joint",)}
"""Further joints that some tables lock."""
DT = 1e-3


def load(name: str, armature: float | None = None, lock: Sequence[str] = ()) -> rbi.ArmModel:
    """Return an arm without its gripper's joints."""
    return rbi.load_robot(name, lock=(*LOCKED.get(name, ()), *lock), armature=armature)


def motion(arm: rbi.ArmModel, period: float = 6.0) -> Trajectory:
    """All joints swing by 0.2 rad about neutral; the arm starts at neutral, 0.2 rad off."""
    return cosine(arm, amplitude=0.2, period=period)


def law(
    arm: rbi.ArmModel,
    reaching: rbi.SuperTwisting,
    impedance: rbi.Impedance | None = None,
    **more: Any,
) -> rbi.ImpedanceController:
    """Return the usual law: fast terminal surface, period `DT`, impedance (1, 10, 20) unless another is given."""
    surface = rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6)
    return rbi.ImpedanceController(
        arm, impedance or rbi.Impedance(1.0, 10.0, 20.0), surface, reaching, DT, **more
    )
