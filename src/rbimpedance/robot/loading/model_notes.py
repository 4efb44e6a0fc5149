"""What is worth saying about a model: limits that are missing, links without mass, rotors that an SRDF file knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

from .full_robot import FullRobot
from .soundness import massless_joints
from .urdf_document import listed

ON_THE_AXIS = 1e-6
"""A tool frame nearer to the origin of a turning joint lies on that joint's axis [m]."""


def model_notes(robot: FullRobot, model: pin.Model, tool_frame: str) -> tuple[str, ...]:
    """Return what is worth saying, the gravest first.

    Args:
        robot: The robot before anything was frozen.
        model: Its model in which what is locked is frozen.
        tool_frame: Name of the tool frame.
    """
    return (
        *_mass_notes(model),
        *_tool_notes(model, tool_frame),
        *robot.notes,
        *_follower_notes(robot),
        *_limit_notes(model),
        *_rotor_notes(model, robot.rotors),
    )


def _mass_notes(model: pin.Model) -> tuple[str, ...]:
    """Say which joints move no mass."""
    names = massless_joints(model)
    if not names:
        return ()
    return (
        f"NO GRAVITY: the links that {listed(names)} move have no mass in this model; the torque that supports them is "
        "taken as 0, and the real links will fall",
    )


def _tool_notes(model: pin.Model, tool_frame: str) -> tuple[str, ...]:
    """Say that the tool frame is the origin of a turning joint, so that a payload there does not load the joint."""
    frames = [f for f in model.frames if f.name == tool_frame and f.type != pin.FrameType.JOINT]
    if not frames or frames[0].parentJoint == 0:
        return ()
    joint, offset = frames[0].parentJoint, frames[0].placement.translation
    slides = model.joints[joint].shortname().startswith("JointModelP")
    if slides or np.linalg.norm(offset) > ON_THE_AXIS:
        return ()
    return (
        f"the tool frame '{tool_frame}' lies on the axis of joint '{model.names[joint]}', which a payload there does "
        "not load: add a link at the tip, name another frame with tool_frame=, or give the payload a centre of mass",
    )


def _follower_notes(robot: FullRobot) -> tuple[str, ...]:
    """Say which joints are frozen although what they follow moves."""
    frozen = [name for name, leader in robot.follows.items() if leader not in robot.locked]
    if not (frozen := sorted(robot.locked.intersection(frozen))):
        return ()
    return (
        f"frozen by lock=, although what they follow moves: {listed(frozen)}; in the real robot they move too",
    )


def _limit_notes(model: pin.Model) -> tuple[str, ...]:
    """Say which limits are taken as not given and which position ranges are empty."""
    joints = {
        name: joint
        for name, joint in zip(model.names[1:], model.joints[1:], strict=True)
        if joint.nv == 1
    }
    notes = []
    for kind, limit in (("effort", model.upperEffortLimit), ("velocity", model.upperVelocityLimit)):
        if zero := [
            name for name, joint in joints.items() if not 0.0 < limit[joint.idx_v] < np.inf
        ]:
            notes.append(f"the {kind} limit is 0 or missing, taken as not given, at {listed(zero)}")
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    if empty := [
        n
        for n, joint in joints.items()
        if joint.nq == 1 and lower[joint.idx_q] == upper[joint.idx_q]
    ]:
        notes.append(f"the lower position limit equals the upper one at {listed(empty)}")
    return tuple(notes)


def _rotor_notes(model: pin.Model, srdf: Path | None) -> tuple[str, ...]:
    """Say what reflected inertia an SRDF file next to the URDF gives."""
    if srdf is None:
        return ()
    rotors = pin.Model(model)
    pin.loadRotorParameters(rotors, str(srdf), False)
    armature = np.array(rotors.rotorInertia) * np.array(rotors.rotorGearRatio) ** 2
    if not armature.any():
        return ()
    return (
        f"its SRDF gives reflected rotor inertia, not applied here; to do so: armature={armature.tolist()}",
    )
