"""Dynamics of models with mimicking joints, from the same tree with those joints free.

With v_free = S·v, where S holds the multipliers, virtual work gives

    M = Sᵀ·M_free·S,    bias = Sᵀ·bias_free,    J = J_free·S.

Pinocchio's ABA does not take models with mimicking joints. Its CRBA and frame Jacobian (pin 4.1.0) do, but are wrong on
some trees, and CRBA from the second call on one `pin.Data` on every tree; its RNEA and forward kinematics are right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .._common.arrays import Array
from .pinocchio_dynamics import WORLD_AXES, PinocchioDynamics


class FreeTree(NamedTuple):
    """A model whose mimicking joints are free, each with its zero where what it follows is at 0.

    Attributes:
        model: The free model, with the frames of the bound one.
        S: v_free = S·v, shape (nv_free, nv).
        A: q_free = A·q, but for what follows continuous joints, shape (nq_free, nq).
        wound: Joints that follow a continuous one: place in q_free, place of (cos, sin) in q, multiplier.
    """

    model: pin.Model
    S: Array
    A: Array
    wound: tuple[tuple[int, int, float], ...]


class MimicDynamics(PinocchioDynamics):
    """`PinocchioDynamics` for models with mimicking joints."""

    def __init__(self, model: pin.Model) -> None:
        super().__init__(model)
        self._free = free_tree(model)
        self._free_data = self._free.model.createData()
        self._S, self._A = self._free.S, self._free.A
        self.aba = self._solve

    def mass_matrix(self, q: Array) -> Array:
        """M(q) = Sᵀ·M_free·S with the armature on its diagonal, shape (nv, nv)."""
        S = self._S
        M: Array = S.T @ pin.crba(self._free.model, self._free_data, self._q_free(q)) @ S
        M.ravel()[:: len(M) + 1] += self.model.armature
        return M

    def _solve(self, q: Array, v: Array, torque: Array) -> Array:
        """M⁻¹ (torque - C v - g), in place of Pinocchio's ABA."""
        bias = pin.nonLinearEffects(self.model, self._data, q, v)
        return np.linalg.solve(self.mass_matrix(q), torque - bias)

    def jacobian(self, q: Array, frame_id: int) -> Array:
        """J_free·S; see `PinocchioDynamics.jacobian`."""
        model, data = self._free.model, self._free_data
        J_free = pin.computeFrameJacobian(model, data, self._q_free(q), frame_id, WORLD_AXES)
        return np.asarray(np.array(J_free).reshape(6, model.nv) @ self._S)

    def _q_free(self, q: Array) -> Array:
        q_free: Array = self._A @ q
        for place, i, multiplier in self._free.wound:
            q_free[place] = multiplier * np.arctan2(q[i + 1], q[i])
        return q_free


def free_tree(model: pin.Model) -> FreeTree:
    """Free the mimicking joints of a model.

    Args:
        model: A model whose other joints have one degree of freedom each.
    """
    free = pin.Model()
    free.gravity = model.gravity
    velocities, data = _velocities(model)
    for j in range(1, model.njoints):
        joint, placement = model.joints[j], model.jointPlacements[j]
        if j in velocities:
            joint, placement = _joint_along(velocities[j]), data.liMi[j]
        free.addJoint(model.parents[j], joint, placement, model.names[j])
        free.inertias[j] = model.inertias[j]
    for frame in list(model.frames)[1:]:
        free.addFrame(pin.Frame(frame), False)
    return _with_rules(free, model, {j: float(np.linalg.norm(v)) for j, v in velocities.items()})


def _velocities(model: pin.Model) -> tuple[dict[int, Array], pin.Data]:
    """How fast each mimicking joint moves (linear, angular) when what it follows passes 0 at unit speed."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model), np.ones(model.nv))
    velocities = {}
    for j in model.mimicking_joints:
        parent = data.liMi[j].actInv(data.v[model.parents[j]])
        velocities[int(j)] = np.array((data.v[j] - parent).vector)
    return velocities, data


def _joint_along(velocity: Array) -> pin.JointModel:
    """The joint that moves with such a velocity; any one for a joint that stays where it is (multiplier 0)."""
    linear, angular = velocity[:3], velocity[3:]
    if linear.any():
        return pin.JointModelPrismaticUnaligned(linear / np.linalg.norm(linear))
    if angular.any():
        return pin.JointModelRevoluteUnaligned(angular / np.linalg.norm(angular))
    return pin.JointModelRX()


def _with_rules(free: pin.Model, model: pin.Model, rates: dict[int, float]) -> FreeTree:
    """How the free coordinates follow from the bound ones."""
    followed = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    S, A, wound = np.zeros((free.nv, model.nv)), np.zeros((free.nq, model.nq)), []
    for j in range(1, model.njoints):
        own, bound, rate = free.joints[j], model.joints[followed.get(j, j)], rates.get(j, 1.0)
        S[own.idx_v, bound.idx_v] = rate
        if own.nq == bound.nq:
            A[own.idx_q : own.idx_q + own.nq, bound.idx_q : bound.idx_q + bound.nq] = rate * np.eye(
                own.nq
            )
        else:
            wound.append((own.idx_q, bound.idx_q, rate))
    return FreeTree(free, S, A, tuple(wound))


def pinocchio_dynamics(model: pin.Model) -> PinocchioDynamics:
    """Return the dynamics of a model, with the detour that mimicking joints need.

    Args:
        model: The model; it is kept, not copied.
    """
    return MimicDynamics(model) if len(model.mimicking_joints) else PinocchioDynamics(model)
