"""Pinocchio's algorithms with joint friction added; raw_dynamics: hot loops call them once inputs have been checked."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin

from .._common.arrays import Array

COULOMB_SMOOTHING = 0.05
"""Speed v_c at which smoothed Coulomb friction tau_c·tanh(v / v_c) reaches 76 % of tau_c [rad/s or m/s]."""

WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
"""World axes at the frame's origin."""

LOCAL_AXES = pin.ReferenceFrame.LOCAL
"""The frame's own axes at its origin."""


class PinocchioDynamics:
    """Pinocchio's RNEA, CRBA and ABA with joint friction added; inputs are not checked.

    Friction, which `pin.rnea` and `pin.aba` leave out, is

        tau_f(v) = d·v + tau_c·tanh(v / v_c)

    with d the viscous and tau_c the Coulomb coefficient of the model.

    Each instance owns its `pin.Data` and returns copies; two threads must not share one.

    Attributes:
        model: The Pinocchio model.
        frame_ids: Index of every frame by name; where a link shares its name with a joint, that of the link.
        rnea: Pinocchio's own RNEA of (q, v, a): without friction, its result valid until the next call.
        aba: Forward dynamics of (q, v, torque), likewise: Pinocchio's own ABA.
    """

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        frames = sorted(enumerate(model.frames), key=lambda item: item[1].type == pin.BODY)
        self.frame_ids = {frame.name: i for i, frame in frames}
        self._data = model.createData()
        self.rnea = partial(pin.rnea, model, self._data)
        self.aba: Callable[..., Array] = partial(pin.aba, model, self._data)
        self._viscous = np.array(model.damping)
        self._coulomb = np.array(model.upperDryFrictionLimit)
        self._has_friction = bool(self._viscous.any() or self._coulomb.any())

    def friction(self, v: Array) -> Array:
        """Friction torque that opposes v, shape (nv,), [N·m or N]."""
        torque: Array = self._viscous * v + self._coulomb * np.tanh(v / COULOMB_SMOOTHING)
        return torque

    def mass_matrix(self, q: Array) -> Array:
        """M(q) with the armature on its diagonal, shape (nv, nv)."""
        return np.array(pin.crba(self.model, self._data, q))

    def inverse_mass_matrix(self, q: Array) -> Array:
        """M(q)⁻¹, armature included, shape (nv, nv)."""
        return np.array(pin.computeMinverse(self.model, self._data, q))

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """M a + bias by one RNEA, shape (nv,)."""
        tau = np.array(pin.rnea(self.model, self._data, q, v, a))
        return tau + self.friction(v) if self._has_friction else tau

    def bias(self, q: Array, v: Array) -> Array:
        """C v + g + friction, shape (nv,)."""
        tau = np.array(pin.nonLinearEffects(self.model, self._data, q, v))
        return tau + self.friction(v) if self._has_friction else tau

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """Acceleration under the sum of all joint torques, by ABA, shape (nv,)."""
        if self._has_friction:
            torque = torque - self.friction(v)
        return np.array(self.aba(q, v, torque))

    def damped_forward_dynamics(self, q: Array, v: Array, torque: Array, h: float) -> Array:
        """The same with friction taken at the end of a step h, shape (nv,).

        With D(v)·v = tau_f(v), friction at v + h·a is close to tau_f(v) + h·D·a, so that h·D joins the armature:
        (M + h·D) a = torque - bias. The step takes energy out however stiff the friction is.
        """
        armature = self.model.armature.copy()
        self.model.armature = armature + h * self._friction_slope(v)
        a = self.forward_dynamics(q, v, torque)
        self.model.armature = armature
        return a

    def friction_rate(self, q: Array) -> float:
        """The fastest rate at which friction brings a joint to rest, max of (M⁻¹)ᵢᵢ·(d + tau_c/v_c) [1/s]."""
        slope = self._friction_slope(np.zeros(self.model.nv))
        return float((np.diag(np.linalg.inv(self.mass_matrix(q))) * slope).max())

    def friction_rate_bound(self) -> float:
        """A bound on `friction_rate` at any q, since M is at least the armature; infinite without one [1/s]."""
        armature = np.array(self.model.armature)
        if not (armature > 0.0).all():
            return np.inf
        return float((self._friction_slope(np.zeros(self.model.nv)) / armature).max())

    def _friction_slope(self, v: Array) -> Array:
        """D(v) = tau_f(v)/v, shape (nv,)."""
        x = v / COULOMB_SMOOTHING
        secant = np.divide(np.tanh(x), x, out=np.ones_like(x), where=np.abs(x) > 1e-8)
        slope: Array = self._viscous + self._coulomb / COULOMB_SMOOTHING * secant
        return slope

    def jacobian(self, q: Array, frame_id: int) -> Array:
        """Frame Jacobian in world axes at the frame's origin, linear rows first, shape (6, nv)."""
        J = np.array(pin.computeFrameJacobian(self.model, self._data, q, frame_id, WORLD_AXES))
        return J.reshape(6, self.model.nv)  # pin returns a vector where nv = 1

    def frame_placement(self, q: Array, frame_id: int) -> tuple[Array, Array]:
        """Rotation (3, 3) and origin (3,) of a frame in the world."""
        pin.forwardKinematics(self.model, self._data, q)
        placement = pin.updateFramePlacement(self.model, self._data, frame_id)
        return np.array(placement.rotation, order="C"), np.array(placement.translation)

    def difference(self, q0: Array, q1: Array) -> Array:
        """The tangent vector from q0 to q1, q1 (-) q0, shape (nv,)."""
        return np.array(pin.difference(self.model, q0, q1))

    def integrate(self, q: Array, step: Array) -> Array:
        """The configuration q (+) step, shape (nq,)."""
        return np.array(pin.integrate(self.model, q, step))
