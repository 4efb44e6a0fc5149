"""Notes on stderr before a run or a search for gains: what makes their figures worth less than they look."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import scipy.linalg

from ..robot.arm_model import ArmModel
from ..tuning.remedies import KNOWN_ARMATURE
from .terminal import say

LARGEST_FACTOR = 30.0
"""By which a payload may change an arm's inertia; sampled gains tolerate about 4 times more or less than the model."""

_FINGERS = re.compile(r"finger|gripper|knuckle|jaw|thumb", re.IGNORECASE)
_GRAVE = ("NO GRAVITY", "the tool frame")


def say_grave_notes(arm: ArmModel) -> None:
    """Print the notes on an arm that matter for its control."""
    for note in (*(n for n in arm.notes if n.startswith(_GRAVE)), *_on_fingers(arm)):
        say(f"note: {note}")


def say_whether_rotors_lack(arm: ArmModel, heaviest: ArmModel) -> bool:
    """Return, and note, whether a payload changes the inertia of an arm without rotors so much that few gains do.

    Args:
        arm: The arm as its description says.
        heaviest: The arm with the largest payload.
    """
    if arm.armature.any():
        return False
    before, after = arm.mass_matrix(arm.ready), heaviest.mass_matrix(arm.ready)
    factors, directions = scipy.linalg.eigh(after, before)
    lacking = bool(factors[-1] > LARGEST_FACTOR)
    if lacking:
        name = arm.joint_names[
            int(np.argmax(np.abs(directions[:, -1] * (after @ directions[:, -1]))))
        ]
        say(
            f"note: the payload makes the inertia at joint '{name}' {factors[-1]:.0f} times as large, because the "
            f"description gives no rotor inertia; if the joints are geared, give it: --armature {KNOWN_ARMATURE:g} for "
            "example"
        )
    return lacking


def _on_fingers(arm: ArmModel) -> Iterator[str]:
    """Say that joints of a gripper are controlled, and where a payload is."""
    fingers = [name for name in arm.joint_names if _FINGERS.search(name)]
    if not fingers or len(fingers) == arm.nv:
        return
    locks = " ".join(f"--lock {name}" for name in fingers)
    few = ", ".join(fingers[:3]) + (", ..." if len(fingers) > 3 else "")
    yield (
        f"joints of a gripper are controlled with the arm ({few}), and a payload is in its frame "
        f"'{arm.tool_frame}', where it loads the gripper's drive as well; to control the arm alone, with the payload "
        f"in its hand: {locks}"
    )
