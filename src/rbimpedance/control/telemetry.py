"""What a controller hands out at every tick: the output, and the state for the next tick."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from .._common.brief import brief_repr
from .._common.deprecation import warn_renamed


class Channel(NamedTuple):
    """One quantity that a run logs at every tick.

    Attributes:
        name: Its name in `SimulationResult`, in files and, from a controller, in `ControllerOutput`.
        unit: Its unit.
        size: Numbers per sample: "nq", "nv", "6", or "1" for the time.
        source: "controller" for a field of `ControllerOutput`, "plant" for what the loop sees of the plant, "derived"
            for what follows from the motion and is computed on demand.
        doc: What it is.
    """

    name: str
    unit: str
    doc: str
    size: Literal["1", "nq", "nv", "6"] = "nv"
    source: Literal["controller", "plant", "derived"] = "controller"

    @property
    def is_flag(self) -> bool:
        """Whether it is a truth value per joint that says what held the joint back."""
        return self.unit == "bool"

    def shape(self, samples: int, nq: int, nv: int) -> tuple[int, ...]:
        """Return the shape of its log."""
        return (
            (samples,) if self.size == "1" else (samples, {"nq": nq, "nv": nv, "6": 6}[self.size])
        )

    def empty(self, samples: int, nq: int, nv: int) -> Any:
        """Return a log of zeros, or False."""
        return np.zeros(self.shape(samples, nq, nv), dtype=bool if self.is_flag else float)


CHANNELS = (
    Channel("t", "s", "time k·dt", size="1", source="plant"),
    Channel(
        "q", "rad or m; (cos, sin) on continuous joints", "configuration", size="nq", source="plant"
    ),
    Channel("v", "rad/s or m/s", "velocity", source="plant"),
    Channel("q_r", "as q", "impedance reference", size="nq"),
    Channel("e1", "rad or m", "position error q_r (-) q"),
    Channel("e2", "rad/s or m/s", "velocity error v_r - v"),
    Channel("e_im", "N·m or N", "impedance error, paper, eq. (5)", source="plant"),
    Channel("s", "rad/s or m/s", "sliding variable"),
    Channel("tau", "N·m or N", "motor torque, held from t on"),
    Channel("tau_ext", "N·m or N", "torque of the environment", source="plant"),
    Channel("saturated", "bool", "the joint is at its torque limit"),
    Channel("rate_limited", "bool", "its torque may not change faster"),
    Channel("clipped", "bool", "a BoundedSurface sees less than its whole error"),
    Channel("reference_limited", "bool", "a guard holds its reference back"),
    Channel(
        "wrench",
        "N, N·m",
        "wrench of the environment at the tool frame, world axes",
        size="6",
        source="derived",
    ),
    Channel("tau_stop", "N·m or N", "torque of the joint stops", source="derived"),
)
"""What a run logs. CONTRIBUTING.md has the recipe of a new channel."""

FLAGS = tuple(channel.name for channel in CHANNELS if channel.is_flag)
"""Fields of `ControllerOutput` that say what held a joint back; a run's log has them, too."""


def flags(nv: int, **raised: BoolArray) -> Any:
    """Return every flag for `ControllerOutput(**flags(nv, saturated=...))`; those not given are False.

    Args:
        nv: Number of joints.
        **raised: Flags by name, each of shape (nv,).
    """
    return {name: np.zeros(nv, dtype=np.bool_) for name in FLAGS} | raised


@brief_repr("ticks", "q_e", "v_e", "z")
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


@brief_repr("tau", "e1", "e2", "s", "saturated")
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
            acceleration. When it becomes True the theorem applies again, from that tick's s and z; its other premise,
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
        reference: Desired motion at the tick to come: a `Reference`, or a `CartesianReference` at the tool.
        tau: Motor torque that acts, shape (nv,) [N·m or N].
        tau_ext: Torque of the environment, shape (nv,) [N·m or N].
    """

    q: Array
    v: Array
    a: Array
    reference: Any
    tau: Array
    tau_ext: Array
