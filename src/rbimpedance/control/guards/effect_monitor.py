"""Finds that torque has no effect: brakes are on, a drive is off, or something blocks the arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..._common.arrays import Array, BoolArray
from ..._common.frozen import set_fields
from .joint_checks import CARRIED, FOUND_STUCK, IMPULSE, SAME, STUCK, checks

STICTION = 0.2
"""Torque that dry friction may hold on a joint at rest, in effort limits."""

SLOWEST = 10.0
"""Acceleration that the torque beyond gravity has to ask for [rad/s² or m/s²], also where there is no effort limit."""

MISSED = 5.0
"""Way that the joint should have gone by that torque, in ways within which it counts as at rest."""


MEMORY = 0.3
"""Time constant in which the impulse of a torque without effect is forgotten [s]."""


class EffectState(NamedTuple):
    """What the monitor remembers of every joint since it came to rest.

    Attributes:
        joints: Row by row, shape (8, nv):
            how far it is from where it came to rest [rad or m];
            the least net torque that it has had there [N·m or N];
            speed that it should have by the torque beyond that and friction [rad/s or m/s];
            how far it should have gone [rad or m];
            net torque beyond the least, summed over time, older shares forgotten in `MEMORY` [N·m·s or N·s];
            for how long its position has been bitwise constant [s];
            whether it has stayed there since torque had no effect on some joint, 0 or 1;
            whether torque was found to have no effect on it at this tick, 0 or 1.
    """

    joints: Array

    @property
    def carried(self) -> Array:
        """The least net torque that the joint has had at rest, shape (nv,) [N·m or N]."""
        carried: Array = self.joints[CARRIED]
        return carried

    @property
    def impulse(self) -> Array:
        """Net torque beyond that, summed over time, shape (nv,) [N·m·s or N·s]."""
        impulse: Array = self.joints[IMPULSE]
        return impulse

    @property
    def stuck(self) -> BoolArray:
        """Whether the joint has stayed at rest since torque had no effect on some joint, shape (nv,), bool."""
        stuck: BoolArray = self.joints[STUCK] != 0.0
        return stuck

    @property
    def constant(self) -> float:
        """For how long a position has been bitwise constant where torque has no effect; 0 where none is [s]."""
        return float((self.joints[SAME] * self.joints[STUCK]).max())


@dataclass(frozen=True, eq=False, init=False)
class EffectMonitor:
    """Compares the motion that the torque should give with the motion that is measured.

    The net torque of a joint is tau + tau_ext - bias. A joint is at rest as long as it stays within `travel` of a
    point: flicker of the encoder and noise do not end that. While it rests, the net torque may grow by what dry
    friction holds (`STICTION` effort limits, and at least what gives `SLOWEST`). What is beyond should accelerate the
    joint by excess/M_jj. The torque has no effect once that adds up to `MISSED` times `travel`.

    What a joint carries when it comes to rest, a payload or a person, is no excess, nor is a torque of the environment
    that is measured. Where one grows that is not measured, and the controller holds the joint within `travel` against
    it, q and v cannot tell it from a brake. A guard therefore lets the torque of the stuck joint go back to what it
    carried: if a brake holds it nothing moves, and a load moves it, which ends the rest.

    Attributes:
        travel: Within which a joint is at rest [rad or m].
        effort: Effort limits, shape (nv,) [N·m or N]; +inf where there is none.
    """

    travel: float
    effort: Array
    _friction: Array

    def __init__(self, travel: float, effort: Array) -> None:
        friction = np.where(np.isfinite(effort), STICTION * effort, 0.0)
        set_fields(self, travel=travel, effort=effort, _friction=friction)

    def init(self) -> EffectState:
        """Return the state before the first tick."""
        return EffectState(np.zeros((8, len(self.effort))))

    def look(
        self, state: EffectState, moved: Array, net: Array, inertia: Array, period: float
    ) -> tuple[BoolArray | None, EffectState]:
        """Return on which joints torque is found to have no effect at this tick, shape (nv,), bool; None for none.

        Args:
            state: From `init` or from the tick before.
            moved: Motion since the tick before, shape (nv,) [rad or m].
            net: tau + tau_ext - bias over that time, shape (nv,) [N·m or N].
            inertia: Diagonal of M, shape (nv,).
            period: The time [s].
        """
        look, made = checks()[2], np.empty_like(state.joints)
        friction = np.maximum(self._friction, SLOWEST * inertia)
        settings = period, self.travel, MISSED * self.travel, MEMORY
        is_found = look(friction, state.joints, made, moved, net, inertia, *settings)
        return (made[FOUND_STUCK] > 0.0 if is_found else None), EffectState(made)
