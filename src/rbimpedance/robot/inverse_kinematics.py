"""A configuration in which a frame has a pose: SciPy's least squares within the joint limits, with Pinocchio's log6."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..exceptions import ParameterError
from ..law.poses import Pose, check_pose
from .arm_model import ArmModel
from .pinocchio_dynamics import LOCAL_AXES

_REACHED = 1e-8  # residual in metres and radians that counts as reached
_STARTS, _EVALUATIONS = 50, 60


def inverse_kinematics(
    arm: ArmModel,
    pose: Pose,
    start: ArrayLike | None = None,
    *,
    frame: str | None = None,
    seed: int = 0,
) -> Array:
    """Return a configuration within the position limits in which a frame has a pose, shape (nq,).

        q = rbi.inverse_kinematics(arm, pose)

    The search begins at `start`, and where it ends beside the pose, at random configurations.

    Args:
        arm: The arm.
        pose: Wanted pose of the frame.
        start: Configuration to begin at, shape (nq,); `arm.ready` by default.
        frame: Name of the frame; the arm's tool frame by default.
        seed: Of the random configurations.

    Raises:
        ParameterError: No configuration within the limits was found; says how near the arm comes.
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ModelError: No such frame.
    """
    wanted, rng = check_pose("pose", pose), np.random.default_rng(seed)
    arm.frame_placement(arm.neutral, frame)  # raises where there is no such frame
    q = np.array(arm.ready if start is None else arm.check_configuration("start", start))
    nearest = np.inf
    for _ in range(_STARTS):
        q, distance = _search(arm, wanted, q, frame)
        if distance < _REACHED:
            return q
        nearest, q = min(nearest, distance), arm.random_configuration(rng)
    words = f"within reach of '{arm.name}', whose nearest posture is {nearest:.3g} m or rad off"
    raise ParameterError("pose", pose, words)


def _search(arm: ArmModel, wanted: Pose, q: Array, frame: str | None) -> tuple[Array, float]:
    """The configuration that a search from q ends at, and its distance from the pose."""
    from scipy.optimize import least_squares  # noqa: PLC0415 (SciPy is loaded when needed)

    model, data = arm.raw_dynamics.model, arm.raw_dynamics.model.createData()
    frame_id = arm.raw_dynamics.frame_ids[frame or arm.tool_frame]
    target_inverse = pin.SE3(*wanted).inverse()

    def error(step: Array) -> pin.SE3:
        pin.framesForwardKinematics(model, data, arm.raw_dynamics.integrate(q, step))
        return target_inverse * data.oMf[frame_id]

    def residual(step: Array) -> Array:
        return np.array(pin.log6(error(step)).vector)

    def jacobian(step: Array) -> Array:
        at = arm.raw_dynamics.integrate(q, step)
        J = pin.computeFrameJacobian(model, data, at, frame_id, LOCAL_AXES).reshape(6, arm.nv)
        return np.asarray(pin.Jlog6(error(step)) @ J)

    lower, upper = arm.joint_limits()
    x = arm.raw_dynamics.difference(arm.zero, q)
    x = np.where(np.isfinite(lower) | np.isfinite(upper), x, 0.0)
    room = lower - x, upper - x
    begin = np.clip(np.zeros(arm.nv), room[0] + 1e-9, room[1] - 1e-9)
    found = least_squares(
        residual,
        begin,
        jacobian,
        bounds=room,
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=_EVALUATIONS,
    )
    step = np.asarray(found.x, dtype=np.float64)
    return arm.raw_dynamics.integrate(q, step), float(np.abs(residual(step)).max())
