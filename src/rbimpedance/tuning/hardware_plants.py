"""The plants that gains for hardware are made for: as the law sees them, what is expected of them, the worst ones."""

from __future__ import annotations

import numpy as np

from ..control.estimation.friction_learning import TERMS, Expectation
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..simulation.plants.torque_loop import TorqueLoop
from .gain_design import DesignTask
from .plant_sample import PlantSample

LEAST_FRICTION = 0.5
"""Friction that a joint is prepared for where none is stated [N·m]."""

_CONSTANT = 0.15  # N·m that neither load nor friction explains
_INSIDE = 6  # plants that are simulated besides the corners of the ranges


def as_seen(arm: ArmModel, hardware: Hardware) -> ArmModel:
    """Return the arm as the law meets it: an inner torque loop makes rotors behind springs lighter, B/(1 + K_T)."""
    rotors = hardware.rotors(arm)
    if hardware.is_elastic and hardware.torque_sensor is not None:
        rotors = rotors / (1.0 + TorqueLoop.for_(hardware, arm).gain)
    return arm.with_armature(rotors)


def expectation(task: DesignTask, hardware: Hardware) -> Expectation:
    """Return friction and load in the middle of their ranges, half of which is a standard deviation."""
    unknown, nv = task.uncertainty, task.arm.nv
    mean, deviation = np.zeros((2, TERMS, nv))
    for i, (low, high) in enumerate((unknown.coulomb, unknown.viscous)):
        mean[i], deviation[i] = (low + high) / 2.0, np.maximum((high - low) / 2.0, LEAST_FRICTION)
    deviation[2] = _CONSTANT
    deviation[3:5] = np.maximum(hardware.ripple, 1e-3)
    low, high = unknown.inertia_scale
    deviation[5] = max((high - low) / 2.0, 1e-3)
    low, high = unknown.payload
    deviation[6] = max((high - low) / 2.0, 1e-3)
    return Expectation(mean, deviation)


def worst_samples(task: DesignTask, hardware: Hardware) -> list[PlantSample]:
    """Return the heaviest and the lightest plant first, with the most and the least friction, and plants between them.

    Springs are simulated in Python, and on three plants alone.
    """
    corners = len(task.uncertainty.extremes(task.arm))
    if hardware.is_elastic:
        drawn = task.uncertainty.extremes(task.arm)
        return [drawn[i] for i in sorted({0, corners // 2, corners - 1})]
    extremes = sorted({0, corners // 2, corners - 1, corners // 3, 2 * corners // 3})
    inside = range(corners, corners + _INSIDE * (corners > 1))
    drawn = task.uncertainty.sample(task.arm, corners + _INSIDE, seed=task.seed)
    return [drawn[i] for i in (*extremes, *inside)]
