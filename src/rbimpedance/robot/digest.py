"""One number for a model: equal where everything that enters dynamics and kinematics is."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from .._common.arrays import Array


def model_digest(model: pin.Model, tool_frame: str, vectors: Sequence[Array]) -> str:
    """Return the SHA-256 over everything that enters dynamics and kinematics.

    Args:
        model: The model.
        tool_frame: Name of the tool frame.
        vectors: Limits, friction and armature.
    """
    parts = [repr((list(model.names), list(model.parents), tool_frame))]
    parts += [f"{joint.shortname()} {joint.idx_q} {joint.idx_v}" for joint in model.joints]
    parts += [f"{frame.name} {frame.type} {frame.parentJoint}" for frame in model.frames]
    placements = [*model.jointPlacements, *_sample_placements(model)]
    placements += [frame.placement for frame in model.frames]
    numbers = [np.array(model.gravity.linear), *vectors]
    numbers += [np.array(placement.homogeneous) for placement in placements]
    numbers += [np.array(inertia.matrix()) for inertia in model.inertias]
    content = "\n".join(parts).encode() + b"".join(
        np.ascontiguousarray(x).tobytes() for x in numbers
    )
    return hashlib.sha256(content).hexdigest()


def _sample_placements(model: pin.Model) -> list[pin.SE3]:
    """Placements of all joints at two configurations: they distinguish joint axes and mimic rules."""
    data, q = model.createData(), pin.neutral(model)
    placements = []
    for configuration in (q, pin.integrate(model, q, np.ones(model.nv))):
        pin.forwardKinematics(model, data, configuration)
        placements += [pin.SE3(placement) for placement in data.oMi]
    return placements
