"""`ArmModel.ready`: a posture well inside the position limits, by the reference configurations of a Pinocchio model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from .._common.arrays import Array
from .rigid_bodies import movable_joints

READY_NAMES = ("ready", "default", "home", "half_sitting", "standing", "neutral")
"""Names of reference configurations that mean a posture to work from, the best first."""

MARGIN = 0.1
"""Least distance of `ready` from a limit, as a part of the range between both limits."""

_STEP_INSIDE = {"turns": 0.5, "slides": 0.05}
"""From a limit without another one on the far side [rad or m]."""


def ready_configuration(model: pin.Model) -> Array:
    """Return a posture well inside the limits, shape (nq,).

    That is the reference configuration of the model that is called by the first of `READY_NAMES`, or the only one that
    it has; without one, the middle of each range, and 0 where a joint has no limits. Where it lies nearer to a limit
    than `MARGIN` of the range, it is moved away from it.

    Args:
        model: A model whose joints have one degree of freedom each.
    """
    references = {str(item.key()): np.array(item.data()) for item in model.referenceConfigurations}
    name = ready_name(references)
    q = np.array(pin.neutral(model))
    for j in movable_joints(model):
        joint = model.joints[j]
        place = slice(joint.idx_q, joint.idx_q + joint.nq)
        given = None if name is None else references[name][place]
        if joint.nq == 2:
            q[place] = _direction(given)
            continue
        lower = float(model.lowerPositionLimit[joint.idx_q])
        upper = float(model.upperPositionLimit[joint.idx_q])
        kind = "slides" if joint.shortname().startswith("JointModelP") else "turns"
        x = None if given is None else float(given[0])
        q[place] = _inside(x, lower, upper, _STEP_INSIDE[kind])
    return q


def ready_name(names: Iterable[str], preferred: str | None = None) -> str | None:
    """Return the name that means a posture to work from; None where there is none.

    Args:
        names: Names of reference configurations.
        preferred: What the source itself calls its reference.
    """
    there = list(names)
    wanted = ((preferred,) if preferred else ()) + READY_NAMES
    found = [name for want in wanted for name in there if name.lower() == want]
    return next(iter(found), there[0] if len(there) == 1 else None)


def set_ready(model: pin.Model, positions: Mapping[str, float]) -> None:
    """Give a model the reference configuration "ready"; joints without a position are put where they have room.

    Args:
        model: The model; changed in place.
        positions: Positions by joint [rad or m].
    """
    q = ready_configuration(model)
    for j in movable_joints(model):
        joint, name = model.joints[j], str(model.names[j])
        if name in positions:
            place, x = slice(joint.idx_q, joint.idx_q + joint.nq), positions[name]
            q[place] = (math.cos(x), math.sin(x)) if joint.nq == 2 else x
    model.referenceConfigurations[READY_NAMES[0]] = q


def _direction(given: Array | None) -> tuple[float, float]:
    """The (cos, sin) of a continuous joint."""
    if given is None or not 1e-3 < (length := math.hypot(*given)) < math.inf:
        return 1.0, 0.0
    return float(given[0] / length), float(given[1] / length)


def _inside(x: float | None, lower: float, upper: float, step: float) -> float:
    """A position between the limits with room to both; the middle where none is given."""
    far = 1e4
    has_lower, has_upper = lower > -far, upper < far
    if has_lower and has_upper:
        middle, room = (lower + upper) / 2.0, (0.5 - MARGIN) * (upper - lower)
        return middle if x is None else min(max(x, middle - room), middle + room)
    x = 0.0 if x is None else x
    if has_lower:
        return max(x, lower + step)
    return min(x, upper - step) if has_upper else x
