"""What a guard believes of the arm: as measured where a sensor can be used, as predicted for a while where none can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..._common.arrays import Array, is_finite
from ..._common.frozen import set_fields
from ...interaction.estimators import MomentumObserver, MomentumState
from ...robot.arm_model import ArmModel
from ..protocol import LONGEST_PERIOD
from .faults import OperatingRange
from .input_monitor import Reading


class Belief(NamedTuple):
    """The arm as far as it is known.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
        observer: State of the observer of what acts beside the motors.
        blind: For how long some joint has had no usable sensor; 0 where all have one [s].
    """

    q: Array
    v: Array
    observer: MomentumState
    blind: float

    @property
    def r(self) -> Array:
        """Torque that acts beside the motors, as observed, shape (nv,) [N·m or N]."""
        return self.observer.r


@dataclass(frozen=True, eq=False, init=False)
class Believer:
    """Follows the arm through lost measurements.

    - Where q of a joint cannot be used and v can, q is integrated; the other way round, v is the difference of q.
    - Where neither can, ABA from the torque that was sent and r predicts both. A prediction that leaves twice the range
      of the speed is not believed: the joint then stays, and its velocity dies away as e^(-λt).

    Attributes:
        arm: The arm.
        range: The stated range.
        rate: λ, bandwidth of the observer [1/s].
        dt: Control period [s].
    """

    arm: ArmModel
    range: OperatingRange
    rate: float
    dt: float
    _observer: MomentumObserver

    def __init__(self, arm: ArmModel, range: OperatingRange, rate: float, dt: float) -> None:
        observer = MomentumObserver(arm, rate, dt)
        set_fields(self, arm=arm, range=range, rate=rate, dt=dt, _observer=observer)

    def init(self) -> Belief:
        """Return the belief before the first tick."""
        q, v = np.array(self.arm.neutral), np.zeros(self.arm.nv)
        return Belief(q, v, self._observer.init(), 0.0)

    def update(self, belief: Belief, reading: Reading, tau: Array, period: float) -> Belief:
        """Return the belief at a tick.

        Args:
            belief: At the tick before.
            reading: The inputs of this one, checked.
            tau: Torque that was sent in between, shape (nv,) [N·m or N].
            period: Time in between [s].
        """
        sees_q, sees_v = reading.sees_q, reading.sees_v
        if (sees_q | sees_v).all():
            q = self._integrated(belief, reading, reading.v, period)
            return self._observed(belief, Belief(q, reading.v, belief.observer, 0.0), tau, period)
        q_p, v_p = self._predicted(belief, tau, min(period, LONGEST_PERIOD * self.dt))
        way = self.arm.raw_dynamics.difference(belief.q, q_p)
        q = self._integrated(belief, reading, way, period)
        v = np.where(sees_q | sees_v, reading.v, v_p)
        return Belief(q, v, belief.observer._replace(v=None), belief.blind + period)

    def _integrated(self, belief: Belief, reading: Reading, way: Array, period: float) -> Array:
        """Q as measured; where it is not, by the measured velocity; where neither is, by a given way."""
        if reading.sees_q.all():
            return reading.q
        by_v = period * (belief.v + reading.v) / 2.0
        by_q = self.arm.raw_dynamics.difference(belief.q, reading.q)
        way = np.where(reading.sees_v, by_v, way)
        return self.arm.raw_dynamics.integrate(belief.q, np.where(reading.sees_q, by_q, way))

    def _observed(self, before: Belief, belief: Belief, tau: Array, period: float) -> Belief:
        """The belief with what its momentum says of the torque that neither motors nor model explain."""
        _, following = self._observer.step(before.observer, belief.q, belief.v, tau, tau, period)
        if not is_finite(following.r + following.bias):
            following = before.observer._replace(v=None)
        return belief._replace(observer=following)

    def _predicted(self, belief: Belief, tau: Array, period: float) -> tuple[Array, Array]:
        """Where the model says that q and v went."""
        dynamics, torque = self.arm.raw_dynamics, tau + belief.r
        q, v = belief.q, belief.v
        steps = max(round(period / self.dt), 1)
        h = period / steps
        for _ in range(steps):
            v = v + h * dynamics.damped_forward_dynamics(q, v, torque, h)
            if not (np.abs(v) <= 2.0 * self.range.velocity).all():
                return belief.q, belief.v * np.exp(-self.rate * period)
            q = dynamics.integrate(q, h * v)
        return q, v
