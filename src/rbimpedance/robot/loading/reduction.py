"""What is locked, is frozen; what cannot be controlled, is refused."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin

from ..._common.arrays import Array
from ...exceptions import ModelError, UnsupportedJointError
from .full_robot import FullRobot

MAX_DOF = 200
"""Most joints that move in a loaded robot: Pinocchio's data grow with their third power (0.5 GB at 200)."""


def reduced(robot: FullRobot) -> pin.Model:
    """Return the model in which what is locked is frozen.

    Args:
        robot: The full robot.

    Raises:
        ModelError: A position for a joint that is not locked, or too many joints are left.
        UnsupportedJointError: Joints that cannot be controlled are left.
    """
    model, q = robot.model, _locked_configuration(robot)
    if robot.locked:
        locked = [model.getJointId(name) for name in robot.locked]
        model = _frozen(model, locked, q)
    names = zip(model.names[1:], model.joints[1:], strict=True)
    if wide := [name for name, joint in names if not _is_controllable(joint)]:
        quoted = ", ".join(f'"{name}"' for name in wide)
        raise UnsupportedJointError(
            wide,
            "only revolute, continuous and prismatic joints are controlled; "
            f"freeze with lock=({quoted},)",
        )
    if (moving := model.nv + len(model.mimicking_joints)) > MAX_DOF:
        raise ModelError(f"{moving} joints move; at most {MAX_DOF} may: lock some with lock=(...)")
    return model


def _locked_configuration(robot: FullRobot) -> Array:
    """Where the locked joints are frozen: as given, else neutral and inside the limits."""
    model = robot.model
    q: Array = np.clip(pin.neutral(model), model.lowerPositionLimit, model.upperPositionLimit)
    for name, value in robot.values.items():
        if name not in robot.locked:
            raise ModelError(
                f"locked_configuration gives a position for '{name}', which is not locked"
            )
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise ModelError(f"locked_configuration: '{name}' has {joint.nv} degrees of freedom")
        place = slice(joint.idx_q, joint.idx_q + joint.nq)
        q[place] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
    return q


def _frozen(full: pin.Model, locked: list[int], q: Array) -> pin.Model:
    """`pin.buildReducedModel` (4.1), which takes no two frames of one name, such as a link's and a joint's."""
    shared = {name for name, count in Counter(f.name for f in full.frames).items() if count > 1}
    distinct, names = pin.Model(full), {}
    for i, frame in enumerate(full.frames):
        if frame.name in shared and frame.type != pin.FrameType.JOINT:
            distinct.frames[i].name = f"{i}\N{NULL}{frame.name}"
            names[distinct.frames[i].name] = frame.name
    model = pin.buildReducedModel(distinct, locked, q)
    _fix_parent_frames(model, distinct)
    for frame in model.frames:
        frame.name = names.get(frame.name, frame.name)
    return model


def _fix_parent_frames(model: pin.Model, full: pin.Model) -> None:
    """Undo that `pin.buildReducedModel` (4.1) makes the frame of each locked joint its own parent."""
    for i, frame in enumerate(model.frames):
        if i > 0 and frame.parentFrame == i and full.frames[i].name == frame.name:
            model.frames[i].parentFrame = full.frames[i].parentFrame


def _is_controllable(joint: pin.JointModel) -> bool:
    kind = joint.shortname()
    return kind == "JointModelMimic" or (
        joint.nv == 1 and not kind.startswith(("JointModelH", "JointModelC"))
    )
