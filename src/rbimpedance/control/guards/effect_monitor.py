"""Finds that torque has no effect: brakes are on, a drive is off, or something blocks the arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..._common.arrays import Array, BoolArray
from ..._common.frozen import set_fields

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
        strayed: How far it is from where it came to rest, shape (nv,) [rad or m].
        carried: The least net torque that it has had there, shape (nv,) [N·m or N].
        speed: Speed that it should have by the torque beyond that, shape (nv,) [rad/s or m/s].
        way: How far it should have gone, shape (nv,) [rad or m].
        impulse: Net torque beyond `carried`, summed over time, older shares forgotten in `MEMORY`, shape (nv,) [N·m·s or
            N·s].
        same: For how long the position has been bitwise constant, shape (nv,) [s].
        stuck: Whether it has stayed there since a torque had no effect on some joint, shape (nv,), bool.
    """

    strayed: Array
    carried: Array
    speed: Array
    way: Array
    impulse: Array
    same: Array
    stuck: BoolArray

    @property
    def constant(self) -> float:
        """For how long a position has been bitwise constant where torque has no effect; 0 where none is [s]."""
        return float((self.same * self.stuck).max())


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

    def __init__(self, travel: float, effort: Array) -> None:
        set_fields(self, travel=travel, effort=effort)

    def init(self) -> EffectState:
        """Return the state before the first tick."""
        zero = np.zeros_like(self.effort)
        return EffectState(*[zero] * 6, zero != 0.0)

    def look(
        self, state: EffectState, moved: Array, net: Array, inertia: Array, period: float
    ) -> tuple[BoolArray, EffectState]:
        """Tell on which joints torque is found to have no effect at this tick, shape (nv,), bool.

        Args:
            state: From `init` or from the tick before.
            moved: Motion since the tick before, shape (nv,) [rad or m].
            net: tau + tau_ext - bias over that time, shape (nv,) [N·m or N].
            inertia: Diagonal of M, shape (nv,).
            period: The time [s].
        """
        strayed = state.strayed + moved
        has_moved = np.abs(strayed) > self.travel
        is_less = has_moved | (np.abs(net) < np.abs(state.carried)) & ~state.stuck
        carried = np.where(is_less, net, state.carried)
        friction = np.where(np.isfinite(self.effort), STICTION * self.effort, 0.0)
        excess = np.abs(net - carried) - np.maximum(friction, SLOWEST * inertia)
        is_pushed = excess > 0.0
        speed = np.where(is_pushed, state.speed + period * excess / inertia, 0.0)
        way = np.where(is_pushed, state.way + period * speed, 0.0)
        impulse = state.impulse + period * (net - carried - state.impulse / MEMORY)
        is_stuck = way > MISSED * self.travel
        following = EffectState(
            strayed=np.where(has_moved, 0.0, strayed),
            carried=carried,
            speed=np.where(is_stuck, 0.0, speed),
            way=np.where(is_stuck, 0.0, way),
            impulse=np.where(has_moved, 0.0, impulse),
            same=np.where(moved == 0.0, state.same + period, 0.0),
            stuck=(state.stuck | is_stuck.any()) & ~has_moved,
        )
        return is_stuck, following
