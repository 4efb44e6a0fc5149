"""The environment in compiled form: what of it depends on time alone is sampled ahead, the rest is tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array, vector
from ..._numba.compile import routine
from ..._numba.lanes import any_of, select
from ...interaction import FrameWrench, Interaction, JointTorque, Push, Sum, Wall
from ...interaction.wrenches import Constant, Nothing, TimeFunction
from ...robot.arm_model import ArmModel
from ...robot.compiled.kinematics import (
    POSE,
    add_force,
    frame_origin,
    point_speed,
    turned_into_world,
    world_poses,
)
from ...robot.compiled.spatial import add, dot, get_pair, get_vector, scale
from ...robot.compiled.tables import ArmTables, Workspace, frame_in_joint

# Columns of `Environment.contacts`.
JOINT, KIND = 0, 1
WORLD_WRENCH, LOCAL_WRENCH, WALL = 0, 1, 2

# Columns of `Environment.walls`.
POINT, NORMAL, STIFFNESS, DAMPING = 0, 3, 6, 7
WALL_COLUMNS = 8

# Of `Environment.drive`, from 6 times the index of the contact.
DISPLACEMENT, SPEED = 0, 1
DRIVE = 6


class Environment(NamedTuple):
    """Everything that pushes on the arm.

    Attributes:
        torque: Torque on the joints themselves, one row for each time, or one for all, shape (·, nv) [N·m or N].
        contacts: Joint that carries the frame (-1: the base), and kind, of everything that acts at a frame, (m, 2).
        frames: Pose of those frames in the joints' axes, shape (m, `kinematics.POSE`).
        walls: Point, normal, stiffness and damping of the walls among them, shape (m, `WALL_COLUMNS`).
        drive: Wrench, or displacement and speed of the wall, of each; rows as in `torque`, shape (·, 6·m).
        poses: Work space: where the plant's joints are, shape (nv, `kinematics.POSE`).
    """

    torque: Array
    contacts: NDArray[np.int64]
    frames: Array
    walls: Array
    drive: Array
    poses: Array


@routine
def environment_torque(
    plant: ArmTables, space: Workspace, environment: Environment, row: int, v: Array, torque: Array
) -> None:
    """Write tau_ext.

    Args:
        plant: The arm that is pushed.
        space: Work space after `place_joints`.
        environment: What pushes.
        row: Which time it is.
        v: Velocity, shape (nv,).
        torque: Where it goes, shape (nv,).
    """
    own = min(row, len(environment.torque) - 1)
    for j in range(len(torque)):
        torque[j] = environment.torque[own, j]
    if len(environment.contacts) == 0:
        return
    world_poses(plant, space, environment.poses)
    row = min(row, len(environment.drive) - 1)
    for i in range(len(environment.contacts)):
        if environment.contacts[i, JOINT] >= 0:
            if environment.contacts[i, KIND] == WALL:
                _add_wall(plant, environment, i, row, v, torque)
            else:
                _add_wrench(plant, environment, i, row, torque)


@routine
def _add_wrench(
    plant: ArmTables, environment: Environment, i: int, row: int, torque: Array
) -> None:
    """Jᵀ·w(t); see `FrameWrench`."""
    poses, frames, joint = environment.poses, environment.frames, environment.contacts[i, JOINT]
    force, moment = get_pair(environment.drive, row, DRIVE * i)
    if environment.contacts[i, KIND] == LOCAL_WRENCH:
        force = turned_into_world(poses, frames, i, joint, force)
        moment = turned_into_world(poses, frames, i, joint, moment)
    point = frame_origin(poses, frames, i, joint)
    add_force(plant, poses, joint, point, (moment, force), torque)


@routine
def _add_wall(
    plant: ArmTables, environment: Environment, i: int, row: int, v: Array, torque: Array
) -> None:
    """Jᵀ·n·max(0, k·δ + d·δ̇) where δ > 0; see `Wall`."""
    poses, joint, walls = environment.poses, environment.contacts[i, JOINT], environment.walls
    x, n = frame_origin(poses, environment.frames, i, joint), get_vector(walls, i, NORMAL)
    travel = environment.drive[row, DRIVE * i + DISPLACEMENT]
    depth = dot(n, add(get_vector(walls, i, POINT), scale(-1.0, x))) + travel
    if not any_of(depth > 0.0):
        return
    rate = environment.drive[row, DRIVE * i + SPEED] - point_speed(plant, poses, joint, x, n, v)
    push = max(0.0, walls[i, STIFFNESS] * depth + walls[i, DAMPING] * rate)
    push = select(depth > 0.0, push, 0.0)
    add_force(plant, poses, joint, x, ((0.0, 0.0, 0.0), scale(push, n)), torque)


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
            joint, self._frames[i] = frame_in_joint(plant, part.frame)
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

    @property
    def contacts(self) -> NDArray[np.int64]:
        """See `Environment.contacts`."""
        return self._contacts

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


def acts_at_frames(interaction: Interaction) -> bool:
    """Whether anything of an interaction that `can_sample` acts at a frame, so that its kinematics are needed."""
    return any(type(part) is not JointTorque for part in _parts(interaction))


def _parts(interaction: Interaction) -> list[Any]:
    if type(interaction) is Sum:
        return [inner for part in interaction.parts for inner in _parts(part)]
    return [] if type(interaction) is Nothing else [interaction]


def _kind(part: FrameWrench | Push | Wall) -> int:
    if isinstance(part, Wall):
        return WALL
    return LOCAL_WRENCH if part.expressed_in == "local" else WORLD_WRENCH


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
