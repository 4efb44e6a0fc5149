"""`ChunkReference`: a smooth reference from chunks of a path that a planner or a policy sends late and corrects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive_number, positive_or_infinite, vector
from .._common.brief import brief_repr
from ..exceptions import DimensionError, InputError
from ..robot.arm_model import ArmModel
from .blends import Gap, ToRest, to_rest
from .limits import check_positions, joint_positions
from .reference import Reference, Trajectory
from .samples import path_through

MEMORY = 1000
"""Chunks that are remembered: the reference is known at times since then."""

_JERK_OF_WAY, _JERK_OF_RATE, _JERK_OF_ACCELERATION = 60.0, 36.0, 9.0
"""Largest jerk of the polynomial that closes a gap of 1 in position, rate or acceleration in a time of 1."""


class _Piece(NamedTuple):
    """What one chunk adds: its path, how that ends if no other chunk comes, and the gaps to it that still close."""

    start: float
    path: Trajectory
    end: float
    rest: ToRest
    gaps: tuple[Gap, ...]


@brief_repr("arm", "blend", "jerk")
class ChunkReference:
    """A reference out of chunks: a trajectory t -> `Reference` that `update` extends while it runs.

    A chunk is a path through (t, q), with times on the clock of the loop. It may arrive late, overlap the one before,
    and begin elsewhere than where that one leads. From its arrival on, or from its first sample where that is later,
    the reference is the chunk's own smooth path plus the gap to it, which closes by a polynomial of degree 5: position,
    velocity and acceleration never jump, whatever arrives, so neither does the torque of a controller that is smooth
    itself. A gap takes `blend` to close, or longer where its jerk would be more than `jerk`; gaps of chunks in quick
    succession close side by side, each in its own time. Where chunks fail to come, the motion comes to rest by itself
    after the last sample.

        chunks = rbi.trajectories.ChunkReference(arm, q)
        chunks.update(times, path, now)  # whenever the policy answers
        reference = chunks(loop.time)  # at every tick

    It changes with `update` alone: the reference at times before `now` stays the same.

    Attributes:
        arm: The arm.
        blend: Shortest time in which a gap closes [s].
        jerk: Largest jerk with which a gap closes, shape (nv,) [rad/s³ or m/s³]; +inf for none.
        stop: Time in which the motion comes to rest after its last sample [s].

    Args:
        arm: The arm.
        q: Where it holds until the first chunk, shape (nq,).
        blend: Shortest time in which a gap closes [s].
        jerk: Scalar or (nv,); by default 200.
        stop: Time in which the motion comes to rest after its last sample [s].
        check_limits: Whether a chunk that leaves the position limits is refused.

    Raises:
        DimensionError: Wrong shape or kind.
        ParameterError: A number that is not positive.
    """

    def __init__(
        self,
        arm: ArmModel,
        q: ArrayLike,
        *,
        blend: float = 0.15,
        jerk: ArrayLike = 200.0,
        stop: float = 0.3,
        check_limits: bool = True,
    ) -> None:
        self.arm = arm
        self.blend = positive_number("blend", blend, "time in seconds")
        self.jerk = per_joint("jerk", positive_or_infinite("jerk", jerk), arm.nv)
        self.stop = positive_number("stop", stop, "time in seconds")
        self._check_limits = check_limits
        rest = np.zeros(arm.nv)
        hold = to_rest(
            arm, Reference(np.array(arm.check_configuration("q", q)), rest, rest), 0.0, 1.0
        )
        self._pieces = [_Piece(-np.inf, hold, -np.inf, hold, ())]
        self._arrived = -np.inf

    def __call__(self, t: float) -> Reference:
        """Return the desired motion at a time [s]."""
        return self._total(self._piece(t), t)

    def update(self, t: ArrayLike, q: ArrayLike, now: float) -> None:
        """Follow a chunk from now on.

        Args:
            t: Times of the samples on the loop's clock, strictly increasing, at least two; some may be over [s].
            q: Configurations, shape (n, nq).
            now: Time of arrival, not before that of the chunk before [s].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            ParameterError: Times that do not increase.
            JointLimitError: A sample lies outside the position limits.
            InputError: The chunk is from the past as a whole, or arrives before the one before. The reference stays as
                it was after every error.
        """
        now = float(now)
        times = vector("t", t, None, "n")
        if len(times) < 2:
            raise DimensionError("t", "at least two times", f"{len(times)}")
        if not self._arrived <= now < np.inf:
            raise InputError(f"now is {now:g} s; chunks have to arrive one after the other")
        if times[-1] <= now:
            words = (
                f"nothing of the chunk is left: it ends at {times[-1]:g} s and arrives at {now:g} s"
            )
            raise InputError(words)
        path = path_through(self.arm, times, q)
        if self._check_limits:
            rows = np.array([joint_positions(self.arm, row) for row in np.asarray(q, dtype=float)])
            check_positions("the chunk", self.arm, rows)
        self._follow(path, max(now, float(times[0])), float(times[-1]))
        self._arrived = now

    def _follow(self, path: Trajectory, start: float, end: float) -> None:
        """Go over to a path."""
        before = self._piece(start)
        old, new = _path(before, start), path(start)
        way = self.arm.raw_dynamics.difference(new.q, old.q)
        begin = np.stack([way, old.v - new.v, old.a - new.a])
        still = tuple(gap for gap in before.gaps if gap.start + gap.length > start)
        gaps = (*still, Gap(start, self._length(begin), begin))
        piece = _Piece(start, path, end, to_rest(self.arm, path(end), end, self.stop), gaps)
        kept = [each for each in self._pieces if each.start < start]
        self._pieces = [*kept, piece][-MEMORY:]

    def _piece(self, t: float) -> _Piece:
        """The piece that holds at a time."""
        return next((each for each in reversed(self._pieces) if each.start <= t), self._pieces[0])

    def _total(self, piece: _Piece, t: float) -> Reference:
        """The path with the gaps that remain."""
        q, v, a = _path(piece, t)
        way = np.zeros(self.arm.nv)
        for gap in piece.gaps:
            g, rate, acceleration = gap(t)
            way, v, a = way + g, v + rate, a + acceleration
        return Reference(self.arm.raw_dynamics.integrate(q, way), v, a)

    def _length(self, begin: Array) -> float:
        """Time in which a gap closes with its jerk in bounds."""
        way, rate, acceleration = np.abs(begin)
        by_way = np.cbrt(_JERK_OF_WAY * way / self.jerk).max()
        by_rate = np.sqrt(_JERK_OF_RATE * rate / self.jerk).max()
        by_acceleration = (_JERK_OF_ACCELERATION * acceleration / self.jerk).max()
        return float(max(self.blend, by_way + by_rate + by_acceleration))


def _path(piece: _Piece, t: float) -> Reference:
    """The path of a chunk, and after its end the way to rest."""
    return piece.path(t) if t <= piece.end else piece.rest(t)
