"""A monitor that judges the inputs of every tick before a controller sees them."""

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
from .faults import Fault, FaultKind, OperatingRange


class MonitorState(NamedTuple):
    """What the monitor remembers.

    Attributes:
        ticks: Number of ticks so far.
        q: The last sound configuration, shape (nq,).
        v: Its velocity, shape (nv,) [rad/s or m/s].
        since: Time since then, the tick before included [s].
        still: For how many ticks the joint's position has been the same to the bit, shape (nv,).
        travel: How far the joint moved meanwhile by its own velocity, shape (nv,) [rad or m].
        expected: How far the reference moved since position or velocity was another, shape (nv,) [rad or m].
    """

    ticks: int
    q: Array
    v: Array
    since: float
    still: Array
    travel: Array
    expected: Array


class Reading(NamedTuple):
    """The inputs of a tick, judged.

    Attributes:
        q: Measured configuration, shape (nq,), or None where it cannot be used.
        v: Measured velocity, shape (nv,), likewise.
        tau_ext: Measured torque of the environment, shape (nv,), likewise.
        reference: Desired motion, likewise.
        fault: The first thing that is wrong, or None.
    """

    q: Array | None
    v: Array | None
    tau_ext: Array | None
    reference: Reference | None
    fault: Fault | None


@dataclass(frozen=True, eq=False, init=False)
class Monitor:
    """Judges the inputs of every tick.

    - Each input is a finite vector of the right size (any byte order and real kind that NumPy knows).
    - A joint moves from one sound measurement to the next by no more than twice what the range of its speed allows,
      and its velocity changes by no more than the range of its acceleration: what breaks this is a "jump" (a spike, a
      lost encoder count, bytes in the wrong order), and what was measured is not used.
    - Positions, velocities and tau_ext are in their ranges.
    - A joint whose position is the same to the bit for at least `frozen_ticks` ticks is "frozen" if its velocity adds
      up to more than `frozen_travel` meanwhile, or, where the velocity is the same as well, the reference's. At rest
      under a resting reference the same bits are no fault: nothing can tell, and nothing depends on it. So a frozen
      sensor is found when the arm should have moved by `frozen_travel`.

    A measurement is not used where it jumps, is frozen, or says a speed of more than twice the range.

    Attributes:
        arm: The arm.
        range: The stated range.
        frozen_ticks: Fewest ticks without a new bit.
        frozen_travel: Motion that has to show meanwhile [rad or m].
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
        return MonitorState(0, np.array(self.arm.neutral), zero, 0.0, zero, zero, zero)

    def read(
        self,
        state: MonitorState,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        v_e: Array,
        period: float,
    ) -> tuple[Reading, MonitorState]:
        """Judge the inputs of a tick.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,).
            reference: Desired motion.
            tau_ext: Measured torque of the environment, shape (nv,).
            v_e: How fast the impedance moves the reference, shape (nv,) [rad/s or m/s].
            period: Time since the tick before [s].
        """
        faults: list[Fault] = []
        measured_q = self._checked(faults, "q", q)
        measured_v = self._checked(faults, "v", v)
        external = self._checked(faults, "tau_ext", tau_ext)
        desired = self._checked_reference(faults, reference)
        is_usable = measured_q is not None and measured_v is not None
        following = state._replace(ticks=state.ticks + 1, since=state.since + period)
        if measured_q is not None and measured_v is not None:
            found, following = self._judge(state, following, measured_q, measured_v, period)
            faults += found
            is_slow = bool((np.abs(measured_v) <= 2.0 * self.range.velocity).all())
            is_usable = is_slow and not any(fault.kind in ("jump", "frozen") for fault in found)
            if is_usable:
                following = following._replace(q=measured_q, v=measured_v, since=0.0)
        rate = v_e if desired is None else desired.v + v_e
        following = following._replace(expected=following.expected + rate * period)
        reading = Reading(
            measured_q if is_usable else None,
            measured_v if is_usable else None,
            external,
            desired,
            faults[0] if faults else None,
        )
        return reading, following

    def _judge(
        self, state: MonitorState, following: MonitorState, q: Array, v: Array, period: float
    ) -> tuple[list[Fault], MonitorState]:
        """Faults of a finite measurement, and the state with its motion counted."""
        found = []
        if state.ticks > 0:
            moved = self.arm.raw_dynamics.difference(state.q, q)
            is_still = moved == 0.0
            following = following._replace(
                still=np.where(is_still, state.still + 1.0, 0.0),
                travel=np.where(is_still, state.travel + period * v, 0.0),
                expected=np.where(is_still & (v == state.v), state.expected, 0.0),
            )
            found += self._jumps(moved, v - state.v, following.since)
            found += self._frozen(following)
        found += self._outside("v", v, -self.range.velocity, self.range.velocity)
        position = self.arm.raw_dynamics.difference(self.arm.neutral, q) + self._neutral
        found += self._outside("q", position, self.range.lower, self.range.upper)
        return found, following

    def _jumps(self, moved: Array, change: Array, since: float) -> list[Fault]:
        bounds = self.range
        far = np.abs(moved) > 2.0 * bounds.velocity * since
        fast = np.abs(change) > 2.0 * bounds.acceleration * since
        found = []
        for name, beyond, by in (("q", far, moved), ("v", fast, change)):
            if beyond.any():
                words = f"{name} jumps by {_largest(by, beyond):.3g} in {since:.3g} s"
                found.append(self._fault("jump", name, beyond, words))
        return found

    def _frozen(self, state: MonitorState) -> list[Fault]:
        travel = np.maximum(np.abs(state.expected), np.abs(state.travel))
        is_frozen = (state.still >= self.frozen_ticks) & (travel > self.frozen_travel)
        if not is_frozen.any():
            return []
        ticks = int(state.still[is_frozen].max())
        words = f"q is the same to the bit for {ticks} ticks, in which it should have moved"
        return [self._fault("frozen", "q", is_frozen, words)]

    def _outside(self, name: str, value: Array, lower: Array, upper: Array) -> list[Fault]:
        beyond = (value < lower) | (value > upper)
        if not beyond.any():
            return []
        words = f"{name} = {_largest(value, beyond):.4g} is outside the stated range"
        return [self._fault("out of range", name, beyond, words)]

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
            outside = self._outside(name, array, -self.range.external, self.range.external)
            faults += outside
            return None if outside else array
        return array

    def _checked_reference(self, faults: list[Fault], reference: Reference) -> Reference | None:
        try:
            return check_reference(self.arm, reference)
        except InputError as error:
            faults.append(_input_fault(error, "reference"))
            return None

    def _fault(self, kind: FaultKind, name: str, where: BoolArray, words: str) -> Fault:
        joints = tuple(self.arm.joint_names[i] for i in np.flatnonzero(where))
        return Fault(kind, name, joints, f"{words}: {', '.join(joints)}")


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
