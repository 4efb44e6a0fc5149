"""A start without a jump: the torque begins at what the arm needs now, the reference where the arm is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, positive_number, positive_or, vector
from ..._common.frozen import set_fields
from ...law.limits import Limits
from ...trajectories.blends import closing
from ..cartesian_base import CartesianControllerBase
from ..protocol import LONGEST_PERIOD, Measured, WrappableController
from ..telemetry import ControllerOutput, Situation
from ..tool_view import in_joints
from ..wrapper import ControllerWrapper
from .desired_motion import DesiredMotion, copied, desired_motion

_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 10.0 / np.sqrt(3.0)
"""Of the way from 0 to 1 in a time of 1 that begins and ends at rest, 10x³ - 15x⁴ + 6x⁵."""


class SoftStartState(NamedTuple):
    """What a `SoftStart` remembers.

    Attributes:
        inner: State of the controller inside.
        ticks: Number of ticks so far.
        q: Configuration at the tick before, shape (nq,).
        tau: Torque that left then, shape (nv,) [N·m or N]; before the first tick the torque to begin with, None for the
            one that holds the arm against gravity.
        reference: Desired motion at the tick before, as it was given: a `Reference`, or a `CartesianReference`.
        late: Time of the coming tick after the one before, less dt [s].
        clock: Time since the start [s].
        length: How long this start takes [s].
        gap: Blended reference (-) given reference at the start, its rate and acceleration, shape (3, nv) or (3, 6).
        offset: Torque to begin with less that of the controller inside, shape (nv,) [N·m or N].
    """

    inner: Any
    ticks: int
    q: Array
    tau: Array | None
    reference: Any
    late: float
    clock: float
    length: float
    gap: Array
    offset: Array


@dataclass(frozen=True, eq=False, init=False)
class SoftStart(ControllerWrapper[SoftStartState, ControllerOutput]):
    """A controller that takes an arm over without a jump, at its first tick and after every pause.

    Where it starts,

    - the torque of the tick is the one that holds the arm against gravity, or the one given to `init`, exactly. Its
      difference to the controller's own torque fades away over the start, twice continuously differentiable;
    - the reference is the arm's own motion: q_d and v_d, or the pose and velocity of the tool, are the measured ones,
      a_d is zero at a first start. From there
      it goes over into the given reference by a polynomial of degree 5, with velocity and acceleration continuous.
      Accelerations that differ by more than `velocity` in the time of the start are left to the torque.

    A start takes `duration`, or longer where the arm is so far away that the way back would be faster than `velocity`
    or need more than `acceleration` on a joint. Speed and acceleration of the given reference come on top.

    A start is due at the first tick, and where the state is stale: the measured period is longer than the controller
    accepts, or q or the reference has moved since the tick before by more than twice the joints' speed limits allow. So
    a paused loop continues with its present state, with or without a measured period. Where only the
    reference jumps the torque begins at that of the tick before.

    Around a `CartesianController` references are `CartesianReference`, and the way back is that of the tool: straight,
    with a rotation about one axis. tau_ext stays a torque of the joints; for a wrist sensor it is Jᵀ·wrench.

    The torque heeds the limits of the controller inside, its rate included. Elsewhere the controller's torque leaves to
    the bit. Put a `FaultGuard` around it, not inside: a guard has to know the torque that leaves.

    Attributes:
        controller: The controller inside.
        duration: Shortest time of a start [s].
        velocity: Largest speed of the way to the given reference, shape (nv,) [rad/s or m/s], or (6,) at the tool.
        acceleration: Largest acceleration of that way, of the same shape [rad/s² or m/s²]; +inf where there is none.

    Raises:
        ParameterError: A number that is not positive.
        DimensionError: A speed or an acceleration for another number of joints.
    """

    duration: float
    velocity: Array
    acceleration: Array
    _motion: DesiredMotion

    def __init__(
        self,
        controller: WrappableController[Any] | CartesianControllerBase[Any],
        duration: float = 1.0,
        *,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Wrap a controller.

        Args:
            controller: The controller; other wrappers may be inside.
            duration: Shortest time of a start [s].
            velocity: Largest speed of the way, scalar, (nv,), or (6,) at the tool; by default half of the arm's limit,
                or `control.cartesian_defaults.TOOL_SPEED`.
            acceleration: Largest acceleration of the way, likewise; not bounded by default.
        """
        motion = desired_motion(controller)
        usual = motion.usual_speed
        set_fields(
            self,
            controller=in_joints(controller),
            duration=positive_number("duration", duration, "time in seconds"),
            velocity=positive_or("velocity", velocity, usual),
            acceleration=positive_or("acceleration", acceleration, np.full(len(usual), np.inf)),
            _motion=motion,
        )

    def init(self, tau: ArrayLike | None = None) -> SoftStartState:
        """Return the state before the first tick.

        Args:
            tau: Torque that the motors give now, as measured, shape (nv,) [N·m or N]; by default the one that holds the
                arm against gravity.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: tau holds NaN or infinity.
        """
        q, zero = np.array(self.arm.neutral), np.zeros(self.arm.nv)
        return SoftStartState(
            inner=self.controller.init(),
            ticks=0,
            q=q,
            tau=None if tau is None else vector("tau", tau, self.arm.nv).copy(),
            reference=self._motion.at_rest(),
            late=0.0,
            clock=0.0,
            length=0.0,
            gap=np.zeros((3, len(self.velocity))),
            offset=zero,
        )

    def elapsed(self, state: SoftStartState, period: float) -> SoftStartState:
        """Return the state at a tick that comes a measured time after the one before; after a long pause, a new start.

        Args:
            state: From the tick before.
            period: Time since then, positive [s].

        Raises:
            InputError: Not such a number.
        """
        if state.ticks == 0:
            return state
        is_pause = isinstance(period, int | float) and LONGEST_PERIOD * self.dt < period < np.inf
        if is_pause:
            return self.init()
        inner = self.controller.elapsed(state.inner, period)
        late = float(period) - self.dt
        return state._replace(inner=inner, late=late, clock=state.clock + late)

    def handover(self, state: SoftStartState, now: Situation) -> SoftStartState:
        """Return the state with which the arm is taken over as it is now, beginning with the torque that acts.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        gap = self._motion.gap(now)
        length = self._length(gap[0])
        most = np.minimum(
            self.velocity / length, self.acceleration
        )  # more would take the reference far away first
        gap[2] = np.clip(gap[2], -most, most)
        started = state._replace(
            ticks=max(state.ticks, 1), late=0.0, clock=0.0, length=length, gap=gap
        )
        blended = self._blended(started, now.reference)
        inner = self.controller.handover(state.inner, now._replace(reference=blended))
        return started._replace(inner=inner, tau=np.array(now.tau))

    def _step(
        self, state: SoftStartState, given: Measured
    ) -> tuple[ControllerOutput, SoftStartState]:
        arm, motion = self.arm, self._motion
        q, v = arm.check_configuration("q", given.q), vector("v", given.v, arm.nv)
        reference, tau_ext = motion.check(given.reference), vector("tau_ext", given.tau_ext, arm.nv)
        state = self._fresh(state, q)
        if state.tau is None or state.ticks == 0 or self.has_jumped(state, reference):
            rest = np.zeros(arm.nv)
            tau = arm.raw_dynamics.bias(q, rest) if state.tau is None else state.tau
            a = motion.joint_acceleration(state.reference, q, v) if state.ticks > 0 else rest
            state = self.handover(state, Situation(q, v, a, reference, tau, tau_ext))
        return self.follow(state, q, v, reference, tau_ext)

    def follow(
        self, state: SoftStartState, q: Array, v: Array, reference: Any, tau_ext: Array
    ) -> tuple[ControllerOutput, SoftStartState]:
        """Compute the torque of one tick without looking whether a start is due; inputs are sound.

        Args:
            state: From the tick before, or from `handover`.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick, as given.
            tau_ext: Measured torque of the environment, shape (nv,) [N·m or N].
        """
        is_over = state.clock >= state.length
        desired = reference if is_over else self._blended(state, reference)
        output, inner = self.controller.step(state.inner, q, v, desired, tau_ext)
        offset, before = state.offset, state.tau
        if not is_over and before is not None:
            if state.clock == 0.0:
                offset = before - output.tau
            tau = output.tau + (1.0 - _way(state.clock / state.length)) * offset
            output = output._replace(tau=_within(self.limits, tau, before, self.dt))
        return output, state._replace(
            inner=inner,
            ticks=state.ticks + 1,
            q=np.array(q),
            tau=np.array(output.tau),
            reference=copied(reference),
            late=0.0,
            clock=state.clock if is_over else state.clock + self.dt,
            offset=offset,
        )

    def _fresh(self, state: SoftStartState, q: Array) -> SoftStartState:
        """The state, or a new one where the arm is elsewhere than it can have moved to since the tick before."""
        way = self.arm.raw_dynamics.difference(state.q, q)
        is_elsewhere = (np.abs(way) > 2.0 * self._motion.fastest * (self.dt + state.late)).any()
        return self.init() if state.ticks > 0 and is_elsewhere else state

    def has_jumped(self, state: SoftStartState, reference: Any) -> bool:
        """Return whether the reference has moved more than possible since the previous tick.

        Args:
            state: From the tick before.
            reference: Desired motion at this tick.
        """
        return self._motion.has_jumped(state.reference, reference, state.q, self.dt + state.late)

    def _blended(self, state: SoftStartState, reference: Any) -> Any:
        """The given reference with the remaining gap to it."""
        gap = np.stack(closing(state.gap, state.length, state.clock))
        return self._motion.moved(reference, gap)

    def _length(self, gap: Array) -> float:
        """Time in which the gap is closed within the bounds."""
        way = np.abs(gap)
        by_speed = _PEAK_SPEED * way / self.velocity
        by_acceleration = np.sqrt(_PEAK_ACCELERATION * way / self.acceleration)
        return float(max(self.duration, by_speed.max(), by_acceleration.max()))


def _way(x: float) -> float:
    """From 0 to 1, with velocity and acceleration zero at both ends."""
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def _within(limits: Limits | None, tau: Array, before: Array, dt: float) -> Array:
    return tau if limits is None else limits.nearest(tau, before, dt)
