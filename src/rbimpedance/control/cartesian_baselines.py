"""The controllers at the tool that a user has today, with the `init` and `step` of `CartesianController`.

They share its target and its output: e1 is the deviation from x_r, also where a law itself does not use x_r.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive, positive_number
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..law.cartesian_impedance import CartesianFilter, CartesianImpedance, Displacement
from ..law.damped_inverse import Damping
from ..law.limits import Allocation, Limits, as_limits
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolKinematics, ToolMotion
from .cartesian_base import CartesianControllerBase, ToolErrors, ToolMeasured, ToolTracking
from .cartesian_telemetry import CartesianOutput
from .pid import pid_gains
from .telemetry import Situation

POSTURE_STIFFNESS, POSTURE_DAMPING = 20.0, 9.0
"""Posture control of the null space [1/s², 1/s]."""

_STIFFNESS = (
    10.0  # of the posture where it is a torque [N·m/rad], damped as for an inertia of 1 kg·m²
)
_REGULAR = 1e-6  # added to J M⁻¹ Jᵀ, so that it has an inverse at a singularity


class ToolBaselineState(NamedTuple):
    """What a baseline at the tool remembers.

    Attributes:
        ticks: Number of ticks so far.
        displacement: Of x_r from x_d at this tick.
        integral: Integral of e1, shape (6,); of use to the PID only.
        posture: Configuration of the first tick, which the null space is drawn to, shape (nq,).
        tau: Torque of the tick before, shape (nv,).
        pulled: Wrench that the target saw then, shape (6,); with the two below, what a late tick starts from again.
        displacement_before: The displacement at that tick.
        integral_before: The integral at that tick.
    """

    ticks: int
    displacement: Displacement
    integral: Array
    posture: Array
    tau: Array
    pulled: Array
    displacement_before: Displacement
    integral_before: Array


class BaselineTracking(NamedTuple):
    """What a baseline computes its torque from.

    Attributes:
        given: Measurements.
        at_tool: The tool, x_r and the errors to it.
        desired: Errors to x_d.
        integral: Integral of e1, shape (6,).
    """

    given: ToolMeasured
    at_tool: ToolTracking
    desired: ToolErrors
    integral: Array

    @property
    def motion(self) -> ToolMotion:
        """Motion of the frame."""
        return self.at_tool.motion

    @property
    def errors(self) -> ToolErrors:
        """Errors to x_r."""
        return self.at_tool.errors

    @property
    def away(self) -> Array:
        """Posture (-) q, shape (nv,)."""
        return self.at_tool.away

    def in_world(self, matrix: Array, x: Array) -> Array:
        """Return a matrix of the compliance axes times a vector in world axes, shape (6,)."""
        to_world = np.kron(np.eye(2), self.at_tool.axes)
        product: Array = to_world @ (matrix @ (to_world.T @ x))
        return product

    def spring_damper(self, D: Array, K: Array) -> Array:
        """Return K(x_d - x) + D(v_d - v) in world axes, shape (6,) [N, N·m]."""
        rate = self.given.desired.v - self.motion.v
        return self.in_world(K, self.desired.e1) + self.in_world(D, rate)


@dataclass(frozen=True, eq=False, init=False)
class ToolBaseline(CartesianControllerBase[ToolBaselineState]):
    """What every baseline at the tool has; children give `_torque`.

    Args:
        arm: The controller's model of the arm.
        impedance: Target impedance at the frame.
        dt: Control period [s].
        frame: Name of the frame; the arm's tool frame by default.

    Raises:
        ParameterError: dt is not a positive number.
        ModelError: No such frame.
        UnsupportedJointError: The arm has joints that mimic others.
    """

    _kinematics: ToolKinematics
    _filter: CartesianFilter
    _matrices: tuple[Array, Array, Array]

    def __init__(
        self,
        arm: ArmModel,
        impedance: CartesianImpedance,
        dt: float = 1e-3,
        *,
        frame: str | None = None,
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        kinematics = ToolKinematics(arm, frame)
        set_fields(
            self,
            arm=arm,
            impedance=impedance,
            dt=dt,
            frame=kinematics.frame,
            damping=Damping(),
            _kinematics=kinematics,
            _filter=impedance.filter(dt),
            _matrices=tuple(impedance.linear.matrices(6)),
        )

    @abstractmethod
    def _torque(self, tick: BaselineTracking) -> Array:
        """The control law."""

    @property
    def _target(self) -> CartesianFilter:
        return self._filter

    def init(self) -> ToolBaselineState:
        """Return the state before the first tick: target at rest."""
        six, nv = np.zeros(6), self.arm.nv
        rest = Displacement(six, six)
        return ToolBaselineState(0, rest, six, np.zeros(self.arm.nq), np.zeros(nv), six, rest, six)

    def _step(
        self, state: ToolBaselineState, given: ToolMeasured
    ) -> tuple[CartesianOutput, ToolBaselineState]:
        motion = self._kinematics.motion(given.q, given.v)
        pulled = self._filter.pulled_back(state.displacement, given.desired, given.wrench)
        reference = self._filter.reference(state.displacement, given.desired, pulled)
        posture = state.posture if state.ticks else given.q
        at_tool = ToolTracking(
            motion,
            reference,
            ToolErrors.of(reference, motion),
            self._filter.axes(given.desired),
            given.wrench,
            self.arm.raw_dynamics.difference(given.q, posture),
        )
        desired = ToolErrors.of(given.desired, motion)
        tick = BaselineTracking(given, at_tool, desired, state.integral)
        allocation = self._within_limits(state, given, self._torque(tick))
        output = self._output(tick, allocation)
        return output, ToolBaselineState(
            state.ticks + 1,
            self._filter.advance(state.displacement, pulled),
            self._integrated(tick, allocation),
            posture.copy(),
            allocation.tau.copy(),
            pulled,
            state.displacement,
            state.integral,
        )

    def _elapsed(self, state: ToolBaselineState, period: float) -> ToolBaselineState:
        before = state.integral_before
        return state._replace(
            displacement=self._filter.advance(state.displacement_before, state.pulled, period),
            integral=before + (state.integral - before) * (period / self.dt),
        )

    def handover(  # noqa: D102 (the base's docstring)
        self, state: ToolBaselineState, now: Situation
    ) -> ToolBaselineState:
        motion = self._kinematics.motion(now.q, now.v)
        following: ToolBaselineState = self._taken_over(state, now, motion)
        return following._replace(integral_before=state.integral)

    def _within_limits(
        self, state: ToolBaselineState, given: ToolMeasured, tau: Array
    ) -> Allocation:
        """The torque; only the PID has limits."""
        del state, given
        none = np.zeros(self.arm.nv, dtype=np.bool_)
        return Allocation(tau, none, none, np.zeros(self.arm.nv))

    def _integrated(self, tick: BaselineTracking, allocation: Allocation) -> Array:
        """The next integral; only the PID has one."""
        del allocation
        return tick.integral

    def _resolved(self, tick: BaselineTracking, b: Array) -> Array:
        """Torque for a tool acceleration b: Jᵀ Λ (b - J̇ v) + bias, and a posture in the consistent null space."""
        dynamics, (q, v) = self.arm.raw_dynamics, tick.given[:2]
        J, M = tick.motion.jacobian, dynamics.mass_matrix(q)
        M_inverse = np.linalg.inv(M)
        Lambda = np.linalg.inv(J @ M_inverse @ J.T + _REGULAR * np.eye(6))
        tau = J.T @ (Lambda @ (b - tick.motion.drift)) + dynamics.bias(q, v)
        if self.arm.nv > 6:
            posture = M @ (POSTURE_STIFFNESS * tick.away - POSTURE_DAMPING * v)
            tau = tau + posture - J.T @ (Lambda @ (J @ (M_inverse @ posture)))
        return np.asarray(tau)

    def _output(self, tick: BaselineTracking, allocation: Allocation) -> CartesianOutput:
        torque = tick.given.external_torque(tick.motion.jacobian)
        a = self.arm.raw_dynamics.forward_dynamics(*tick.given[:2], allocation.tau + torque)
        output = tick.at_tool.output(allocation.tau, a, self.damping)
        return output._replace(saturated=allocation.saturated, rate_limited=allocation.rate_limited)


@brief_repr("arm", "frame", "dt", "impedance")
@dataclass(frozen=True, eq=False, init=False)
class CartesianPD(ToolBaseline):
    """Spring and damper at the tool with the arm's own inertia, and gravity compensation.

        tau = Jᵀ[K_d(x_d - x) + D_d(v_d - v)] + bias(q, v)

    It needs no force sensor, and every model error acts on the spring. A redundant arm gets a posture by projection
    with the pseudo-inverse of Jᵀ. This is the law of libfranka's example of a Cartesian impedance controller.
    """

    def _torque(self, tick: BaselineTracking) -> Array:
        (_, D, K), J, (q, v) = self._matrices, tick.motion.jacobian, tick.given[:2]
        posture = _STIFFNESS * tick.away - 2.0 * np.sqrt(_STIFFNESS) * v
        free = posture - J.T @ (np.linalg.pinv(J.T) @ posture)
        tau: Array = J.T @ tick.spring_damper(D, K) + self.arm.raw_dynamics.bias(q, v) + free
        return tau


@brief_repr("arm", "frame", "dt", "impedance")
@dataclass(frozen=True, eq=False, init=False)
class OperationalSpace(ToolBaseline):
    """Operational-space control with the inertia Λ = (J M⁻¹ Jᵀ)⁻¹, without a force sensor.

        tau = Jᵀ Λ {a_d + M_d⁻¹[K_d(x_d - x) + D_d(v_d - v)] - J̇ v} + bias(q, v)

    With an exact model the tool yields as the mass Λ with the spring Λ M_d⁻¹ K_d.

    References:
        O. Khatib, A unified approach for motion and force control of robot manipulators: the operational space
        formulation, IEEE Journal of Robotics and Automation 3(1), 1987.
    """

    def _torque(self, tick: BaselineTracking) -> Array:
        M, D, K = self._matrices
        feedback = tick.in_world(np.asarray(np.linalg.inv(M)), tick.spring_damper(D, K))
        return self._resolved(tick, tick.given.desired.a + feedback)


@brief_repr("arm", "frame", "dt", "impedance")
@dataclass(frozen=True, eq=False, init=False)
class CartesianHogan(ToolBaseline):
    """Impedance control by inverse dynamics at the tool, with the measured wrench f (Hogan 1985).

        tau = Jᵀ Λ {a_d + M_d⁻¹[K_d(x_d - x) + D_d(v_d - v) + f] - J̇ v} + bias(q, v) - Jᵀ f

    With an exact model the tool has the target impedance; model errors act on it unopposed.
    """

    def _torque(self, tick: BaselineTracking) -> Array:
        M, D, K = self._matrices
        force = tick.spring_damper(D, K) + tick.given.wrench
        feedback = tick.in_world(np.asarray(np.linalg.inv(M)), force)
        torque = self._resolved(tick, tick.given.desired.a + feedback)
        return torque - tick.given.external_torque(tick.motion.jacobian)


@brief_repr("arm", "frame", "dt", "impedance", "bandwidth", "limits")
@dataclass(frozen=True, eq=False, init=False)
class CartesianPID(ToolBaseline):
    """Inverse dynamics and a PID around x_r at the tool: the linear counterpart of our law (Caccavale et al. 1999).

        tau = Jᵀ Λ {a_r + k_p·e1 + k_d·e2 + k_i·∫e1 dt - J̇ v} + bias(q, v) - Jᵀ f

    The gains place the three poles of the sampled loop at exp(-bandwidth·dt), as those of `PIDImpedance`. Where a limit
    withholds acceleration, the integral does not grow in that direction (clamping).

    Attributes:
        bandwidth: Positive, scalar or (6,) [rad/s].
        limits: `Limits`; an array-like means torque limits, None no limits.

    References:
        F. Caccavale, C. Natale, B. Siciliano, L. Villani, Six-DOF impedance control based on angle/axis
        representations, IEEE Transactions on Robotics and Automation 15(2), 1999.
    """

    bandwidth: Array
    limits: Limits | None
    _gains: tuple[Array, Array, Array]

    def __init__(
        self,
        arm: ArmModel,
        impedance: CartesianImpedance,
        bandwidth: ArrayLike,
        dt: float = 1e-3,
        *,
        frame: str | None = None,
        limits: Limits | ArrayLike | None = None,
    ) -> None:
        super().__init__(arm, impedance, dt, frame=frame)
        limits = as_limits(limits, arm.nv)
        bandwidth = per_joint("bandwidth", positive("bandwidth", bandwidth), 6)
        set_fields(self, bandwidth=bandwidth, limits=limits, _gains=pid_gains(bandwidth, self.dt))

    def _torque(self, tick: BaselineTracking) -> Array:
        k_p, k_d, k_i = self._gains
        u = k_p * tick.errors.e1 + k_d * tick.errors.e2 + k_i * tick.integral
        b = tick.errors.acceleration(tick.at_tool.reference, tick.motion.v[3:], u)
        return self._resolved(tick, b) - tick.given.external_torque(tick.motion.jacobian)

    def _within_limits(
        self, state: ToolBaselineState, given: ToolMeasured, tau: Array
    ) -> Allocation:
        return (self.limits or Limits()).allocate(
            tau,
            lambda: self.arm.raw_dynamics.mass_matrix(given.q),
            before=state.tau if state.ticks else None,
            dt=self.dt,
        )

    def _integrated(self, tick: BaselineTracking, allocation: Allocation) -> Array:
        errors = tick.errors
        deficit = errors.of_error(tick.motion.jacobian @ allocation.acceleration_deficit)
        grows = deficit * errors.e1 <= 0.0
        return tick.integral + self.dt * np.where(grows, errors.e1, 0.0)
