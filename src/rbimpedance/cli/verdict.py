"""Whether a run was a good one: what it must not do, and the words where it did."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._common.arrays import Array
from ..robot.arm_model import ArmModel
from ..simulation.result import SimulationResult

LARGE = 0.1
"""Error e1 in the last fifth of a run from which on the arm counts as lost [rad or m]."""

GROWING = 2.0
"""Ratio of the errors in the last and in the middle fifth from which on they grow."""

SMALL = 1e-2
"""Error that may grow: it has not been seen to be lost [rad or m]."""

_ROUNDING = 1e-6


def failures(result: SimulationResult, arm: ArmModel) -> tuple[str, ...]:
    """Return what is wrong with a run, in words; empty for a good run.

    Args:
        result: The run.
        arm: The arm, with the limits of its description.
    """
    checks = (_error(result), _torque(result, arm), _position(result, arm))
    return tuple(words for check in checks for words in check)


def _error(result: SimulationResult) -> Iterator[str]:
    """The joint that is farthest from its reference, where that stays far or grows."""
    size, fifth = np.abs(result.e1), max(len(result.t) // 5, 1)
    late, middle = size[-fifth:].max(axis=0), size[2 * fifth : 3 * fifth + 1].max(axis=0)
    grows = (late > SMALL) & (late > GROWING * middle)
    lost = grows | (late > LARGE)
    if lost.any():
        joint = int(np.argmax(np.where(lost, late, 0.0)))
        how = "and moves away" if grows[joint] else "and stays there"
        name = result.joint_names[joint]
        yield f"joint '{name}' is {late[joint]:.3g} rad or m off its reference {how}"


def _torque(result: SimulationResult, arm: ArmModel) -> Iterator[str]:
    """The joint whose torque passes its effort limit by the most."""
    peak = np.abs(result.tau).max(axis=0)
    joint = _worst(peak / arm.effort_limit, 1.0 + _ROUNDING)
    if joint is not None:
        limit = arm.effort_limit[joint]
        yield (
            f"joint '{arm.joint_names[joint]}' needs a torque of {peak[joint]:.3g}, and its effort limit is {limit:.3g}"
        )


def _position(result: SimulationResult, arm: ArmModel) -> Iterator[str]:
    """The joint that leaves its position limits the farthest."""
    lower, upper = arm.joint_limits()
    at = np.array([arm.raw_dynamics.difference(arm.zero, q) for q in result.q])
    beyond = np.maximum(lower - at, at - upper).max(axis=0)
    joint = _worst(beyond, _ROUNDING)
    if joint is not None:
        limits = f"[{lower[joint]:.4g}, {upper[joint]:.4g}]"
        yield (
            f"joint '{arm.joint_names[joint]}' leaves its limits {limits} by {beyond[joint]:.3g} rad or m"
        )


def _worst(values: Array, allowed: float) -> int | None:
    joint = int(np.argmax(values))
    return joint if values[joint] > allowed else None
