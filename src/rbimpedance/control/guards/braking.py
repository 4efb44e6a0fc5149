"""The torques of a guard while the controller is away: to hold, to stop, to take back, to vanish."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._common.arrays import Array
from ...law.limits import Limits
from ...robot.arm_model import ArmModel
from .belief import Belief
from .effect_monitor import EffectState


@dataclass(frozen=True, eq=False)
class Braking:
    """Torques that bring an arm to rest.

    Attributes:
        arm: The arm.
        limits: Limits of the torque, one number per joint.
        rate: λ, at which a motion dies away [1/s].
        vanishing: Time constant in which the torque of a blind arm decays [s].
        dt: Control period [s].
    """

    arm: ArmModel
    limits: Limits
    rate: float
    vanishing: float
    dt: float

    def within(self, tau: Array, before: Array, is_free: bool = False) -> Array:
        """Return the nearest torque that may leave; one that is not finite is replaced by the decaying one before.

        Args:
            tau: Wanted torque, shape (nv,) [N·m or N].
            before: Torque of the tick before, shape (nv,).
            is_free: The rate limit does not apply: what the motors gave before is not known.
        """
        limits, change = self.limits, np.abs(tau - before)
        if (np.abs(tau) <= limits.effort).all() and (change <= limits.rate * self.dt).all():
            return tau
        if not np.isfinite(tau).all():
            tau = self.decay(before, self.dt)
        return limits.nearest(tau, None if is_free else before, self.dt)

    def hold(self, safe: Array, known: Belief, share: float) -> Array:
        """Return tau_safe - share·λ·M v."""
        return safe - share * self.rate * self.arm.raw_dynamics.mass_matrix(known.q) @ known.v

    def stop(self, known: Belief, before: Array) -> Array:
        """Return M(q)(-λ v) + bias(q, v) - r, or, where the limits cut that off, bias(q, 0) - λ·diag(M) v - r.

        The second takes energy from the arm also where it is cut off: each joint is braked by its own torque.

        Args:
            known: The arm.
            before: Torque of the tick before, shape (nv,) [N·m or N].
        """
        dynamics, (q, v, *_) = self.arm.raw_dynamics, known
        wanted = dynamics.inverse_dynamics(q, v, -self.rate * v) - known.r
        if np.array_equal(self.within(wanted, before), wanted):
            return wanted
        inertia = np.diag(dynamics.mass_matrix(q))
        return dynamics.bias(q, np.zeros_like(v)) - self.rate * inertia * v - known.r

    def relax(self, known: Belief, before: Array, tau_ext: Array, effect: EffectState) -> Array:
        """Return the torque on its way to bias(q, v) - tau_ext + carried - λ·impulse.

        The last term brakes an arm that has moved after all, unseen by a frozen sensor: its momentum is the impulse.

        Args:
            known: The arm.
            before: Torque of the tick before, shape (nv,) [N·m or N].
            tau_ext: Measured torque of the environment, shape (nv,).
            effect: What the torque was without effect.
        """
        net = effect.carried - self.rate * effect.impulse
        target = self.arm.raw_dynamics.bias(known.q, known.v) - tau_ext + net
        tau: Array = before - np.expm1(-4.0 * self.rate * self.dt) * (target - before)
        return tau

    def decay(self, before: Array, period: float) -> Array:
        """Return the torque on its way to zero.

        Args:
            before: Torque of the tick before, shape (nv,) [N·m or N].
            period: Time since then [s].
        """
        tau: Array = before * np.exp(-period / self.vanishing)
        return tau
