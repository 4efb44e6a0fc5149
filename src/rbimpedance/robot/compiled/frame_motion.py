"""How a frame moves with the joints: pose, Jacobian and the Jacobian's rate, in world axes at the frame's origin."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ...exceptions import ModelError
from ..arm_model import ArmModel
from ..tool_kinematics import ToolKinematics
from .dynamics import AGREEMENT, STATES
from .kinematics import AXES, ORIGIN, frame_origin, world_poses
from .spatial import (
    Matrix,
    Vector,
    add,
    cross,
    get_matrix,
    get_vector,
    product,
    put_vector,
    scale,
    subtract,
    z_axis,
)
from .tables import KIND, PARENT, PRISMATIC, ArmTables, Workspace, frame_in_joint

LINEAR, ANGULAR = 0, 3
"""Where the two parts of a joint's row in a Jacobian begin."""


@routine
def frame_motion(
    arm: ArmTables,
    space: Workspace,
    poses: Array,
    frame: Array,
    chain: NDArray[np.int64],
    v: Array,
    jacobian: Array,
    rate: Array,
) -> tuple[Matrix, Vector]:
    """Write Jacobian and its rate; return axes and origin of the frame.

    Args:
        arm: The arm.
        space: Work space after `place_joints`.
        poses: Work space for the joints in the world, shape (nv, `kinematics.POSE`).
        frame: Pose of the frame in the axes of its joint, shape (1, `kinematics.POSE`).
        chain: Joints from the base to the frame, shape (m, 1).
        v: Velocity, shape (nv,).
        jacobian: Where J goes, a row for each joint, shape (nv, 6); rows of other joints stay.
        rate: Where J̇ goes, likewise.
    """
    world_poses(arm, space, poses)
    if len(chain) == 0:
        return get_matrix(frame, 0, AXES), get_vector(frame, 0, ORIGIN)
    joint = chain[len(chain) - 1, 0]
    R = product(get_matrix(poses, joint, AXES), get_matrix(frame, 0, AXES))
    p = frame_origin(poses, frame, 0, joint)
    v_p = _chain_rates(arm, poses, chain, v, rate, p)
    for k in range(len(chain)):
        j = chain[k, 0]
        z, z_rate = z_axis(get_matrix(poses, j, AXES)), get_vector(rate, j, ANGULAR)
        if arm.topology[j, KIND] == PRISMATIC:
            put_vector(jacobian, j, LINEAR, z)
            put_vector(jacobian, j, ANGULAR, (0.0, 0.0, 0.0))
            put_vector(rate, j, LINEAR, z_rate)
            put_vector(rate, j, ANGULAR, (0.0, 0.0, 0.0))
        else:
            r = subtract(p, get_vector(poses, j, ORIGIN))
            r_rate = subtract(v_p, get_vector(rate, j, LINEAR))
            put_vector(jacobian, j, LINEAR, cross(z, r))
            put_vector(jacobian, j, ANGULAR, z)
            put_vector(rate, j, LINEAR, add(cross(z_rate, r), cross(z, r_rate)))
    return R, p


@fused
def _chain_rates(
    arm: ArmTables, poses: Array, chain: NDArray[np.int64], v: Array, rate: Array, p: Vector
) -> Vector:
    """Write velocity of every joint's origin and rate of its axis; return the velocity of the last body at p."""
    omega, at_origin, before = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(len(chain)):
        j = chain[k, 0]
        z, origin = z_axis(get_matrix(poses, j, AXES)), get_vector(poses, j, ORIGIN)
        at_origin = add(at_origin, cross(omega, subtract(origin, before)))
        put_vector(rate, j, ANGULAR, cross(omega, z))
        if arm.topology[j, KIND] == PRISMATIC:
            at_origin = add(at_origin, scale(v[j], z))
        else:
            omega = add(omega, scale(v[j], z))
        put_vector(rate, j, LINEAR, at_origin)
        before = origin
    return add(at_origin, cross(omega, subtract(p, before)))


def frame_tables(
    arm: ArmModel, frame: str | None, topology: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int64]]:
    """Return pose and chain of a frame as `frame_motion` takes them.

    Args:
        arm: The arm.
        frame: Name of the frame.
        topology: Of the arm's tables.

    Raises:
        ModelError: No such frame.
    """
    joint, pose = frame_in_joint(arm, frame)
    chain = list[int]()
    while joint >= 0:
        chain.insert(0, joint)
        joint = int(topology[joint, PARENT])
    return pose[None].copy(), np.array(chain, dtype=np.int64).reshape(-1, 1)


def check_frame_motion(
    arm: ArmModel, frame: str, computed: Callable[[Array, Array], tuple[Array, ...]]
) -> None:
    """Compare pose, Jacobian and its rate with Pinocchio's at random states.

    Args:
        arm: The arm.
        frame: Name of the frame.
        computed: Gives R, p, J and J̇ at q and v.

    Raises:
        ModelError: They differ.
    """
    kinematics, rng = ToolKinematics(arm, frame), np.random.default_rng(1)
    for _ in range(STATES):
        q, v = arm.random_configuration(rng), rng.normal(size=arm.nv)
        R, p, J, _, _ = kinematics.motion(q, v)
        truth = R, p, J, kinematics.jacobian_rate(q, v)
        for mine, theirs in zip(computed(q, v), truth, strict=True):
            difference = np.abs(mine - theirs).max() / max(np.abs(theirs).max(), 1.0)
            if not difference <= AGREEMENT:
                raise ModelError(
                    f"the compiled motion of frame '{frame}' of '{arm.name}' differs from Pinocchio's by "
                    f'{difference:.1e}, more than {AGREEMENT:g}; use backend="numpy"'
                )
