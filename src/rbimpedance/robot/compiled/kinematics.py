"""Where the joints of an arm are in the world, and what a force on one of its bodies does to them."""

from __future__ import annotations

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from .rigid_body import _placement
from .spatial import (
    SpatialMotion,
    Vector,
    add,
    cross,
    dot,
    get_matrix,
    get_vector,
    product,
    put_matrix,
    put_vector,
    rotate,
    scale,
    z_axis,
)
from .tables import KIND, PARENT, PRISMATIC, ArmTables, Workspace

# Columns of a table of poses, one row a joint or a frame.
AXES, ORIGIN = 0, 9
POSE = 12


@routine
def world_poses(arm: ArmTables, space: Workspace, poses: Array) -> None:
    """Write axes and origin of every joint in the world.

    Args:
        arm: The arm.
        space: Work space after `place_joints`.
        poses: Where they go, shape (nv, `POSE`).
    """
    for j in range(len(arm.joints)):
        parent = arm.topology[j, PARENT]
        R, r = _placement(arm.joints, j, arm.topology[j, KIND] == PRISMATIC, space)
        if parent >= 0:
            R_parent = get_matrix(poses, parent, AXES)
            R = product(R_parent, R)
            r = add(get_vector(poses, parent, ORIGIN), rotate(R_parent, r))
        put_matrix(poses, j, AXES, R)
        put_vector(poses, j, ORIGIN, r)


@fused
def frame_origin(poses: Array, frames: Array, i: int, joint: int) -> Vector:
    """Origin of frame i, which a joint carries, in the world."""
    offset = rotate(get_matrix(poses, joint, AXES), get_vector(frames, i, ORIGIN))
    return add(get_vector(poses, joint, ORIGIN), offset)


@fused
def turned_into_world(poses: Array, frames: Array, i: int, joint: int, a: Vector) -> Vector:
    """A vector in the axes of frame i, which a joint carries, in those of the world."""
    return rotate(get_matrix(poses, joint, AXES), rotate(get_matrix(frames, i, AXES), a))


@fused
def joint_motion(arm: ArmTables, poses: Array, j: int, point: Vector) -> SpatialMotion:
    """How a body turns, and moves at a point, at unit speed of joint j before it: a column of its Jacobian."""
    z, origin = z_axis(get_matrix(poses, j, AXES)), get_vector(poses, j, ORIGIN)
    if arm.topology[j, KIND] == PRISMATIC:
        return (0.0, 0.0, 0.0), z
    return z, cross(z, add(point, scale(-1.0, origin)))


@routine
def add_force(
    arm: ArmTables, poses: Array, joint: int, point: Vector, force: SpatialMotion, torque: Array
) -> None:
    """Add the joint torque Jᵀ·(n, f) of a moment and a force at a point of the body that a joint carries.

    Args:
        arm: The arm.
        poses: After `world_poses`.
        joint: The joint; -1 is the base.
        point: Where the force acts, in the world.
        force: Moment and force in world axes.
        torque: What it is added to, shape (nv,).
    """
    while joint >= 0:
        motion = joint_motion(arm, poses, joint, point)
        torque[joint] += dot(motion[0], force[0]) + dot(motion[1], force[1])
        joint = arm.topology[joint, PARENT]


@routine
def point_speed(
    arm: ArmTables, poses: Array, joint: int, point: Vector, direction: Vector, v: Array
) -> float:
    """How fast a point of the body that a joint carries moves along a direction: nᵀ·J·v."""
    speed = 0.0
    while joint >= 0:
        motion = joint_motion(arm, poses, joint, point)
        speed += dot(motion[1], direction) * v[joint]
        joint = arm.topology[joint, PARENT]
    return speed
