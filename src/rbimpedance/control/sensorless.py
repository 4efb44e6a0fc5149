"""Compliance without a force sensor: the arm's own inertia with a spring and a damper, or an observer for tau_ext.

Without a sensor nothing can tell a push from what the model does not know: both are torque that the model does not
explain. A controller can reject that torque, as a sliding mode does, or yield to it, as a spring does; it cannot do
both to the same torque. Both controllers here draw the line by size: what stays below `reject` on a joint counts as
friction or model error and is compensated, what is beyond it counts as a push and moves the arm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, not_negative, positive_number
from .._common.frozen import set_fields
from ..interaction.estimators import MomentumObserver, MomentumState
from ..interaction.sensors import Sensor
from ..law.impedance import Impedance
from ..law.limits import Limits, as_limits
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .baseline_law import coriolis_torque
from .errors import check_measurements
from .protocol import Measured, SensorlessBase, WrappableController, checked_period
from .telemetry import ControllerOutput, Situation, flags
from .wrapper import ControllerWrapper


class Split(NamedTuple):
    """A torque that the model does not explain, in two parts, each of shape (nv,) [N·m or N].

    Attributes:
        rejected: The part up to the bound, which counts as friction and model error.
        felt: The part beyond it, which counts as a push.
    """

    rejected: Array
    felt: Array


def split(torque: Array, reject: Array) -> Split:
    """Split a torque at a bound, joint by joint.

    Args:
        torque: Torque that the model does not explain, shape (nv,) [N·m or N].
        reject: Bound from 0 on, shape (nv,).
    """
    rejected = np.clip(torque, -reject, reject)
    return Split(rejected, torque - rejected)


class CompliantState(NamedTuple):
    """What a `CompliantController` remembers of the tick before.

    Attributes:
        ticks: Number of ticks so far.
        observer: State of its observer, None where nothing is rejected.
        tau: Torque, shape (nv,) [N·m or N].
    """

    ticks: int
    observer: MomentumState | None
    tau: Array


@dataclass(frozen=True, eq=False, init=False)
class CompliantController(SensorlessBase[CompliantState, ControllerOutput]):
    """A spring and a damper on the arm's own inertia: the target impedance with M_d = M(q), which needs no tau_ext.

        tau = M(q) a_d + C(q, v) v_d + g(q) + friction(v) + D(q)(v_d - v) + K(q_d - q) - rejected

    With e = q - q_d the arm obeys M ë + (C + D) ė + K e = tau_ext + w - rejected, with w what the model does not know:
    a constant force moves it by K⁻¹·tau_ext, measured or not. From ½ ėᵀM ė + ½ eᵀK e it is passive towards whatever it
    touches, for any D(q) > 0, as long as nothing is rejected.

    The price of not measuring: w acts like a push. A payload that is not in the model lets the arm sag by K⁻¹·w, and no
    gain of this law changes that. With `reject` an observer of the momentum compensates tau_ext + w up to that bound:
    friction and model error below it leave no error, a push has to exceed it, and then moves the arm by
    K⁻¹·(tau_ext + w - reject).

    Attributes:
        arm: The controller's model of the arm.
        stiffness: K, a scalar, a vector (nv,) or a symmetric positive definite matrix [N·m/rad or N/m].
        damping_ratio: ζ of the vibration modes of (M(q), K) in every posture; None where the damping is given.
        damping: D, in the same three forms [N·m·s/rad or N·s/m]; None where a damping ratio is used.
        dt: Control period [s].
        reject: Torque that counts as friction and model error, shape (nv,) [N·m or N].
        limits: Limits of the torque; None for none.

    Raises:
        ParameterError: A value that is not positive, or both dampings given.
        DimensionError: A value for another number of joints.

    References:
        B. Paden, R. Panja, Globally asymptotically stable 'PD+' controller for robot manipulators, International
        Journal of Control 47, 1988.
        A. Albu-Schäffer, C. Ott, U. Frese, G. Hirzinger, Cartesian impedance control of redundant robots: recent
        results with the DLR-light-weight-arms, ICRA 2003 (the damping).
    """

    arm: ArmModel
    stiffness: Array
    damping_ratio: float | None
    damping: Array | None
    dt: float
    reject: Array
    limits: Limits | None
    _observer: MomentumObserver | None

    def __init__(
        self,
        arm: ArmModel,
        stiffness: ArrayLike = 100.0,
        damping_ratio: float | None = None,
        *,
        damping: ArrayLike | None = None,
        dt: float = 1e-3,
        reject: ArrayLike = 0.0,
        limits: Limits | ArrayLike | None = None,
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        reject = not_negative("reject", reject, arm.nv)
        target = Impedance(1.0, damping, stiffness, damping_ratio=damping_ratio)
        _, D, K = target.matrices(arm.nv)
        set_fields(
            self,
            arm=arm,
            stiffness=K,
            damping_ratio=target.damping_ratio,
            damping=None if damping is None else D,
            dt=dt,
            reject=reject,
            limits=as_limits(limits, arm.nv),
            _observer=MomentumObserver(arm, dt=dt) if reject.any() else None,
        )

    @property
    def impedance(self) -> Impedance:
        """The target at `arm.neutral`; in other postures its mass is the arm's there."""
        q = self.arm.neutral
        return Impedance(self.arm.mass_matrix(q), self._damping(q), self.stiffness)

    def init(self) -> CompliantState:
        """Return the state before the first tick."""
        observer = None if self._observer is None else self._observer.init()
        return CompliantState(0, observer, np.zeros(self.arm.nv))

    def _step(
        self, state: CompliantState, given: Measured
    ) -> tuple[ControllerOutput, CompliantState]:
        zero = np.zeros(self.arm.nv)
        q, v, desired, _ = check_measurements(self.arm, given._replace(tau_ext=zero))
        e1, e2 = self.arm.raw_dynamics.difference(q, desired.q), desired.v - v
        tau = self._spring_and_damper(q, v, desired, e1, e2)
        observer = state.observer
        if self._observer is not None and observer is not None:
            unexplained, observer = self._observer.step(observer, q, v, state.tau, zero)
            tau = tau - split(unexplained, self.reject).rejected
        mass_matrix = self.arm.raw_dynamics.mass_matrix
        before = state.tau if state.ticks else None
        tau, saturated, rate_limited, _ = (self.limits or Limits()).allocate(
            tau, lambda: mass_matrix(q), before=before, dt=self.dt
        )
        output = ControllerOutput(
            tau,
            *(desired.q, desired.v, desired.a, e1, e2, zero),
            u=zero.copy(),
            q_e=zero.copy(),
            v_e=zero.copy(),
            premise_holds=np.zeros(len(tau), dtype=np.bool_),
            **flags(len(tau), saturated=saturated, rate_limited=rate_limited),
        )
        return output, CompliantState(state.ticks + 1, observer, tau.copy())

    def _elapsed(self, state: CompliantState, period: float) -> CompliantState:
        checked_period(period, self.dt)
        return state

    def handover(self, state: CompliantState, now: Situation) -> CompliantState:
        """Return the state with which the arm is taken over as it is now: nothing observed yet, the torque that acts.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        return self.init()._replace(ticks=max(state.ticks, 1), tau=np.array(now.tau))

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im = M(q)(a_d - a) + (C + D) e2 + K e1, which is what acts beyond the model, less what is rejected.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        dynamics = self.arm.raw_dynamics
        q, v = dynamics.integrate(output.q_r, -output.e1), output.v_r - output.e2
        inertial = dynamics.mass_matrix(q) @ (output.a_r - a)
        velocity = coriolis_torque(dynamics, q, v, output.e2) + self._damping(q) @ output.e2
        e_im: Array = inertial + velocity + self.stiffness @ output.e1
        return e_im

    def _spring_and_damper(
        self, q: Array, v: Array, desired: Reference, e1: Array, e2: Array
    ) -> Array:
        """Torque of the model, spring and damper, shape (nv,)."""
        dynamics = self.arm.raw_dynamics
        gravity = dynamics.bias(q, np.zeros_like(v)) + dynamics.friction(v)
        feedforward = dynamics.mass_matrix(q) @ desired.a + coriolis_torque(
            dynamics, q, v, desired.v
        )
        tau: Array = feedforward + gravity + self._damping(q) @ e2 + self.stiffness @ e1
        return tau

    def _damping(self, q: Array) -> Array:
        """D(q) = 2ζ·L(L⁻¹KL⁻ᵀ)^½Lᵀ with M = LLᵀ: every mode of (M(q), K) has the damping ratio ζ; shape (nv, nv)."""
        if self.damping is not None or self.damping_ratio is None:
            return np.asarray(self.damping)
        L = np.linalg.cholesky(self.arm.raw_dynamics.mass_matrix(q))
        half = np.linalg.solve(L, self.stiffness)
        values, modes = np.linalg.eigh(np.linalg.solve(L, half.T))
        LV = L @ modes
        D: Array = (LV * (2.0 * self.damping_ratio * np.sqrt(np.maximum(values, 0.0)))) @ LV.T
        return D


class SensorlessState(NamedTuple):
    """What a `SensorlessController` remembers.

    Attributes:
        inner: State of the controller inside.
        sensor: State of the observer.
        tau: Torque of the tick before, shape (nv,) [N·m or N].
    """

    inner: Any
    sensor: Any
    tau: Array


@dataclass(frozen=True, eq=False, init=False)
class SensorlessController(
    SensorlessBase[SensorlessState, ControllerOutput],
    ControllerWrapper[SensorlessState, ControllerOutput],
):
    """A controller that needs tau_ext, with an observer in place of the force sensor.

    `SensorlessController(ImpedanceController(arm))` renders M_d, D_d and K_d from position and velocity alone. The
    observer takes for a push whatever the model does not explain; of that, the controller inside gets what exceeds
    `reject`, and rejects the rest as it rejects any disturbance. The shaped inertia costs bandwidth: forces faster than
    the observer are resisted.

    Attributes:
        controller: The controller inside; an `ImpedanceController` or a baseline.
        sensor: What estimates tau_ext; a `MomentumObserver` on the controller's model by default.
        reject: Torque that counts as friction and model error, shape (nv,) [N·m or N].

    Raises:
        ParameterError: `reject` is negative.
        DimensionError: It is for another number of joints.
    """

    sensor: Sensor[Any]
    reject: Array

    def __init__(
        self,
        controller: WrappableController[Any],
        sensor: Sensor[Any] | None = None,
        *,
        reject: ArrayLike = 0.0,
    ) -> None:
        arm = controller.arm
        set_fields(
            self,
            controller=controller,
            sensor=MomentumObserver(arm, dt=controller.dt) if sensor is None else sensor,
            reject=not_negative("reject", reject, arm.nv),
        )

    def init(self) -> SensorlessState:
        """Return the state before the first tick: nothing felt yet."""
        return SensorlessState(self.controller.init(), self.sensor.init(), np.zeros(self.arm.nv))

    def handover(self, state: SensorlessState, now: Situation) -> SensorlessState:
        """Return the state with which the arm is taken over as it is now: nothing felt yet, the torque that acts.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        inner = super().handover(state, now).inner
        return SensorlessState(inner, self.sensor.init(), np.array(now.tau))

    def _step(
        self, state: SensorlessState, given: Measured
    ) -> tuple[ControllerOutput, SensorlessState]:
        zero = np.zeros(self.arm.nv)
        q, v, reference, _ = check_measurements(self.arm, given._replace(tau_ext=zero))
        unexplained, sensor = self.sensor.step(state.sensor, q, v, state.tau, zero)
        felt = split(unexplained, self.reject).felt
        output, inner = self.controller.step(state.inner, q, v, reference, felt)
        return output, SensorlessState(inner, sensor, output.tau.copy())
