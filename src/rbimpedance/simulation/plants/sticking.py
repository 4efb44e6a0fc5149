"""Rigid links with dry friction that sticks: Coulomb's set-valued law with Stribeck's rise towards standstill."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import Array, size
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...control.backends import is_available
from ...interaction import Interaction
from ...robot.arm_model import ArmModel
from .dry_friction import ROUNDS, rub, sliding_friction
from .protocol import Motion
from .rigid import LinksAsState


@functools.cache
def _compiled_rub() -> Callable[..., Any]:
    """The same compiled, where that is possible."""
    if not is_available("pinocchio"):
        return rub
    from ..compiled.friction import rub_kernel  # noqa: PLC0415 (Numba is loaded when needed)

    return rub_kernel()


@brief_repr("arm", "stribeck")
@dataclass(frozen=True, eq=False, init=False)
class StickingPlant(LinksAsState):
    """Rigid links whose dry friction holds them at rest, as that of gears does.

    The arm's own friction, tau_c and d of every joint, acts as

        d·v + tau_c·(1 + stribeck·e^(-(v/0.05)²))·sgn(v),    sgn(0) anything from -1 to 1,

    where `RigidPlant` smooths the sign over 0.05 rad/s, so that an arm that is pushed creeps. Steps are semi-implicit
    Euler with the impulse of friction at their end, which is stable for every friction. Its state is the links' motion.

    Attributes:
        arm: The links, with their friction.
        stribeck: How much larger dry friction is at rest than in motion, relative.

    Raises:
        ParameterError: A rise below 0.

    References:
        B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods
        for the control of machines with friction, Automatica 30, 1994.
        J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988 (impulses at a step's end).
    """

    arm: ArmModel
    stribeck: float
    _free: ArmModel

    def __init__(self, arm: ArmModel, stribeck: float = 0.2) -> None:
        free = arm.with_friction(0.0, 0.0)
        set_fields(self, arm=arm.copy(), stribeck=size("stribeck", stribeck), _free=free)

    def acceleration(self, state: Motion, tau: Array, tau_ext: Array) -> Array:
        """Return the acceleration without the friction of a joint at rest; see `Plant.acceleration`."""
        sliding = sliding_friction(self.arm.coulomb, self.arm.viscous, state.v)
        return self._free.raw_dynamics.forward_dynamics(state.q, state.v, tau + tau_ext - sliding)

    def step(
        self, state: Motion, tau: Array, environment: Interaction, t: float, h: float
    ) -> Motion:
        """Return the state after one step; see `Plant.step`."""
        arm, dynamics = self.arm, self._free.raw_dynamics
        torque = tau + environment.torque(arm, t, state.q, state.v)
        A = dynamics.inverse_mass_matrix(state.q)
        v = state.v + h * (A @ (torque - dynamics.bias(state.q, state.v)))
        work = np.empty(arm.nv)
        _compiled_rub()(v, A, h * arm.coulomb, h * arm.viscous, work, self.stribeck, ROUNDS)
        return Motion(dynamics.integrate(state.q, h * v), v)
