"""A monitor that checks the inputs of every tick before a controller gets them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, BoolArray, real, vector
from ..._common.frozen import set_fields
from ...exceptions import DimensionError, InputError, NonFiniteError
from ...robot.arm_model import ArmModel
from ...trajectories import Reference
from ..errors import check_reference
from ..protocol import Measured
from .faults import Fault, FaultKind, OperatingRange


class MonitorState(NamedTuple):
    """What the monitor remembers.

    Attributes:
        ticks: Number of ticks so far.
        q: The last sound configuration, shape (nq,).
        v: The last sound velocity, shape (nv,) [rad/s or m/s].
        since_q: Time since the joint's last sound position, shape (nv,) [s].
        since_v: Time since its last sound velocity, shape (nv,) [s].
        explained: Motion since the last sound position by the measured velocity, shape (nv,) [rad or m].
        still: For how many ticks the joint's position has been bitwise constant although it should have moved,
            shape (nv,).
        travel: How far the joint moved meanwhile by its own velocity, shape (nv,) [rad or m].
        expected: How far the reference moved since position or velocity was another, shape (nv,) [rad or m].
    """

    ticks: int
    q: Array
    v: Array
    since_q: Array
    since_v: Array
    explained: Array
    still: Array
    travel: Array
    expected: Array


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
    reference: Reference | None
    fault: Fault | None


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
        range: The stated range.
        frozen_ticks: Ticks after which a motion that does not show is a fault.
        frozen_travel: Motion that has to show [rad or m].
    """

    arm: ArmModel
    range: OperatingRange
    frozen_ticks: int
    frozen_travel: float
    _neutral: Array

    def __init__(
        self, arm: ArmModel, range: OperatingRange, frozen_ticks: int, frozen_travel: float
    ) -> None:
        set_fields(
            self,
            arm=arm,
            range=range,
            frozen_ticks=frozen_ticks,
            frozen_travel=frozen_travel,
            _neutral=_neutral_positions(arm),
        )

    def init(self) -> MonitorState:
        """Return the state before the first tick."""
        zero = np.zeros(self.arm.nv)
        return MonitorState(0, np.array(self.arm.neutral), *[zero] * 7)

    def read(
        self, state: MonitorState, given: Measured, v_e: Array, period: float
    ) -> tuple[Reading, MonitorState]:
        """Check the inputs of a tick.

        Args:
            state: From `init` or from the tick before.
            given: Measurements and desired motion, of any kind.
            v_e: How fast the impedance moves the reference, shape (nv,) [rad/s or m/s].
            period: Time since the tick before [s].
        """
        faults: list[Fault] = []
        measured_q = self._checked(faults, "q", given.q)
        measured_v = self._checked(faults, "v", given.v)
        external = self._checked(faults, "tau_ext", given.tau_ext)
        desired = self._checked_reference(faults, given.reference)
        state = state._replace(since_q=state.since_q + period, since_v=state.since_v + period)
        moved, state, sees_q = self._judge_q(faults, state, measured_q, measured_v, period)
        pace = np.where(sees_q & (state.ticks > 0), moved / state.since_q, state.v)
        sees_v = self._judge_v(faults, state, measured_v, pace, sees_q)
        seen_v = pace if measured_v is None else np.where(sees_v, measured_v, pace)
        if measured_q is None or not sees_q.all():
            measured_q = self.arm.raw_dynamics.integrate(state.q, np.where(sees_q, moved, 0.0))
        self._judge_range(faults, measured_q, seen_v, sees_q)
        rate = v_e if desired is None else desired.v + v_e
        following = MonitorState(
            ticks=state.ticks + 1,
            q=measured_q,
            v=np.where(sees_v | sees_q, seen_v, state.v),
            since_q=np.where(sees_q, 0.0, state.since_q),
            since_v=np.where(sees_v, 0.0, state.since_v),
            explained=np.where(sees_q, 0.0, state.explained),
            still=state.still,
            travel=state.travel,
            expected=state.expected + rate * period,
        )
        fault = faults[0] if faults else None
        return Reading(measured_q, seen_v, sees_q, sees_v, external, desired, fault), following

    def _judge_q(
        self,
        faults: list[Fault],
        state: MonitorState,
        q: Array | None,
        v: Array | None,
        period: float,
    ) -> tuple[Array, MonitorState, BoolArray]:
        """Motion since the last sound positions, the state with it counted, and where q can be used."""
        zero, speed = np.zeros(self.arm.nv), self.range.velocity
        if q is None or state.ticks == 0:
            moved = zero if q is None else self.arm.raw_dynamics.difference(state.q, q)
            return moved, state, np.full(self.arm.nv, q is not None)
        moved = self.arm.raw_dynamics.difference(state.q, q)
        pace = state.v
        if v is not None:
            pace = np.clip((state.v + v) / 2.0, state.v - 2.0 * speed, state.v + 2.0 * speed)
        is_still, repeats = moved == 0.0, (True if v is None else (v == state.v) & (v != 0.0))
        travel = np.where(is_still, state.travel + period * pace, 0.0)
        expected = np.where(is_still & repeats, state.expected, 0.0)
        should_show = np.maximum(np.abs(travel), np.abs(expected)) > self.frozen_travel
        state = state._replace(
            explained=state.explained + period * pace,
            still=np.where(should_show, state.still + 1.0, 0.0),
            travel=travel,
            expected=expected,
        )
        reach = 2.0 * speed * state.since_q
        is_far = (np.abs(moved) > reach) & (np.abs(moved - state.explained) > reach)
        self._add(faults, "jump", "q", is_far, moved, "q jumps by {:.3g}")
        is_frozen = state.still >= self.frozen_ticks
        words = "q is bitwise constant, for {:.0f} ticks after it should have moved"
        self._add(faults, "frozen", "q", is_frozen, state.still, words)
        return moved, state, ~(is_far | is_frozen)

    def _judge_v(
        self,
        faults: list[Fault],
        state: MonitorState,
        v: Array | None,
        pace: Array,
        sees_q: BoolArray,
    ) -> BoolArray:
        """Where v can be used; pace is the velocity of the positions, or the last one where they cannot be used."""
        bounds = self.range
        if v is None:
            return np.zeros(self.arm.nv, dtype=np.bool_)
        is_fast = np.abs(v) > 2.0 * bounds.velocity
        is_alone = is_fast & ((np.abs(v - pace) > bounds.velocity) | (state.ticks == 0))
        words = "v = {:.4g} is not how q moves"
        self._add(faults, "inconsistent", "v", is_alone, v, words)
        change = v - state.v
        has_jumped = np.abs(change) > 2.0 * bounds.acceleration * state.since_v
        has_jumped &= state.ticks > 0
        self._add(faults, "jump", "v", has_jumped, change, "v jumps by {:.3g}")
        is_frozen = ~sees_q & (change == 0.0)
        sees_v: BoolArray = ~(is_alone | has_jumped | is_frozen)
        return sees_v

    def _judge_range(self, faults: list[Fault], q: Array, v: Array, sees_q: BoolArray) -> None:
        bounds = self.range
        self._outside(faults, "v", v, -bounds.velocity, bounds.velocity)
        position = self.arm.raw_dynamics.difference(self.arm.neutral, q) + self._neutral
        lower, upper = np.where(sees_q, (bounds.lower, bounds.upper), [[-np.inf], [np.inf]])
        self._outside(faults, "q", position, lower, upper)

    def _outside(
        self, faults: list[Fault], name: str, value: Array, lower: Array, upper: Array
    ) -> bool:
        beyond = (value < lower) | (value > upper)
        words = f"{name} = {{:.4g}} is outside the stated range"
        self._add(faults, "out of range", name, beyond, value, words)
        return bool(beyond.any())

    def _add(
        self,
        faults: list[Fault],
        kind: FaultKind,
        name: str,
        where: BoolArray,
        value: Array,
        words: str,
    ) -> None:
        """Add a fault where there is one; its words name the largest value."""
        if where.any():
            joints = tuple(self.arm.joint_names[i] for i in np.flatnonzero(where))
            said = words.format(_largest(value, where))
            faults.append(Fault(kind, name, joints, f"{said}: {', '.join(joints)}"))

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
            bound = self.range.external
            return None if self._outside(faults, name, array, -bound, bound) else array
        return array

    def _checked_reference(self, faults: list[Fault], reference: Reference) -> Reference | None:
        try:
            return check_reference(self.arm, reference)
        except InputError as error:
            faults.append(_input_fault(error, "reference"))
            return None


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
