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


class EffectState(NamedTuple):
    """What the monitor remembers of every joint since it came to rest.

    Attributes:
        strayed: How far it is from where it came to rest, shape (nv,) [rad or m].
        carried: Net torque when it came to rest, shape (nv,) [N·m or N].
        speed: Speed that it should have by the torque since then, shape (nv,) [rad/s or m/s].
        way: How far it should have gone, shape (nv,) [rad or m].
    """

    strayed: Array
    carried: Array
    speed: Array
    way: Array


@dataclass(frozen=True, eq=False, init=False)
class EffectMonitor:
    """Compares the motion that the torque should give with the motion that is measured.

    The net torque of a joint is tau + tau_ext - bias. A joint is at rest as long as it stays within `travel` of a
    point: half a count of flicker and noise do not end that. While it rests, the net torque towards the reference may
    grow by what dry friction holds (`STICTION` effort limits, and at least what gives `SLOWEST`). What is beyond should
    accelerate the joint by excess/M_jj. The torque has no effect once that adds up to `MISSED` times `travel`.

    What a joint carries when it comes to rest, a payload or a person, is no excess. A torque of the environment that is
    measured neither; one that is not measured, as of a wall that the arm presses against with tau_ext = 0, is: the arm
    then does not press more and more. A joint that is held at its reference by a torque that grows is not meant.

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
        return EffectState(zero, zero, zero, zero)

    def look(
        self,
        state: EffectState,
        moved: Array,
        net: Array,
        e1: Array,
        inertia: Array,
        period: float,
    ) -> tuple[BoolArray, EffectState]:
        """Tell on which joints torque has no effect, shape (nv,), bool.

        Args:
            state: From `init` or from the tick before.
            moved: Motion since the tick before, shape (nv,) [rad or m].
            net: tau + tau_ext - bias over that time, shape (nv,) [N·m or N].
            e1: Position error of the controller, shape (nv,) [rad or m].
            inertia: Diagonal of M, shape (nv,).
            period: The time [s].
        """
        strayed = state.strayed + moved
        has_moved = np.abs(strayed) > self.travel
        carried = np.where(has_moved, net, state.carried)
        held = np.where(np.isfinite(self.effort), STICTION * self.effort, 0.0)
        towards = np.where(np.abs(e1) > self.travel / 4.0, np.sign(e1), 0.0)
        excess = towards * (net - carried) - np.maximum(held, SLOWEST * inertia)
        is_pushed = (excess > 0.0) & ~has_moved
        speed = np.where(is_pushed, state.speed + period * excess / inertia, 0.0)
        way = np.where(is_pushed, state.way + period * speed, 0.0)
        following = EffectState(np.where(has_moved, 0.0, strayed), carried, speed, way)
        return way > MISSED * self.travel, following
