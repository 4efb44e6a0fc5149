"""What is worth saying about a model: limits that are missing, links without mass, rotors that an SRDF file knows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from .full_robot import FullRobot
from .wording import listed

ON_THE_AXIS = 1e-6
"""A tool frame nearer to the origin of a turning joint lies on that joint's axis [m]."""


def model_notes(
    robot: FullRobot, model: pin.Model, tool_frame: str, massless: Sequence[str]
) -> tuple[str, ...]:
    """Return what is worth saying, the gravest first.

    Args:
        robot: The robot before anything was frozen.
        model: Its model in which what is locked is frozen.
        tool_frame: Name of the tool frame.
        massless: Names of the joints that move no mass.
    """
    return (
        *_mass_notes(massless),
        *_tool_notes(model, tool_frame),
        *robot.notes,
        *_follower_notes(robot),
        *_limit_notes(model),
        *_rotor_notes(model, robot.rotors),
    )


def _mass_notes(massless: Sequence[str]) -> Iterator[str]:
    """Say which joints move no mass."""
    if massless:
        yield (
            f"NO GRAVITY: the links that {listed(massless)} move have no mass in this model; the torque that supports "
            "them is taken as 0, and the real links will fall"
        )


def _tool_notes(model: pin.Model, tool_frame: str) -> Iterator[str]:
    """Say that the tool frame is the origin of a turning joint, so that a payload there does not load the joint."""
    frames = [f for f in model.frames if f.name == tool_frame and f.type != pin.FrameType.JOINT]
    joint = frames[0].parentJoint if frames else 0
    turns = joint and not model.joints[joint].shortname().startswith("JointModelP")
    if turns and np.linalg.norm(frames[0].placement.translation) <= ON_THE_AXIS:
        yield (
            f"the tool frame '{tool_frame}' lies on the axis of joint '{model.names[joint]}', which a payload there "
            "does not load: add a link at the tip, name another frame with tool_frame=, or give the payload a centre "
            "of mass"
        )


def _follower_notes(robot: FullRobot) -> Iterator[str]:
    """Say which joints are frozen although what they follow moves."""
    following = [name for name, leader in robot.follows.items() if leader not in robot.locked]
    if frozen := sorted(robot.locked.intersection(following)):
        yield f"frozen by lock=, although what they follow moves: {listed(frozen)}; in the real robot they move too"


def _limit_notes(model: pin.Model) -> Iterator[str]:
    """Say which limits are taken as not given and which position ranges are empty."""
    joints = list(zip(model.names, model.joints, strict=True))[1:]
    joints = [(name, joint) for name, joint in joints if joint.nv == 1]
    for kind, limit in (("effort", model.upperEffortLimit), ("velocity", model.upperVelocityLimit)):
        if zero := [name for name, joint in joints if not 0.0 < limit[joint.idx_v] < np.inf]:
            yield f"the {kind} limit is 0 or missing, taken as not given, at {listed(zero)}"
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    empty = [n for n, j in joints if j.nq == 1 and lower[j.idx_q] == upper[j.idx_q]]
    if empty:
        yield f"the lower position limit equals the upper one at {listed(empty)}"


def _rotor_notes(model: pin.Model, srdf: Path | None) -> Iterator[str]:
    """Say what reflected inertia an SRDF file next to the URDF gives."""
    if srdf is not None:
        rotors = pin.Model(model)
        pin.loadRotorParameters(rotors, str(srdf), False)
        armature = np.array(rotors.rotorInertia) * np.array(rotors.rotorGearRatio) ** 2
        if armature.any():
            yield (
                "its SRDF gives reflected rotor inertia, not applied here; to do so: "
                f"armature={armature.tolist()}"
            )
