"""An arm as tables of float64: what the compiled recursions read, one row a joint.

Every joint's axes are turned so that the joint turns about, or slides along, its own z. That costs nothing later (the
rotation disappears in the constant placements) and spares every kernel the case of a general axis.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..arm_model import ArmModel
from ..rigid_bodies import RigidBodies

# Columns of `ArmTables.joints`.
ROTATION = 0  # 9: axes of the joint in those of its parent at q = 0, row by row
TRANSLATION = 9  # 3: its origin in the parent [m]
MASS = 12  # of the body [kg]
MOMENT = 13  # 3: mass times centre of mass [kg·m]
INERTIA = 16  # 6: about the joint's origin, xx xy xz yy yz zz [kg·m²]
ARMATURE = 22  # [kg·m² or kg]
VISCOUS = 23  # [N·m·s/rad or N·s/m]
COULOMB = 24  # [N·m or N]
COLUMNS = 25

# Columns of `ArmTables.topology`.
PARENT = 0  # index of the joint before it; -1: the base
KIND = 1
Q_INDEX = 2  # where its entries of q begin

# Kinds of joint.
REVOLUTE, PRISMATIC, CONTINUOUS = 0, 1, 2


class ArmTables(NamedTuple):
    """One arm.

    Attributes:
        joints: One row a joint, shape (nv, `COLUMNS`).
        topology: Parent, kind and place in q of every joint, shape (nv, 3).
        gravity: Acceleration of free fall in world axes, shape (3,) [m/s²].
    """

    joints: Array
    topology: NDArray[np.int64]
    gravity: Array


class Workspace(NamedTuple):
    """What the recursions write: nothing in it outlives a call.

    Attributes:
        position: Angle or displacement of every joint, shape (nv,) or longer [rad or m].
        cos: Its cosine, as long.
        sin: Its sine, as long.
        rows: One row a joint, shape (nv, `WORK_COLUMNS`).
    """

    position: Array
    cos: Array
    sin: Array
    rows: Array


WORK_COLUMNS = 71
VECTOR = 8
"""Angles are stored in multiples of this, so that their cosines leave no remainder to be done one by one."""


def workspace(nv: int) -> Workspace:
    """Return a work space for nv joints."""
    position, cos, sin = (np.zeros(-(-nv // VECTOR) * VECTOR) for _ in range(3))
    return Workspace(position, cos, sin, np.zeros((nv, WORK_COLUMNS)))


def arm_tables(arm: ArmModel) -> ArmTables:
    """Read an arm.

    Args:
        arm: The arm.

    Raises:
        UnsupportedJointError: A joint that the tables do not support (mimic, screw).
    """
    bodies = arm.rigid_bodies()
    kinds = np.where(bodies.slides, PRISMATIC, np.where(bodies.q_size == 2, CONTINUOUS, REVOLUTE))
    joints = np.empty((arm.nv, COLUMNS))
    places = bodies.parent, bodies.rotation, bodies.translation, bodies.axis
    turned, joints[:, ROTATION:MASS] = _placed(*(part.tobytes() for part in places))
    joints[:, MASS:ARMATURE] = _bodies(bodies, turned)
    joints[:, ARMATURE], joints[:, VISCOUS], joints[:, COULOMB] = (
        arm.armature,
        arm.viscous,
        arm.coulomb,
    )
    topology = np.column_stack([bodies.parent, kinds, bodies.q_index]).astype(np.int64)
    return ArmTables(joints, np.ascontiguousarray(topology), bodies.gravity)


def coordinate_tables(arm: ArmModel) -> ArmTables:
    """Read an arm's coordinates and friction only: what a tick needs whose RNEA is Pinocchio's.

    Args:
        arm: Any arm; joints that follow others have no coordinate.
    """
    model, joints = arm.raw_dynamics.model, np.zeros((arm.nv, COLUMNS))
    joints[:, VISCOUS], joints[:, COULOMB] = arm.viscous, arm.coulomb
    topology = np.full((arm.nv, 3), -1, dtype=np.int64)
    owners = [j for j, nv in enumerate(model.nvs) if nv]
    topology[:, Q_INDEX] = [model.idx_qs[j] for j in owners]
    topology[:, KIND] = [CONTINUOUS if model.nqs[j] == 2 else REVOLUTE for j in owners]
    return ArmTables(joints, topology, np.zeros(3))


def frame_in_joint(arm: ArmModel, frame: str | None) -> tuple[int, Array]:
    """Return the joint that carries a frame, -1 for the base, and the frame's pose in the joint's turned axes, (12,).

    Args:
        arm: The arm.
        frame: Name of the frame; the arm's tool frame if it is None.

    Raises:
        ModelError: No such frame.
    """
    arm.frame_placement(arm.neutral, frame)  # refuses one that is not there
    dynamics, bodies = arm.raw_dynamics, arm.rigid_bodies()
    place = dynamics.model.frames[dynamics.frame_ids[frame or arm.tool_frame]]
    joint = int(place.parentJoint) - 1
    axes = axes_with_z_along(bodies.axis[joint]) if joint >= 0 else np.eye(3)
    rotation, origin = axes.T @ place.placement.rotation, axes.T @ place.placement.translation
    return joint, np.concatenate([rotation.ravel(), origin])


def axes_with_z_along(axis: Array) -> Array:
    """Return right-handed axes, as columns, whose third is the given unit vector; exact for ±x, ±y and ±z.

    Args:
        axis: Unit vector, shape (3,).
    """
    x = _cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= np.sqrt(x @ x)
    return np.array([x, _cross(axis, x), axis]).T


@functools.lru_cache(maxsize=64)
def _placed(parent: bytes, rotation: bytes, translation: bytes, axis: bytes) -> tuple[Array, Array]:
    """Turned axes of the joints, (nv, 3, 3), and rotation and translation between them, (nv, 12), from bytes.

    Arms that differ in masses and friction only share them.
    """
    turned = np.array([axes_with_z_along(z) for z in np.frombuffer(axis).reshape(-1, 3)])
    before = np.concatenate([turned, np.eye(3)[None]])[np.frombuffer(parent, dtype=np.int64)]
    between = _transposed(before) @ np.frombuffer(rotation).reshape(-1, 3, 3) @ turned
    origins = np.einsum("jik,ji->jk", before, np.frombuffer(translation).reshape(-1, 3))
    return turned, np.hstack([between.reshape(-1, 9), origins])  # the base is number -1


def _cross(a: Array, b: Array) -> Array:
    """A × b, in a tenth of the time that `numpy.cross` takes for one pair."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


_UPPER = np.triu_indices(3)


def _bodies(bodies: RigidBodies, turned: Array) -> Array:
    """Mass, first moment and inertia about the origin, in the turned axes, one row a joint."""
    mass, com = bodies.mass, np.einsum("jik,ji->jk", turned, bodies.com)
    about_com = _transposed(turned) @ bodies.inertia @ turned
    squares = np.einsum("ji,ji->j", com, com)[:, None, None] * np.eye(3)
    offset = squares - com[:, :, None] * com[:, None, :]
    about_origin = (about_com + mass[:, None, None] * offset)[:, _UPPER[0], _UPPER[1]]
    return np.column_stack([mass, mass[:, None] * com, about_origin])


def _transposed(matrices: Array) -> Array:
    return matrices.transpose(0, 2, 1)
