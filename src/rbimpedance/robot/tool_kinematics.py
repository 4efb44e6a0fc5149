"""How a frame moves with the joints: pose, velocity, Jacobian and drift J̇·v, in world axes at its origin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .._common.arrays import Array
from ..exceptions import UnsupportedJointError
from ..law import tool_formulas
from ..law.vectors import matrix_of
from .arm_model import ArmModel
from .pinocchio_dynamics import WORLD_AXES


class ToolMotion(NamedTuple):
    """Motion of a frame at one instant; linear rows first.

    Attributes:
        rotation: Axes of the frame as columns, shape (3, 3).
        translation: Its origin, shape (3,) [m].
        jacobian: J, shape (6, nv).
        v: J·v, shape (6,) [m/s, rad/s].
        drift: J̇·v, the acceleration of the origin and the angular one at zero joint acceleration, shape (6,).
    """

    rotation: Array
    translation: Array
    jacobian: Array
    v: Array
    drift: Array


class ToolKinematics:
    """Pinocchio's kinematics of one frame; inputs are not checked.

    Each instance owns its `pin.Data` and returns copies; two threads must not share one.

    Attributes:
        frame: Name of the frame.
        nv: Number of joints.

    Args:
        arm: The arm.
        frame: Name of the frame; the arm's tool frame by default.

    Raises:
        ModelError: No such frame.
        UnsupportedJointError: The arm has joints that mimic others.
    """

    def __init__(self, arm: ArmModel, frame: str | None = None) -> None:
        arm.frame_placement(arm.neutral, frame)  # raises where there is no such frame
        model = arm.raw_dynamics.model
        mimicking = [str(model.names[j]) for j in model.mimicking_joints]
        if mimicking:
            reason = "a column of the Jacobian then belongs to two joints; weld it with lock=(...)"
            raise UnsupportedJointError(mimicking, reason)
        self.frame = arm.tool_frame if frame is None else frame
        self._frame_id = arm.raw_dynamics.frame_ids[self.frame]
        self._model, self._data = model, model.createData()
        self.nv = int(model.nv)
        self._zero = np.zeros(model.nv)

    def motion(self, q: Array, v: Array) -> ToolMotion:
        """Return the motion of the frame.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
        """
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, q, v, self._zero)
        pin.computeJointJacobians(model, data)
        placement = pin.updateFramePlacement(model, data, self._frame_id)
        J = np.array(pin.getFrameJacobian(model, data, self._frame_id, WORLD_AXES))
        J = J.reshape(6, model.nv)  # pin returns a vector where nv = 1
        drift = pin.getFrameClassicalAcceleration(model, data, self._frame_id, WORLD_AXES)
        return ToolMotion(
            np.array(placement.rotation, order="C"),
            np.array(placement.translation),
            J,
            J @ v,
            np.concatenate([drift.linear, drift.angular]),
        )

    def jacobian_rate(self, q: Array, v: Array) -> Array:
        """Return J̇, shape (6, nv).

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """
        model, data = self._model, self._data
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        rate = pin.getFrameJacobianTimeVariation(model, data, self._frame_id, WORLD_AXES)
        return np.array(rate).reshape(6, model.nv)


def rotation_error(target: Array, now: Array) -> Array:
    """Return log(R_target·Rᵀ), the rotation vector from one to the other in world axes, shape (3,) [rad].

    Args:
        target: R_target, shape (3, 3).
        now: R, shape (3, 3).
    """
    return np.array(tool_formulas.rotation_error(matrix_of(target), matrix_of(now)))
