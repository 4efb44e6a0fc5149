"""What a desired motion is to a guard: one of the joints, or one of a frame, for the controller that it guards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from ..._common.arrays import Array
from ...law.cartesian_impedance import motion_of, reference_of, six_array, six_of
from ...law.damped_inverse import DampedInverse
from ...law.poses import CartesianReference, Pose, check_cartesian_reference
from ...law.rotations import at
from ...law.tool_formulas import error_acceleration, error_rate, reference_in_constant_axes
from ...law.vectors import matrix_of, vector_of
from ...robot.arm_model import ArmModel
from ...robot.tool_kinematics import ToolKinematics, ToolMotion, rotation_error
from ...trajectories import Reference
from ..cartesian_base import CartesianControllerBase, ToolErrors, ToolTracking
from ..cartesian_defaults import TOOL_SPEED
from ..errors import check_reference
from ..telemetry import ControllerOutput, Situation, flags
from ..tool_view import ToolTick, tool_tick
from ..wrapper import tool_inside
from .faults import FASTEST


class DesiredMotion(ABC):
    """How a guard treats references of one kind; n is the number of their coordinates.

    A gap is the way from one motion to another with its two rates, shape (3, n).

    Attributes:
        arm: The controller's model of the arm.
        fastest: Speed limits of the joints, shape (nv,) [rad/s or m/s].
        usual_speed: Speed at which a guard leads the arm back, shape (n,).
    """

    arm: ArmModel
    fastest: Array
    usual_speed: Array

    @abstractmethod
    def at_rest(self) -> Any:
        """Return a reference to begin with, before there is one."""

    @abstractmethod
    def check(self, reference: Any) -> Any:
        """Return a reference as checked float64 arrays.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: It holds NaN or infinity.
        """

    @abstractmethod
    def gap(self, now: Situation) -> Array:
        """Return the way from the reference of a situation to the arm in it, with its rates."""

    @abstractmethod
    def moved(self, reference: Any, gap: Array) -> Any:
        """Return a reference moved by a gap."""

    @abstractmethod
    def has_jumped(self, before: Any, reference: Any, q: Array, time: float) -> bool:
        """Return whether a reference moved more than twice as far in a time as the arm can from q."""

    @abstractmethod
    def joint_acceleration(self, reference: Any, q: Array, v: Array) -> Array:
        """Return the acceleration of the joints that a reference asks for, shape (nv,)."""

    @abstractmethod
    def joint_speed(self, reference: Any | None, offset_rate: Array, q: Array) -> Array:
        """Return how fast the joints follow a reference and its offset, shape (nv,).

        Args:
            reference: Desired motion; None where it is not known.
            offset_rate: Rate of the impedance's offset from it, shape (n,).
            q: Configuration, shape (nq,).
        """

    @abstractmethod
    def offset(self, output: Any, reference: Any) -> Array:
        """Return how far the impedance has moved a reference and how fast, by an output of the tick, shape (2, n)."""

    @abstractmethod
    def output(self, now: Situation, offset: Array) -> Any:
        """Return what there is to say of a tick without the controller, whose torque is at no limit.

        Args:
            now: The arm at this tick, with the torque that leaves.
            offset: From `offset`, of the controller's last tick.
        """


def copied(reference: Any) -> Any:
    """Return a reference whose arrays are its own."""
    parts = (copied(part) if isinstance(part, tuple) else np.array(part) for part in reference)
    return type(reference)(*parts)


def desired_motion(controller: Any) -> DesiredMotion:
    """Return how to treat the references of a controller."""
    tool = tool_inside(controller)
    return JointMotion(controller.arm) if tool is None else FrameMotion(tool)


class JointMotion(DesiredMotion):
    """References are motions of the joints; see `DesiredMotion`."""

    def __init__(self, arm: ArmModel) -> None:
        self.arm = arm
        self.fastest = np.where(np.isfinite(arm.velocity_limit), arm.velocity_limit, FASTEST)
        self.usual_speed = self.fastest / 2.0

    def at_rest(self) -> Reference:  # noqa: D102 (the base's docstrings, from here on)
        zero = np.zeros(self.arm.nv)
        return Reference(np.array(self.arm.neutral), zero, zero)

    def check(self, reference: Reference) -> Reference:  # noqa: D102
        return check_reference(self.arm, reference)

    def gap(self, now: Situation) -> Array:  # noqa: D102
        q_d, v_d, a_d = now.reference
        way = self.arm.raw_dynamics.difference(q_d, now.q)
        return np.stack([way, now.v - v_d, now.a - a_d])

    def moved(self, reference: Reference, gap: Array) -> Reference:  # noqa: D102
        (q, v, a), (way, rate, acceleration) = reference, gap
        return Reference(self.arm.raw_dynamics.integrate(q, way), v + rate, a + acceleration)

    def has_jumped(  # noqa: D102
        self, before: Reference, reference: Reference, q: Array, time: float
    ) -> bool:
        del q
        way = self.arm.raw_dynamics.difference(before.q, reference.q)
        return bool((np.abs(way) > 2.0 * self.fastest * time).any())

    def joint_acceleration(  # noqa: D102
        self, reference: Reference, q: Array, v: Array
    ) -> Array:
        del q, v
        return reference.a

    def joint_speed(  # noqa: D102
        self, reference: Reference | None, offset_rate: Array, q: Array
    ) -> Array:
        del q
        return offset_rate if reference is None else reference.v + offset_rate

    def offset(self, output: ControllerOutput, reference: Reference) -> Array:  # noqa: D102
        del reference
        return np.stack([output.q_e, output.v_e])

    def output(self, now: Situation, offset: Array) -> ControllerOutput:  # noqa: D102
        q_r, v_r, a_r = self.moved(now.reference, np.stack([*offset, np.zeros(self.arm.nv)]))
        zero = np.zeros_like(now.tau)
        return ControllerOutput(
            now.tau.copy(),
            *(q_r, v_r, a_r),
            *(self.arm.raw_dynamics.difference(now.q, q_r), v_r - now.v),
            s=zero,
            u=zero.copy(),
            q_e=offset[0].copy(),
            v_e=offset[1].copy(),
            premise_holds=np.zeros(self.arm.nv, dtype=np.bool_),
            **flags(self.arm.nv),
        )


class FrameMotion(DesiredMotion):
    """References are motions of a controller's frame; see `DesiredMotion`.

    A gap is a translation and a rotation vector in world axes.
    """

    def __init__(self, controller: CartesianControllerBase[Any]) -> None:
        self.arm, self._controller = controller.arm, controller
        self._kinematics = ToolKinematics(controller.arm, controller.frame)
        self.fastest = JointMotion(self.arm).fastest
        self.usual_speed = np.repeat(TOOL_SPEED, 3)

    def _motion(self, q: Array, v: Array | None = None) -> ToolMotion:
        return self._kinematics.motion(q, np.zeros(self.arm.nv) if v is None else v)

    def _to_joints(self, motion: ToolMotion) -> Array:
        return DampedInverse(motion.jacobian, self._controller.damping).matrix

    def at_rest(self) -> CartesianReference:  # noqa: D102
        return CartesianReference(Pose(np.eye(3), np.zeros(3)), np.zeros(6), np.zeros(6))

    def check(self, reference: CartesianReference) -> CartesianReference:  # noqa: D102
        return check_cartesian_reference(reference)

    def gap(self, now: Situation) -> Array:  # noqa: D102
        motion = self._motion(now.q, now.v)
        pose = Pose(motion.rotation, motion.translation)
        a = motion.drift + motion.jacobian @ now.a
        return _gap(now.reference, CartesianReference(pose, motion.v, a))

    def moved(self, reference: CartesianReference, gap: Array) -> CartesianReference:  # noqa: D102
        way, rate, acceleration = map(six_of, gap)
        given = at(way[1]), way, rate, acceleration, motion_of(reference)
        return reference_of(reference_in_constant_axes(matrix_of(np.eye(3)), *given))

    def has_jumped(  # noqa: D102
        self, before: CartesianReference, reference: CartesianReference, q: Array, time: float
    ) -> bool:
        way = _way(before.pose, reference.pose)
        reach = np.abs(self._motion(q).jacobian) @ self.fastest
        return bool((np.abs(way) > 2.0 * reach * time).any())

    def joint_acceleration(  # noqa: D102
        self, reference: CartesianReference, q: Array, v: Array
    ) -> Array:
        motion = self._motion(q, v)
        return self._to_joints(motion) @ (reference.a - motion.drift)

    def joint_speed(  # noqa: D102
        self, reference: CartesianReference | None, offset_rate: Array, q: Array
    ) -> Array:
        speed = offset_rate if reference is None else reference.v + offset_rate
        return self._to_joints(self._motion(q)) @ speed if speed.any() else np.zeros(self.arm.nv)

    def offset(self, output: ToolTick, reference: CartesianReference) -> Array:  # noqa: D102
        return _gap(reference, output.at_tool.reference)[:2]

    def output(self, now: Situation, offset: Array) -> ToolTick:  # noqa: D102
        q, v, desired, controller = now.q, now.v, now.reference, self._controller
        motion = self._motion(q, v)
        reference = self.moved(desired, np.stack([*offset, np.zeros(6)]))
        tracking = ToolTracking(
            motion,
            reference,
            ToolErrors.of(reference, motion),
            controller.compliance_axes(desired),
            controller.wrench_from_torque(q, now.tau_ext),
            np.zeros(self.arm.nv),
        )
        a = self.arm.raw_dynamics.forward_dynamics(q, v, now.tau + now.tau_ext)
        output = tracking.output(now.tau.copy(), a, controller.damping)
        return tool_tick(self.arm, output, q)


def _way(start: Pose, end: Pose) -> Array:
    """Translation and rotation vector from one pose to another, shape (6,)."""
    way: Array = np.concatenate(
        [end.translation - start.translation, rotation_error(end.rotation, start.rotation)]
    )
    return way


def _gap(start: CartesianReference, end: CartesianReference) -> Array:
    """The way from one motion to another with its rates, shape (3, 6)."""
    way, one, other = _way(start.pose, end.pose), motion_of(start), motion_of(end)
    phi = vector_of(way[3:])
    k = at(phi)
    rate = error_rate(phi, k, other.v, one.v)
    return np.stack(
        [way, six_array(rate), six_array(error_acceleration(phi, k, rate[1], other, one))]
    )
