"""A monitor that checks the inputs of every tick before a controller gets them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, BoolArray, is_finite, real, vector
from ..._common.frozen import set_fields
from ...exceptions import DimensionError, InputError, NonFiniteError
from ...robot.arm_model import ArmModel
from ...trajectories import Reference
from ..protocol import Measured
from .desired_motion import DesiredMotion, copied
from .faults import Fault, FaultKind, OperatingRange
from .joint_checks import (
    ALONE,
    EXPECTED,
    FAR,
    FAST,
    FOUND,
    FROZEN,
    JUMPED,
    NO_Q,
    NO_V,
    OUTSIDE,
    SEEN_V,
    SINCE_Q,
    SINCE_V,
    STILL,
    V,
    checks,
)


class MonitorState(NamedTuple):
    """What the monitor remembers.

    Attributes:
        ticks: Number of ticks so far.
        q: The last sound configuration, shape (nq,).
        joints: Row by row, shape (9, nv):
            the last sound velocity [rad/s or m/s];
            time since the last sound position [s];
            time since the last sound velocity [s];
            motion since the last sound position by the measured velocity [rad or m];
            for how many ticks the position has been bitwise constant although it should have moved;
            how far the joint moved meanwhile by its own velocity [rad or m];
            how far the reference moved since position or velocity was another [rad or m];
            velocity of this tick, that of the positions where it cannot be used [rad/s or m/s];
            what is wrong at this tick, as bits.
    """

    ticks: int
    q: Array
    joints: Array


class Reading(NamedTuple):
    """The inputs of a tick, checked.

    Attributes:
        q: Measured configuration, shape (nq,); where `sees_q` is False, the last sound one.
        v: Measured velocity, shape (nv,); where `sees_v` is False, that of the measured positions.
        sees_q: Whether the joint's position can be used, shape (nv,), bool.
        sees_v: Whether its velocity can, shape (nv,), bool. Where neither can, the joint is blind.
        tau_ext: Measured torque of the environment, shape (nv,), or None where it cannot be used.
        reference: Desired motion, likewise.
        fault: The first thing that is wrong, or None.
    """

    q: Array
    v: Array
    sees_q: BoolArray
    sees_v: BoolArray
    tau_ext: Array | None
    reference: Any
    fault: Fault | None


_Inputs: TypeAlias = tuple[Array | None, Array | None, Array | None, Any]
"""q, v, tau_ext and the reference."""


@dataclass(frozen=True, eq=False, init=False)
class Monitor:
    """Checks the inputs of every tick.

    What two sensors agree on is the truth, however large. Only what is lost, frozen or contradicted is a sensor fault.

    - Each input is a finite vector of the right size (any byte order and real kind that NumPy knows).
    - From one sound measurement to the next, a joint moves by no more than twice what the range of its speed allows,
      or as its measured velocity says, give or take that much. What breaks this is a "jump" of q (a spike, a lost
      encoder count, bytes in the wrong order). Where the range of the acceleration is stated, the velocity changes by
      no more than twice that.
    - A speed of more than twice the range is "inconsistent" unless the positions move like that, give or take the
      range.
    - A joint whose position is bitwise constant is "frozen" once it should have moved by more than `frozen_travel`
      for `frozen_ticks` ticks: by its velocity, or, where the velocity is the same as well, by the reference's. A
      velocity of zero and the same bits agree: the arm rests, maybe held by brakes.
    - Positions, velocities and tau_ext are in their ranges. What is "out of range" and agrees is measured well.

    Where q of a joint cannot be used its velocity can, and the other way round, unless both are lost or frozen.

    Attributes:
        arm: The arm.
        motion: The kind of desired motion.
        range: The stated range.
        frozen_ticks: Ticks after which a motion that does not show is a fault.
        frozen_travel: Motion that has to show [rad or m].
    """

    arm: ArmModel
    motion: DesiredMotion
    range: OperatingRange
    frozen_ticks: int
    frozen_travel: float
    _neutral: Array
    _bounds: Array

    def __init__(
        self, motion: DesiredMotion, range: OperatingRange, frozen_ticks: int, frozen_travel: float
    ) -> None:
        arm = motion.arm
        set_fields(
            self,
            arm=arm,
            motion=motion,
            range=range,
            frozen_ticks=frozen_ticks,
            frozen_travel=frozen_travel,
            _neutral=_neutral_positions(arm),
            _bounds=np.stack([range.velocity, range.acceleration, range.lower, range.upper]),
        )

    def init(self) -> MonitorState:
        """Return the state before the first tick."""
        return MonitorState(0, np.array(self.arm.neutral), np.zeros((9, self.arm.nv)))

    def read(
        self, state: MonitorState, given: Measured, v_e: Array, period: float
    ) -> tuple[Reading, MonitorState]:
        """Check the inputs of a tick.

        Args:
            state: From `init` or from the tick before.
            given: Measurements and desired motion, of any kind.
            v_e: How fast the impedance moves the reference, shape (nv,) [rad/s or m/s], or (6,) at the tool.
            period: Time since the tick before [s].
        """
        faults: list[Fault] = []
        measured_q, measured_v, external, desired = self._plain(given) or self._each(faults, given)
        made, moved, position = self._judged(state, measured_q, measured_v, period)
        bits = made[FOUND].astype(np.int64)
        sees_q, sees_v = bits & _UNSEEN_Q == 0, bits & _UNSEEN_V == 0
        if not faults and bits.any():
            known_v = made[SEEN_V] if measured_v is None else measured_v
            change = known_v - state.joints[V]
            values = moved, made[STILL], known_v, change, made[SEEN_V], position
            faults = [
                self._fault(kind, name, bits & bit != 0, value, words)
                for (bit, kind, name, words), value in zip(_FAULTS, values, strict=True)
                if (bits & bit).any()
            ]
        if measured_q is None or not sees_q.all():
            measured_q = self.arm.raw_dynamics.integrate(state.q, np.where(sees_q, moved, 0.0))
        made[EXPECTED] += period * self.motion.joint_speed(desired, v_e, state.q)
        fault = faults[0] if faults else None
        reading = Reading(measured_q, made[SEEN_V], sees_q, sees_v, external, desired, fault)
        return reading, MonitorState(state.ticks + 1, measured_q, made)

    def _judged(
        self, state: MonitorState, q: Array | None, v: Array | None, period: float
    ) -> tuple[Array, Array, Array]:
        """The next state, the motion since the last sound positions, and the positions."""
        judge_q, judge_v, _ = checks()
        before, made, dynamics = state.joints, state.joints.copy(), self.arm.raw_dynamics
        made[SINCE_Q : SINCE_V + 1] += period
        made[FOUND] = NO_Q if q is None else 0.0
        moved = position = np.zeros(self.arm.nv)
        if v is None:
            v = np.full(self.arm.nv, np.nan)
        if q is not None:
            moved = dynamics.difference(state.q, q)
            position = q
            if self.arm.nq != self.arm.nv:
                position = dynamics.difference(self.arm.neutral, q) + self._neutral
            if state.ticks > 0:
                frozen = float(self.frozen_ticks), self.frozen_travel
                judge_q(self._bounds, before, made, moved, v, period, *frozen)
        judge_v(self._bounds, before, made, moved, position, v, int(state.ticks == 0))
        return made, moved, position

    def _fault(
        self, kind: FaultKind, name: str, where: BoolArray, value: Array, words: str
    ) -> Fault:
        joints = tuple(self.arm.joint_names[i] for i in np.flatnonzero(where))
        said = words.format(_largest(value, where))
        return Fault(kind, name, joints, f"{said}: {', '.join(joints)}")

    def _plain(self, measured: Measured) -> _Inputs | None:
        """All inputs, copied, where they are sound vectors of float64, as almost always; checked at once."""
        if type(measured.reference) is not Reference or self.arm.nq != self.arm.nv:
            return None
        n, given = self.arm.nv, (measured.q, measured.v, measured.tau_ext, *measured.reference)
        is_plain = (type(x) is np.ndarray and x.dtype == float and x.shape == (n,) for x in given)
        if not all(is_plain):
            return None
        rows = np.array(given)
        if not is_finite(rows) or (np.abs(rows[2]) > self.range.external).any():
            return None
        return rows[0], rows[1], rows[2], Reference(*rows[3:])

    def _each(self, faults: list[Fault], measured: Measured) -> _Inputs:
        """The inputs one by one; None, and a fault, where one is not sound."""
        return (
            self._checked(faults, "q", measured.q),
            self._checked(faults, "v", measured.v),
            self._checked(faults, "tau_ext", measured.tau_ext),
            self._checked_reference(faults, measured.reference),
        )

    def _checked(self, faults: list[Fault], name: str, value: ArrayLike) -> Array | None:
        """The input as a sound vector; None, and a fault, where it is none."""
        try:
            if name == "q":
                return self.arm.check_configuration("q", _copied(name, value))
            array = vector(name, _copied(name, value), self.arm.nv)
        except InputError as error:
            faults.append(_input_fault(error, name))
            return None
        if name == "tau_ext":
            beyond = np.abs(array) > self.range.external
            if beyond.any():
                words = "tau_ext = {:.4g} is outside the stated range"
                faults.append(self._fault("out of range", name, beyond, array, words))
                return None
        return array

    def _checked_reference(self, faults: list[Fault], reference: Any) -> Any:
        try:
            return copied(self.motion.check(reference))
        except InputError as error:
            faults.append(_input_fault(error, "reference"))
            return None


_UNSEEN_Q, _UNSEEN_V = NO_Q | FAR | FROZEN, NO_V | ALONE | JUMPED
_FAULTS: tuple[tuple[int, FaultKind, str, str], ...] = (
    (FAR, "jump", "q", "q jumps by {:.3g}"),
    (
        FROZEN,
        "frozen",
        "q",
        "q is bitwise constant, for {:.0f} ticks after it should have moved",
    ),
    (ALONE, "inconsistent", "v", "v = {:.4g} is not how q moves"),
    (JUMPED, "jump", "v", "v jumps by {:.3g}"),
    (FAST, "out of range", "v", "v = {:.4g} is outside the stated range"),
    (OUTSIDE, "out of range", "q", "q = {:.4g} is outside the stated range"),
)
"""Bit, kind, quantity, and words, the most urgent one first."""


def _neutral_positions(arm: ArmModel) -> Array:
    """Position of every joint at `neutral`, zero on continuous joints, shape (nv,)."""
    positions = np.zeros(arm.nv)
    for i, unit in enumerate(np.eye(arm.nv)):
        entries = np.flatnonzero(arm.raw_dynamics.integrate(arm.neutral, 0.5 * unit) != arm.neutral)
        if len(entries) == 1:
            positions[i] = arm.neutral[entries[0]]
    return positions


def _copied(name: str, value: ArrayLike) -> Array:
    return np.array(real(name, value, "a vector of real numbers"))


def _input_fault(error: InputError, name: str) -> Fault:
    kind: FaultKind = "not finite" if isinstance(error, NonFiniteError) else "malformed"
    named = error.name if isinstance(error, NonFiniteError | DimensionError) else name
    return Fault(kind, named.partition(".")[0], (), str(error))


def _largest(value: Array, where: BoolArray) -> float:
    chosen = value[where]
    return float(chosen[np.argmax(np.abs(chosen))])
