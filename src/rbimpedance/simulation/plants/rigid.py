"""Rigid links by Pinocchio's ABA."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._common.arrays import Array
from ..._common.brief import brief_repr
from ...interaction import Interaction
from ...robot.arm_model import ArmModel
from .integrators import INTEGRATORS, Integrator
from .protocol import Motion


class LinksAsState:
    """What plants share whose state is the motion of rigid links, which the encoders are on."""

    arm: ArmModel

    def begin(self, q: Array, v: Array, h: float) -> Motion:
        """Return the state at the start of a run; see `Plant.begin`."""
        del h
        return Motion(q, v)

    def motion(self, state: Motion) -> Motion:
        """Return how the links move: the state itself."""
        return state

    def measured(self, state: Motion) -> Motion:
        """Return how the links move: the encoders are on them."""
        return state

    def external_torque(self, state: Motion, environment: Interaction, t: float) -> Array:
        """Return what the environment does; see `Plant.external_torque`."""
        return environment.torque(self.arm, t, state.q, state.v)


@brief_repr()
@dataclass(frozen=True, eq=False)
class RigidPlant(LinksAsState):
    """Rigid links, moved by ABA; the plant that `simulate` makes from an `ArmModel`. Its state is their motion.

    Attributes:
        arm: The links.
        integrator: "semi-implicit" (Euler, first order) or "rk4" (fourth order).
        friction_at_end: Whether semi-implicit Euler takes friction at the end of its step, where it is stable however
            stiff the friction is.
    """

    arm: ArmModel
    integrator: Integrator = "semi-implicit"
    friction_at_end: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.arm.copy())

    def acceleration(self, state: Motion, tau: Array, tau_ext: Array) -> Array:
        """Return ABA's acceleration; see `Plant.acceleration`."""
        return self.arm.raw_dynamics.forward_dynamics(state.q, state.v, tau + tau_ext)

    def step(
        self, state: Motion, tau: Array, environment: Interaction, t: float, h: float
    ) -> Motion:
        """Return the state after one step of the integrator; see `Plant.step`."""
        dynamics = self.arm.raw_dynamics

        def acceleration(t: float, q: Array, v: Array) -> Array:
            if not np.isfinite(q).all():  # a stage of a diverging step, which the run ends
                return np.full(self.arm.nv, np.nan)
            torque = tau + environment.torque(self.arm, t, q, v)
            if self.friction_at_end:
                return dynamics.damped_forward_dynamics(q, v, torque, h)
            return dynamics.forward_dynamics(q, v, torque)

        with np.errstate(over="ignore", invalid="ignore"):
            return Motion(
                *INTEGRATORS[self.integrator](dynamics, acceleration, t, state.q, state.v, h)
            )
