"""By how much a run leaves the limits of its arm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..robot.arm_model import ArmModel
from ..robot.rigid_bodies import movable_joints
from ..robot.units import FORCE
from .run_log import RunLog


class Excess(NamedTuple):
    """How far beyond its limit a joint is at every sample, each of shape (N, nv); negative inside, -inf without limit.

    Attributes:
        position: Beyond the nearer position limit [rad or m].
        velocity: Of the speed [rad/s or m/s].
        effort: Of the motor torque [N·m or N].
    """

    position: Array
    velocity: Array
    effort: Array


def limits_of(arm: ArmModel) -> dict[str, list[Any]]:
    """Return an arm's limits as JSON data, one entry per joint: None where there is none."""
    model = arm.raw_dynamics.model
    joints = [model.joints[j] for j in movable_joints(model)]
    lower, upper = arm.joint_limits()
    numbers = {
        "lower": lower,
        "upper": upper,
        "velocity": arm.velocity_limit,
        "effort": arm.effort_limit,
    }
    plain: dict[str, list[Any]] = {
        name: [float(x) if np.isfinite(x) else None for x in values]
        for name, values in numbers.items()
    }
    return plain | {
        "q_index": [joint.idx_q if joint.nq == 1 else None for joint in joints],
        "unit": list(arm.position_units),
    }


def excess(result: RunLog) -> Excess:
    """Return how far beyond its limits a run is.

    Args:
        result: The run; one whose provenance has no limits (a file of an earlier version) is inside everywhere.
    """
    limits: Mapping[str, Any] | None = result.provenance.get("limits")
    if limits is None:
        return Excess(*np.full((3, *result.v.shape), -np.inf))
    position = np.full(result.v.shape, -np.inf)
    for j, i in enumerate(limits["q_index"]):
        if i is not None:
            lower, upper = _number(limits["lower"][j], -np.inf), _number(limits["upper"][j], np.inf)
            position[:, j] = np.maximum(lower - result.q[:, i], result.q[:, i] - upper)
    return Excess(
        position,
        np.abs(result.v) - limit_of(result, "velocity"),
        np.abs(result.tau) - limit_of(result, "effort"),
    )


def unit_of(result: RunLog, joint: int) -> str:
    """Return "rad" or "m", as the joint turns or slides."""
    limits: Mapping[str, Any] | None = result.provenance.get("limits")
    return "rad" if limits is None else str(limits["unit"][joint])


def force_unit_of(result: RunLog, joint: int) -> str:
    """Return "N·m" or "N", as the joint turns or slides."""
    return FORCE[unit_of(result, joint)]


def limit_of(result: RunLog, name: Literal["velocity", "effort"]) -> Array:
    """Return a limit of every joint, shape (nv,); infinite where there is none, or a file does not say it."""
    limits: Mapping[str, Any] | None = result.provenance.get("limits")
    if limits is None:
        return np.full(result.v.shape[1], np.inf)
    return np.array([_number(x, np.inf) for x in limits[name]])


def _number(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
