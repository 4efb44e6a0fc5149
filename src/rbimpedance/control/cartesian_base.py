"""What every controller at the tool offers: the checked step, the measured period, wrenches, the impedance error."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, vector
from ..law import tool_formulas
from ..law.cartesian_impedance import (
    CartesianFilter,
    CartesianImpedance,
    motion_of,
    six_array,
    six_of,
)
from ..law.damped_inverse import DampedInverse, Damping
from ..law.poses import CartesianReference, Pose, check_cartesian_reference
from ..law.rotations import Coefficients, RotationVector, at
from ..law.vectors import Vector, matrix_of, vector_of
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolMotion
from .cartesian_telemetry import CartesianOutput, CartesianState
from .protocol import StateT, TickBase, checked_period
from .telemetry import Situation


class ToolMeasured(NamedTuple):
    """Checked measurements of a tick.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        desired: Desired motion.
        wrench: Wrench of the environment at the frame, shape (6,).
        tau_ext: Its joint torque, shape (nv,); None for Jᵀ·wrench.
    """

    q: Array
    v: Array
    desired: CartesianReference
    wrench: Array
    tau_ext: Array | None

    def plain(self) -> tuple[Any, ...]:
        """Return the measurements with every array contiguous and aligned: q, v, reference, wrench, tau_ext."""
        (R, p), v_d, a_d = self.desired
        R, p, v_d, a_d = map(_plain, (R, p, v_d, a_d))
        tau_ext = None if self.tau_ext is None else _plain(self.tau_ext)
        desired = CartesianReference(Pose(R, p), v_d, a_d)
        return _plain(self.q), _plain(self.v), desired, _plain(self.wrench), tau_ext

    def external_torque(self, J: Array) -> Array:
        """Return the torque of the environment on the joints, shape (nv,)."""
        return J.T @ self.wrench if self.tau_ext is None else self.tau_ext


def _plain(array: Array) -> Array:
    return np.require(array, requirements=["C", "A"])


class ToolErrors(NamedTuple):
    """Errors of the pose, and what a rotation error does to rates; the equations are those of `law.tool_formulas`.

    Attributes:
        e1: (p_r - p, log(R_r Rᵀ)), shape (6,).
        e2: Its rate, shape (6,).
        rotation: Its rotation vector.
        coefficients: Those of this vector.
    """

    e1: Array
    e2: Array
    rotation: Vector
    coefficients: Coefficients

    @classmethod
    def of(cls, reference: CartesianReference, motion: ToolMotion) -> ToolErrors:
        """ė_φ = J_l⁻¹(e_φ) ω_r - J_r⁻¹(e_φ) ω: e2 is the rate of e1 at any angle."""
        (R_r, p_r), v_r, _ = reference
        phi = tool_formulas.rotation_error(matrix_of(R_r), matrix_of(motion.rotation))
        k = at(phi)
        rate = tool_formulas.error_rate(phi, k, six_of(v_r), six_of(motion.v))
        return cls(np.array([*(p_r - motion.translation), *phi]), six_array(rate), phi, k)

    def acceleration(self, reference: CartesianReference, omega: Array, y: Array) -> Array:
        """Return the tool's acceleration for which ë1 = -y, shape (6,)."""
        given = vector_of(self.e2[3:]), motion_of(reference), vector_of(omega), six_of(y)
        return six_array(tool_formulas.tool_acceleration(self.rotation, self.coefficients, *given))

    def of_error(self, acceleration: Array) -> Array:
        """Return what a tool acceleration is in the coordinates of e1, shape (6,)."""
        given = self.rotation, self.coefficients, six_of(acceleration)
        return six_array(tool_formulas.of_error(*given))


class ToolForm(Protocol):
    """How a backend computes a tick at the tool."""

    def pack(self, state: CartesianState) -> CartesianState:
        """Return a state in the form that `step` takes."""

    def step(self, state: Any, q: Any, v: Any, reference: Any, wrench: Any, tau_ext: Any) -> Any:
        """Return output and next state.

        It may answer None for what is not sound or what it leaves to `cartesian_tick`, and raise `TypeError` for what
        is not a plain vector of float64.
        """


class ToolTracking(NamedTuple):
    """The tool at a tick, and where it should be.

    Attributes:
        motion: Motion of the frame.
        reference: x_r.
        errors: Errors to x_r.
        axes: Compliance axes as columns, shape (3, 3).
        wrench: Wrench of the environment at the frame, shape (6,).
        away: Posture (-) q, shape (nv,).
    """

    motion: ToolMotion
    reference: CartesianReference
    errors: ToolErrors
    axes: Array
    wrench: Array
    away: Array

    def output(self, tau: Array, a: Array, damping: Damping) -> CartesianOutput:
        """Return the output of a law without sliding variable, whose torque is at no limit.

        Args:
            tau: Motor torque, shape (nv,).
            a: Joint acceleration that it realises, by the controller's model, shape (nv,).
            damping: Of the Jacobian's inverse.
        """
        motion, reference, errors, axes, wrench, away = self
        J = motion.jacobian
        at_rest = errors.acceleration(reference, motion.v[3:], np.zeros(6))
        inverse = DampedInverse(J, damping)
        zero, none = np.zeros(6), np.zeros(len(a), dtype=np.bool_)
        return CartesianOutput(
            tau,
            Pose(motion.rotation, motion.translation),
            *(reference, axes, wrench.copy()),
            *(errors.e1, errors.e2),
            e3=errors.of_error(at_rest - motion.drift - J @ a),
            s=zero,
            u=zero,
            e_null=inverse.basis.T @ away,
            s_null=np.zeros(inverse.basis.shape[1]),
            a=a,
            jacobian=J,
            inverse=inverse.matrix,
            basis=inverse.basis,
            sigma=inverse.sigma,
            lost=inverse.lost,
            premise_holds=np.zeros(6, dtype=np.bool_),
            saturated=none,
            rate_limited=none,
            joint_limited=none,
        )


@dataclass(frozen=True, eq=False, init=False)
class CartesianControllerBase(TickBase[StateT, ToolMeasured, CartesianOutput]):
    """What every controller at the tool offers, described once; children give `init`, `_step` and `_elapsed`.

    Attributes:
        arm: The controller's model of the arm.
        impedance: Target impedance at the frame.
        dt: Control period [s].
        frame: Name of the frame.
        damping: Of the Jacobian's inverse near singularities.
    """

    arm: ArmModel
    impedance: CartesianImpedance
    dt: float
    frame: str
    damping: Damping
    _form: ToolForm | None = field(default=None, init=False)

    @property
    @abstractmethod
    def _target(self) -> CartesianFilter:
        """Filter of the target impedance."""

    def step(
        self,
        state: StateT,
        q: ArrayLike,
        v: ArrayLike,
        reference: CartesianReference,
        wrench: ArrayLike,
        tau_ext: ArrayLike | None = None,
        period: float | None = None,
    ) -> tuple[CartesianOutput, StateT]:
        """Compute the torque of one tick.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion of the frame at this tick.
            wrench: Force and moment of the environment on the robot at the frame's origin, in world axes, shape (6,)
                [N, N·m]: what the target impedance yields to. See `wrench_from_torque` for joint torque sensors.
            tau_ext: Torque of the environment on the joints, shape (nv,) [N·m or N], which the motors take off;
                Jᵀ·wrench by default. Where both are known it may hold more than the wrench does: a push at the elbow.
            period: Measured time since the tick before, see `elapsed`; dt if it is not given [s].

        Returns:
            The output, and the state for the next tick.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            InputError: A period that is not positive, or longer than `LONGEST_PERIOD` control periods.
        """
        if period is not None:
            state = self.elapsed(state, period)
        form, answer = self._form, None
        if form is not None:
            with contextlib.suppress(TypeError, ValueError):  # not plain vectors
                answer = form.step(state, q, v, reference, wrench, tau_ext)
        if answer is not None:
            return answer  # type: ignore[no-any-return]
        given = ToolMeasured(
            self.arm.check_configuration("q", q),
            vector("v", v, self.arm.nv),
            check_cartesian_reference(reference),
            vector("wrench", wrench, 6, "force, moment"),
            None if tau_ext is None else vector("tau_ext", tau_ext, self.arm.nv),
        )
        return self._step(state, given)

    def warm_up(self) -> None:
        """Take two ticks and forget them, so that the first ones of a run are no slower than the rest.

        What has to be compiled, or loaded from the disk, is compiled here or when the controller is made.
        """
        q, still, state = self.arm.ready, np.zeros(self.arm.nv), self.init()
        for _ in range(2):
            _, state = self.step(state, q, still, self.at_rest(q), np.zeros(6))

    def at_rest(self, q: ArrayLike) -> CartesianReference:
        """Return the desired motion of a tool that rests where it is at a configuration.

        Args:
            q: Configuration, shape (nq,).

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: q holds NaN or infinity.
        """
        pose = Pose(*self.arm.frame_placement(q, self.frame))
        return CartesianReference(pose, np.zeros(6), np.zeros(6))

    def elapsed(self, state: StateT, period: float) -> StateT:
        """See `TickBase.elapsed`; `_elapsed` is given a period that is checked and not dt."""
        period, ticks = checked_period(period, self.dt), getattr(state, "ticks", 0)
        return state if ticks == 0 or period == self.dt else self._elapsed(state, period)

    @abstractmethod
    def handover(self, state: StateT, now: Situation) -> StateT:
        """Return the state with which the controller takes the arm over as it is now.

        The target starts from where the tool is, so that x_r and its velocity are those of the tool. The integral keeps
        what it knows of the load, and the rate limit counts from the torque that acts.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come; its reference is a `CartesianReference`.
        """

    def _taken_over(self, state: Any, now: Situation, motion: ToolMotion) -> Any:
        """The state with the target where the tool is; children add what else they remember."""
        pose, target = Pose(motion.rotation, motion.translation), self._target
        displacement = target.displacement(now.reference, pose, motion.v)
        wrench = self.wrench_from_torque(now.q, now.tau_ext)
        return state._replace(
            ticks=max(state.ticks, 1),
            displacement=displacement,
            posture=state.posture if state.ticks else np.array(now.q),
            tau=np.array(now.tau),
            pulled=target.pulled_back(displacement, now.reference, wrench),
            displacement_before=displacement,
        )

    def wrench_from_torque(self, q: ArrayLike, tau_ext: ArrayLike) -> Array:
        """Return the wrench at the frame that explains a joint torque best, world axes, shape (6,) [N, N·m].

        For joint torque sensors and observers: the damped solution of Jᵀ·wrench = tau_ext. What acts on other links is
        in it, too, and near a singularity it is smaller than the true one.

        Args:
            q: Configuration, shape (nq,).
            tau_ext: Torque of the environment on the joints, shape (nv,) [N·m or N].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        torque = vector("tau_ext", tau_ext, self.arm.nv)
        inverse = DampedInverse(self.arm.jacobian(q, self.frame), self.damping)
        wrench: Array = inverse.matrix.T @ torque
        return wrench

    def compliance_axes(self, desired: CartesianReference) -> Array:
        """Return the compliance axes R_c as columns in world axes, shape (3, 3).

        Args:
            desired: Desired motion of the frame.
        """
        return self._target.axes(desired)

    def impedance_error(self, output: CartesianOutput, a: Array) -> Array:
        """Return Jᵀ·e, with e what the target's equation lacks at the frame, shape (nv,) [N·m or N].

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        torque: Array = output.jacobian.T @ self.tool_impedance_error(output, a)
        return torque

    def tool_impedance_error(self, output: CartesianOutput, a: Array) -> Array:
        """Return what the target's equation lacks at the frame, force and moment in world axes, shape (6,) [N, N·m].

        It is M_d·ë1 + D_d·ė1 + K_d·e1 in the compliance axes (see `law.impedance`), turned to world axes.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        e1, e2 = output.e1, output.e2
        missed = output.jacobian @ (output.a - a)
        missed[3:] = RotationVector(e1[3:]).right_inverse @ missed[3:]
        axes = output.axes
        in_axes = [(e.reshape(2, 3) @ axes).ravel() for e in (e1, e2, output.e3 + missed)]
        error: Array = self._target.error(*in_axes).reshape(2, 3) @ axes.T
        return error.ravel()
