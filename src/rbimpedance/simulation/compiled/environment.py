"""What the environment does to the plant, inside compiled code; the meaning is that of `interaction`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import routine
from ...robot.compiled.kinematics import (
    add_force,
    frame_origin,
    point_speed,
    turned_into_world,
    world_poses,
)
from ...robot.compiled.rows import get_pair, get_vector
from ...robot.compiled.spatial import add, dot, scale
from ...robot.compiled.tables import ArmTables, Workspace

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
    if depth <= 0.0:
        return
    rate = environment.drive[row, DRIVE * i + SPEED] - point_speed(plant, poses, joint, x, n, v)
    push = max(0.0, walls[i, STIFFNESS] * depth + walls[i, DAMPING] * rate)
    add_force(plant, poses, joint, x, ((0.0, 0.0, 0.0), scale(push, n)), torque)
