"""The environment in compiled form: what of it depends on time alone is sampled ahead, the rest is tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array, vector
from ...interaction import FrameWrench, Interaction, JointTorque, Push, Sum, Wall
from ...interaction.wrenches import Constant, Nothing, TimeFunction
from ...robot.arm_model import ArmModel
from ...robot.compiled.kinematics import POSE
from ...robot.compiled.tables import axes_with_z_along
from .environment import DRIVE, LOCAL_WRENCH, WALL, WALL_COLUMNS, WORLD_WRENCH, Environment

Sampler = Callable[[Array], Array]
"""Maps n times to n rows, or to one row for all."""


class Drive(NamedTuple):
    """What of an environment depends on time: one row for each time, or one for all.

    Attributes:
        torque: See `Environment.torque`.
        contacts: See `Environment.drive`.
    """

    torque: Array
    contacts: Array


class EnvironmentTables:
    """An interaction in the compiled form, as far as it does not depend on time.

    Args:
        interaction: One that `can_sample`.
        plant: The arm that it pushes.

    Raises:
        ModelError: It acts at a frame that the arm does not have.
    """

    def __init__(self, interaction: Interaction, plant: ArmModel) -> None:
        parts = list(_parts(interaction))
        self._torques = [_torque(part, plant) for part in parts if type(part) is JointTorque]
        contacts = [part for part in parts if type(part) is not JointTorque]
        self._drives = [_drive(part) for part in contacts]
        self._nv = plant.nv
        self._contacts = np.zeros((len(contacts), 2), dtype=np.int64)
        self._frames = np.zeros((len(contacts), POSE))
        self._walls = np.zeros((len(contacts), WALL_COLUMNS))
        for i, part in enumerate(contacts):
            joint, self._frames[i] = _pose(plant, part.frame)
            self._contacts[i] = joint, _kind(part)
            if isinstance(part, Wall):
                self._walls[i] = *part.point, *part.normal, part.stiffness, part.damping

    def sampled(self, times: Array) -> Drive:
        """Return what depends on time, at n times; it does not depend on the arm.

        Args:
            times: The times, shape (n,) [s].

        Raises:
            DimensionError: A function of time that gives no vector of the right size.
            NonFiniteError: One that gives NaN or infinity.
        """
        torques = [sample(times) for sample in self._torques]
        torque = np.zeros((max(map(len, torques), default=1), self._nv))
        for part in torques:
            torque += part
        drives = [sample(times) for sample in self._drives]
        drive = np.zeros((max(map(len, drives), default=1), DRIVE * len(drives)))
        for i, part in enumerate(drives):
            drive[:, DRIVE * i : DRIVE * i + part.shape[1]] = part
        return Drive(torque, drive)

    def driven(self, drive: Drive) -> Environment:
        """Return what pushes on the arm."""
        poses = np.zeros((self._nv, POSE))
        return Environment(
            drive.torque, self._contacts, self._frames, self._walls, drive.contacts, poses
        )


def can_sample(interaction: Interaction) -> bool:
    """Whether an interaction has a compiled form: the library's own have, a user's own has not."""
    known = (FrameWrench, JointTorque, Push, Wall)
    return all(type(part) in known for part in _parts(interaction))


def _parts(interaction: Interaction) -> list[Any]:
    if type(interaction) is Sum:
        return [inner for part in interaction.parts for inner in _parts(part)]
    return [] if type(interaction) is Nothing else [interaction]


def _kind(part: FrameWrench | Push | Wall) -> int:
    if isinstance(part, Wall):
        return WALL
    return LOCAL_WRENCH if part.expressed_in == "local" else WORLD_WRENCH


def _pose(plant: ArmModel, frame: str | None) -> tuple[int, Array]:
    """The joint that carries a frame, -1 for the base, and the frame's pose in the joint's turned axes."""
    plant.frame_placement(plant.neutral, frame)  # refuses one that is not there
    dynamics, bodies = plant.raw_dynamics, plant.rigid_bodies()
    place = dynamics.model.frames[dynamics.frame_ids[frame or plant.tool_frame]]
    joint = int(place.parentJoint) - 1
    axes = axes_with_z_along(bodies.axis[joint]) if joint >= 0 else np.eye(3)
    rotation, origin = axes.T @ place.placement.rotation, axes.T @ place.placement.translation
    return joint, np.concatenate([rotation.ravel(), origin])


def _torque(part: JointTorque, plant: ArmModel) -> Sampler:
    return lambda times: _sampled("torque", part.function, times, plant.nv, "nv")


def _drive(part: FrameWrench | Push | Wall) -> Sampler:
    if isinstance(part, Wall):
        return part.travel
    if isinstance(part, Push):
        return lambda times: np.outer(part.share(times), part.wrench)
    return lambda times: _sampled("wrench", part.function, times, 6, "force, moment")


def _sampled(name: str, function: TimeFunction, times: Array, size: int, symbol: str) -> Array:
    """The function's values, checked; one row for a constant."""
    if isinstance(function, Constant):
        return vector(name, function.value, size, symbol)[None]
    values = [function(t) for t in times.tolist()]
    try:
        rows = np.array(values)
    except ValueError:
        rows = np.empty(0)
    is_sound = rows.shape == (len(times), size) and rows.dtype.kind in "fiu"
    if is_sound and np.isfinite(rows).all():
        return rows.astype(np.float64)
    return np.array([vector(name, value, size, symbol) for value in values])
