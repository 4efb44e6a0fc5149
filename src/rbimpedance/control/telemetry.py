"""What a controller hands out at every tick: the output, and the state for the next tick."""

from __future__ import annotations

from typing import NamedTuple

from .._common.arrays import Array, BoolArray
from .._common.deprecation import warn_renamed
from ..trajectories import Reference

FLAGS = ("saturated", "rate_limited", "clipped", "reference_limited")
"""Fields of `ControllerOutput` that say what held a joint back; a run's log has them, too."""


class ControllerState(NamedTuple):
    """Everything that a controller remembers from one tick to the next.

    Attributes:
        ticks: Number of ticks so far.
        q_e: Position of the impedance filter at this tick, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        z: Integral of the reaching law, shape (nv,) [s].
        x: Modified sliding variable of the implicit scheme, shape (nv,).
        a: Its correction, shape (nv,).
        tau: Torque of the tick before, shape (nv,) [N·m or N].
        tau_ext: Torque of the environment that was measured then, shape (nv,) [N·m or N].
        q_e_before: q_e at that tick; with v_e_before, z_before and tau_ext, all that a late tick starts from again.
        v_e_before: v_e at that tick.
        z_before: z at that tick.
    """

    ticks: int
    q_e: Array
    v_e: Array
    z: Array
    x: Array
    a: Array
    tau: Array
    tau_ext: Array
    q_e_before: Array
    v_e_before: Array
    z_before: Array


class ControllerOutput(NamedTuple):
    """What a tick computed.

    Attributes:
        tau: Motor torque, within the limits, shape (nv,) [N·m or N].
        q_r: Impedance reference q_d (+) q_e, shape (nq,).
        v_r: Its velocity, shape (nv,) [rad/s or m/s].
        a_r: Its acceleration, shape (nv,) [rad/s² or m/s²].
        e1: Position error q_r (-) q, shape (nv,) [rad or m].
        e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        s: Sliding variable, shape (nv,).
        u: Reaching term that tau realises, by the controller's model, shape (nv,) [rad/s² or m/s²].
        q_e: Position of the impedance filter at this tick, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        saturated: Whether the joint is at its torque limit, shape (nv,), bool.
        premise_holds: Whether tau makes the joint's reaching law act in full, by the controller's model, shape (nv,),
            bool: the one premise of Theorem 1 that a controller can see. It is False exactly where a limit withholds
            acceleration. Where it turns True the theorem starts anew, from that tick's s and z; its other premise,
            the bound on the disturbance's rate, stays the user's. Always False where no super-twisting law acts.
        rate_limited: Whether the torque may not change faster, shape (nv,), bool; where it is also at its limit, only
            `saturated` is True.
        clipped: Whether a `BoundedSurface` sees less than the whole error, shape (nv,), bool.
        reference_limited: Whether a `ReferenceGuard` holds the reference back, shape (nv,), bool.
    """

    tau: Array
    q_r: Array
    v_r: Array
    a_r: Array
    e1: Array
    e2: Array
    s: Array
    u: Array
    q_e: Array
    v_e: Array
    saturated: BoolArray
    premise_holds: BoolArray
    rate_limited: BoolArray
    clipped: BoolArray
    reference_limited: BoolArray

    @property
    def guaranteed(self) -> BoolArray:
        """Deprecated: `premise_holds`."""
        warn_renamed("guaranteed", "premise_holds")
        return self.premise_holds

    @property
    def held(self) -> BoolArray:
        """Deprecated: `reference_limited`."""
        warn_renamed("held", "reference_limited")
        return self.reference_limited


class Situation(NamedTuple):
    """The arm as it is when a controller takes it over.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
        a: Acceleration as far as it is known, shape (nv,) [rad/s² or m/s²].
        reference: Desired motion at the tick to come.
        tau: Motor torque that acts, shape (nv,) [N·m or N].
        tau_ext: Torque of the environment, shape (nv,) [N·m or N].
    """

    q: Array
    v: Array
    a: Array
    reference: Reference
    tau: Array
    tau_ext: Array
