"""Speed and disturbance from counted positions: an observer that knows the model, the delay and the lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import (
    Array,
    not_negative,
    per_joint,
    positive,
    positive_number,
    whole_number,
)
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...law.lag import Lag, lag_of, lagged
from ...robot.arm_model import ArmModel
from ...trajectories import Reference

# --- formulas, for all joints at once or for one ------------------------------------------------------------------


def correction(innovation: Array, bandwidth: Array, h: float) -> tuple[Array, Array, Array]:
    """Return what the innovation adds to position, speed and acceleration: three poles at e^(-bandwidth·h).

    Args:
        innovation: Measured less predicted position.
        bandwidth: Of the observer [rad/s].
        h: Period [s].
    """
    p = np.exp(-bandwidth * h)
    to_position = 1.0 - p**3
    to_speed = 1.5 * (1.0 - p) ** 2 * (1.0 + p) / h
    to_acceleration = (1.0 - p) ** 3 / h**2
    return to_position * innovation, to_speed * innovation, to_acceleration * innovation


def moved(v: Array, a: Array, h: float) -> tuple[Array, Array]:
    """Return the step of the position and the speed after h under a constant acceleration.

    Args:
        v: Speed.
        a: Acceleration.
        h: Time [s].
    """
    return h * v + 0.5 * h * h * a, v + h * a


# --- the observer -------------------------------------------------------------------------------------------------


class JointEstimate(NamedTuple):
    """What the observer expects at the tick to come.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
        disturbance: Torque that the model misses, shape (nv,) [N·m or N].
        torque: Of the motors, behind delay and lag, shape (nv,) [N·m or N].
        pending: Torques that were sent and do not act yet, the oldest first, shape (delay, nv) [N·m or N].
    """

    q: Array
    v: Array
    disturbance: Array
    torque: Array
    pending: Array


class Estimate(NamedTuple):
    """What is known at a tick, after its measurement.

    Attributes:
        state: Corrected by the measurement.
        M: Mass matrix of the model, shape (nv, nv).
        bias: Of the model, shape (nv,) [N·m or N].
    """

    state: JointEstimate
    M: Array
    bias: Array


@brief_repr("arm", "bandwidth", "dt", "lag", "delay")
@dataclass(frozen=True, eq=False, init=False)
class ExtendedStateObserver:
    """Extended-state observer on the arm's model: position, speed and the torque that the model misses.

    Between ticks the model moves on under the torque that the motors give by now: what was sent `delay` ticks ago,
    behind a first-order lag. With L̄ its mean over the period and h the period,

        a = M⁻¹(L̄ + tau_ext + d - friction - bias),    q ← q (+) (h·v + h²/2·a),    v ← v + h·a,

    and a measurement corrects all three with ν = q_m (-) q:

        q ← q (+) l₁·ν,    v ← v + l₂·ν,    d ← d + M·l₃·ν,

    where l₁ = 1 - p³, l₂ = 1.5·(1 - p)²(1 + p)/h and l₃ = (1 - p)³/h² put the poles of the error at p = e^(-ω·h). A
    disturbance is followed by 3/ω late. A count of c in the position moves the estimated speed by l₂·c at once, where
    a difference moves it by c/h: at ω·h = 0.1 that is 40 times less.

    Attributes:
        arm: The model.
        bandwidth: ω, shape (nv,) [rad/s].
        dt: Period h [s].
        lag: Time constant of the torque, shape (nv,) [s].
        delay: Ticks from a torque to its action.

    Raises:
        ParameterError: A bandwidth or period that is not positive, a lag below 0, a delay that is no whole number.
        DimensionError: Numbers for another number of joints.

    References:
        Z. Gao, Scaling and bandwidth-parameterization based controller tuning, ACC 2003 (one bandwidth for all gains).
        R. Miklosovic, A. Radke, Z. Gao, Discrete implementation and generalization of the extended state observer,
        ACC 2006 (the sampled form).
    """

    arm: ArmModel
    bandwidth: Array
    dt: float
    lag: Array
    delay: int
    _lag: Lag

    def __init__(
        self,
        arm: ArmModel,
        bandwidth: ArrayLike,
        dt: float = 1e-3,
        *,
        lag: ArrayLike = 0.0,
        delay: int = 0,
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        lag = not_negative("lag", lag, arm.nv)
        set_fields(
            self,
            arm=arm,
            bandwidth=per_joint("bandwidth", positive("bandwidth", bandwidth), arm.nv),
            dt=dt,
            lag=lag,
            delay=whole_number("delay", delay),
            _lag=lag_of(lag, dt),
        )

    def init(self, q: Array, v: Array | None = None, tau: Array | None = None) -> JointEstimate:
        """Return the state of an arm that has been held: no disturbance, and the same torque for long.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,); at rest by default [rad/s or m/s].
            tau: Torque, shape (nv,); what holds the model by default [N·m or N].
        """
        zero = np.zeros(self.arm.nv)
        tau = self.arm.raw_dynamics.bias(q, zero) if tau is None else np.array(tau)
        v = zero if v is None else np.array(v)
        return JointEstimate(np.array(q), v, zero, tau, np.tile(tau, (self.delay, 1)))

    def innovation(self, state: JointEstimate, q: Array) -> Array:
        """Return a measured less the expected configuration, shape (nv,) [rad or m].

        Args:
            state: From `init` or `predict`.
            q: Measured configuration, shape (nq,).
        """
        return self.arm.raw_dynamics.difference(state.q, q)

    def correct(
        self, state: JointEstimate, innovation: Array, bandwidth: Array | None = None
    ) -> Estimate:
        """Return what is known after a measurement.

        Args:
            state: From `init` or `predict`.
            innovation: Of the measurement, shape (nv,) [rad or m].
            bandwidth: ω at this tick, shape (nv,); the observer's own by default [rad/s].
        """
        dynamics, omega = self.arm.raw_dynamics, self.bandwidth if bandwidth is None else bandwidth
        step, dv, da = correction(innovation, omega, self.dt)
        q, v = dynamics.integrate(state.q, step), state.v + dv
        M, bias = dynamics.mass_matrix(q), dynamics.bias(q, v)
        known = state._replace(q=q, v=v, disturbance=state.disturbance + M @ da)
        return Estimate(known, M, bias)

    def ahead(self, estimate: Estimate, torque: Array) -> tuple[Array, Array]:
        """Return configuration and velocity when the torque of this tick begins to act, `delay` ticks on.

        Args:
            estimate: From `correct`.
            torque: All torque besides the motors', the disturbance and the bias, shape (nv,) [N·m or N].
        """
        state = estimate.state
        q, v, L = state.q, state.v, state.torque
        for tau in state.pending:
            q, v, L = self._moved(estimate, q, v, L, tau, torque)
        return q, v

    def reference_ahead(self, reference: Reference) -> Reference:
        """Return the reference `delay` ticks on, by its acceleration: what `ahead` is compared with."""
        late, (q, v, a) = self.delay * self.dt, reference
        step: Array = late * v + 0.5 * late * late * a
        return Reference(self.arm.raw_dynamics.integrate(q, step), np.asarray(v + late * a), a)

    def predict(self, estimate: Estimate, tau: Array, torque: Array) -> JointEstimate:
        """Return what is expected at the next tick.

        Args:
            estimate: From `correct`.
            tau: Torque that is sent now, shape (nv,) [N·m or N].
            torque: As for `ahead`.
        """
        state = estimate.state
        pending = np.concatenate([state.pending, tau[None]])
        q, v, L = self._moved(estimate, state.q, state.v, state.torque, pending[0], torque)
        return JointEstimate(q, v, state.disturbance, L, pending[1:])

    def _moved(
        self, estimate: Estimate, q: Array, v: Array, L: Array, tau: Array, torque: Array
    ) -> tuple[Array, Array, Array]:
        """Configuration, velocity and motor torque a period on, while tau is what the motors are to give."""
        mean, L = lagged(L, tau, *self._lag)
        total = mean + torque + estimate.state.disturbance - estimate.bias
        a = np.asarray(np.linalg.solve(estimate.M, total), dtype=np.float64)
        step, v = moved(v, a, self.dt)
        return self.arm.raw_dynamics.integrate(q, step), v, L
