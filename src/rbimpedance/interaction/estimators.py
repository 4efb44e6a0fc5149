"""tau_ext without a force sensor: momentum observers, in the form of a `Sensor`.

Both measure the change of the arm's momentum that motors and model do not explain. Model errors are therefore
estimated as contact: an estimator cannot distinguish a payload from a hand that pulls at the tool (figures in
docs/interaction.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive, positive_number
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..law.super_twisting import SuperTwisting
from ..robot.arm_model import ArmModel
from .observers import ObserverState, SuperTwistingDisturbanceObserver

_USUAL_GAIN = 100.0  # rad/s: 16 Hz, faster than a hand pushes
_USUAL_GAIN_TIMES_PERIOD = 0.1


class MomentumState(NamedTuple):
    """What the momentum observer remembers of the tick before.

    Attributes:
        v: Velocity, shape (nv,) [rad/s or m/s], or None before the first tick.
        M: Mass matrix, shape (nv, nv).
        bias: bias(q, v), shape (nv,) [N·m or N].
        r: Estimate, shape (nv,) [N·m or N].
    """

    v: Array | None
    M: Array
    bias: Array
    r: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class MomentumObserver:
    """Generalised-momentum observer (De Luca and Mattone): r is tau_ext through a first-order low-pass.

        r = K·[p - ∫(tau + Cᵀv - g - friction + r) dt],    p = M v    ⟹    ṙ = K·(tau_ext - r)

    Sampled, ∫(ṗ - Cᵀv)dt = ∫M dv goes by the trapezoidal rule, so that Cᵀv is not needed, and the low-pass is exact for
    a torque that is constant over the period:

        r⁺ = e^(-K h)·r + (1 - e^(-K h))·w,    w = mean over the period of M a + bias - tau.

    A slow torque is followed late by 1/K; see `delay`. Neither acceleration nor an inverse of M is needed.

    Attributes:
        arm: The model that the torque is measured against.
        gain: K, the bandwidth of each joint, scalar or (nv,); 100 by default, less where 10 periods are longer
            than that allows [rad/s].
        dt: Control period h [s].

    Raises:
        ParameterError: A gain or dt that is not positive.
        DimensionError: Gains for another number of joints.

    References:
        A. De Luca, R. Mattone, Actuator failure detection and isolation using generalized momenta, ICRA 2003.
    """

    arm: ArmModel
    gain: Array
    dt: float

    def __init__(self, arm: ArmModel, gain: ArrayLike | None = None, dt: float = 1e-3) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        if gain is None:
            gain = min(_USUAL_GAIN, _USUAL_GAIN_TIMES_PERIOD / dt)
        set_fields(self, arm=arm, gain=positive("gain", gain, arm.nv), dt=dt)

    @property
    def delay(self) -> Array:
        """How late a ramp is followed, shape (nv,) [s]: h/(1 - e^(-K h)) - h/2, which tends to 1/K for small h."""
        return self.dt / -np.expm1(-self.gain * self.dt) - self.dt / 2.0

    def init(self) -> MomentumState:
        """Return the state before the first tick: no torque seen."""
        zero = np.zeros(self.arm.nv)
        return MomentumState(None, np.zeros((self.arm.nv, self.arm.nv)), zero, zero)

    def step(
        self,
        state: MomentumState,
        q: Array,
        v: Array,
        tau: Array,
        tau_ext: Array,
        period: float | None = None,
    ) -> tuple[Array, MomentumState]:
        """Return the estimate; see `Sensor.step`. tau_ext is not looked at.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            tau: Torque that was sent since the tick before, shape (nv,) [N·m or N].
            tau_ext: Not used.
            period: Measured time since the tick before; dt by default [s].
        """
        del tau_ext
        dynamics, h = self.arm.raw_dynamics, self.dt if period is None else period
        M, bias = dynamics.mass_matrix(q), dynamics.bias(q, v)
        r = state.r
        if state.v is not None:
            inertial = (M + state.M) @ (v - state.v) / (2.0 * h)
            w = inertial + (bias + state.bias) / 2.0 - tau
            r = r - np.expm1(-self.gain * h) * (w - r)
        return r.copy(), MomentumState(np.array(v), M, bias, r)


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class SuperTwistingMomentumObserver:
    """The same momentum balance, closed by super-twisting: no low-pass where abs(dtau_ext/dt) < k2.

    `SuperTwistingDisturbanceObserver` with no torque measured: all of the disturbance is taken for tau_ext. It finds a
    torque in finite time and follows a ramp with a lag of about a period where the momentum observer lags by 1/K; noise
    on the velocity passes more freely. At an impact tau_ext jumps, and the observer catches up at a rate of about k2.

    Attributes:
        arm: The model that the torque is measured against.
        reaching: Gains and scheme; k1 in (N·m/s)^½, k2 in N·m/s.
        dt: Control period [s].

    Raises:
        ParameterError: dt is not a positive number.
        DimensionError: Gains for another number of joints.

    References:
        G. Garofalo, N. Mansfeld, J. Jankowski, C. Ott, Sliding mode momentum observers for estimation of external
        torques and joint acceleration, ICRA 2019.
    """

    arm: ArmModel
    reaching: SuperTwisting
    dt: float
    _observer: SuperTwistingDisturbanceObserver

    def __init__(self, arm: ArmModel, reaching: SuperTwisting, dt: float) -> None:
        observer = SuperTwistingDisturbanceObserver(arm, reaching, dt)
        set_fields(self, arm=arm, reaching=reaching, dt=observer.dt, _observer=observer)

    def init(self) -> ObserverState:
        """Return the state before the first tick: no torque seen."""
        return self._observer.init()

    def step(
        self, state: ObserverState, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, ObserverState]:
        """Return the estimate; see `Sensor.step`. tau_ext is not looked at."""
        estimate, following = self._observer.step(state, q, v, tau, np.zeros_like(tau_ext))
        return estimate.w, following
