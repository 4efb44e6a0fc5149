"""What enters the dynamics as plain arrays, read out of a Pinocchio model for code that does not know Pinocchio."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .._common.arrays import Array
from ..exceptions import UnsupportedJointError


class RigidBodies(NamedTuple):
    """What enters the dynamics, joint by joint in the order of v.

    Each joint carries one body. Friction and armature are attributes of the arm.

    Attributes:
        parent: Index of the joint before it, -1 for the base, shape (nv,).
        q_index: Where the joint's entries of q begin, shape (nv,).
        q_size: How many they are: 1, or 2 for the (cos, sin) of a continuous joint, shape (nv,).
        rotation: Axes of the joint in those of its parent where q is neutral, shape (nv, 3, 3).
        translation: Origin of the joint in its parent, shape (nv, 3) [m].
        axis: Axis that the joint turns about or slides along, in its own axes, a unit vector, shape (nv, 3).
        slides: True for a prismatic joint, shape (nv,).
        mass: Mass of the body, shape (nv,) [kg].
        com: Its centre of mass in the joint's axes, shape (nv, 3) [m].
        inertia: Its rotational inertia about the centre of mass, in the joint's axes, shape (nv, 3, 3) [kg·m²].
        gravity: Acceleration of free fall in world axes, shape (3,) [m/s²].
    """

    parent: NDArray[np.int64]
    q_index: NDArray[np.int64]
    q_size: NDArray[np.int64]
    rotation: Array
    translation: Array
    axis: Array
    slides: NDArray[np.bool_]
    mass: Array
    com: Array
    inertia: Array
    gravity: Array


def rigid_bodies(model: pin.Model) -> RigidBodies:
    """Return the numbers behind a model's dynamics.

    Args:
        model: A model whose joints have one degree of freedom each.

    Raises:
        UnsupportedJointError: A joint that neither turns about nor slides along one axis of its own (mimic, screw).
    """
    joints, axes = movable_joints(model), _motion_axes(model)
    slides = np.array([not axis[3:].any() for axis in axes])
    placements = [model.jointPlacements[j] for j in joints]
    inertias = [model.inertias[j] for j in joints]
    return RigidBodies(
        parent=np.array(model.parents)[joints] - 1,
        q_index=np.array(model.idx_qs)[joints],
        q_size=np.array(model.nqs)[joints],
        rotation=np.array([placement.rotation for placement in placements]),
        translation=np.array([placement.translation for placement in placements]),
        axis=np.array([axis[:3] + axis[3:] for axis in axes]),
        slides=slides,
        mass=np.array([body.mass for body in inertias]),
        com=np.array([body.lever for body in inertias]),
        inertia=np.array([body.inertia for body in inertias]),
        gravity=np.array(model.gravity.linear),
    )


_ALONG = {
    f"JointModel{kind}{axis}": i + shift
    for kind, shift in (("P", 0), ("R", 3), ("RUB", 3))
    for i, axis in enumerate("XYZ")
}
"""Number of the motion of joints along and about the axes, by Pinocchio's name; asking Pinocchio takes much longer."""

_SIX = np.eye(6)


def movable_joints(model: pin.Model) -> list[int]:
    """Indices of the joints that own a degree of freedom, in the order of v."""
    return [j for j, nv in enumerate(model.nvs) if nv > 0]


def _motion_axes(model: pin.Model) -> list[Array]:
    """Motion subspace of every joint in its own axes, (linear, angular), each of shape (6,).

    Raises:
        UnsupportedJointError: A joint that neither turns about nor slides along one axis of its own.
    """
    names = [model.names[j] for j in model.mimicking_joints]
    known = [_ALONG.get(model.joints[j].shortname()) for j in movable_joints(model)]
    if not names and None not in known:
        return [_SIX[i] for i in known if i is not None]
    data, q, axes = model.createData(), pin.neutral(model), []
    for j in range(1, model.njoints):
        if model.nvs[j] != 1:
            continue
        columns = np.array(pin.computeJointJacobian(model, data, q, j)).reshape(6, model.nv)
        axis = columns[:, model.joints[j].idx_v]
        if axis[:3].any() and axis[3:].any():
            names.append(model.names[j])
        axes.append(axis)
    if names:
        raise UnsupportedJointError(names, "neither rotates about nor slides along a single axis")
    return axes
