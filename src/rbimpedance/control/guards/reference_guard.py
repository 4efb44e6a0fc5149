"""Position and velocity limits: a guard that keeps the impedance reference q_r off the ends of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, BoolArray, not_negative, positive_number, positive_or
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import ParameterError
from ...law.impedance import TargetFilter
from ...robot.arm_model import ArmModel
from ...trajectories import Reference
from ..errors import check_reference, track
from ..protocol import Measured, WrappableController
from ..telemetry import ControllerOutput, Situation
from ..wrapper import ControllerWrapper, of_joints

_FEWEST_PERIODS = 5.0


class GuardState(NamedTuple):
    """What a guarded controller remembers.

    Attributes:
        inner: State of the controller that is guarded.
        q_g: How far the guard has moved the reference, shape (nv,) [rad or m].
        v_g: Its rate, shape (nv,) [rad/s or m/s].
        a_g: Its acceleration since the tick before, shape (nv,) [rad/s² or m/s²].
        reference_limited: Whether the guard held the joint back in the tick before, shape (nv,), bool.
    """

    inner: Any
    q_g: Array
    v_g: Array
    a_g: Array
    reference_limited: BoolArray


@brief_repr("lower", "upper", "velocity", "controller")
@dataclass(frozen=True, eq=False, init=False)
class ReferenceGuard(ControllerWrapper[GuardState, ControllerOutput]):
    """A controller whose impedance reference stays within position and velocity limits.

    Near an end u of a joint the reference may accelerate towards it by at most

        a ≤ k1·(u - q_r) - k2·v_r    and    a ≤ k2·(v_max - v_r),

    the force of a critically damped spring that rests at the end, with k1 ≈ 4/T², k2 ≈ 4/T. It acts only where the
    reference asks for more: a smooth repulsion that is felt from about v·T before the end. The set of states with
    v_r ≤ 2·(u - q_r)/T is left by none, so that q_r comes to rest at the end at the latest, and v_r stays below v_max.
    The lower end likewise. Sampled, a reference with the jerk j exceeds the end by up to j·h·T²/8 and the speed by
    j·h·T/8 (1e-4 rad for 80 rad/s³, 1 ms and 0.1 s): a tick cannot know what the reference does until the next. What
    the guard has moved the reference by goes back, critically damped within T, once nothing holds it. k1 and k2 are
    those of a double pole at e^(-2h/T) for accelerations that are held for a period.

    The reference is guarded, whether desired motion or a push drives it there, and the law tracks it as any other: the
    guarantee of the sliding mode and the torque limits stay as they are, and q is off q_r by e1 only. While the guard
    holds, the arm does not have the target impedance; e_im in a log is the error to the guarded one.

    Attributes:
        controller: The controller that is guarded: the library's law or a baseline, any with q_e and v_e in its state.
        lower: Lower ends, shape (nv,) [rad or m]; -inf where there is none.
        upper: Upper ends, shape (nv,).
        velocity: v_max, shape (nv,) [rad/s or m/s]; +inf where there is none.
        horizon: T [s].

    Raises:
        ParameterError: A margin that is negative or leaves no room, a speed that is not positive, or a horizon shorter
            than 5 control periods.
        DimensionError: A margin or a speed for another number of joints.
    """

    lower: Array
    upper: Array
    velocity: Array
    horizon: float
    _filter: TargetFilter
    _ends: tuple[Array, Array]

    def __init__(
        self,
        controller: WrappableController[Any],
        *,
        margin: ArrayLike = 0.0,
        velocity: ArrayLike | None = None,
        horizon: float = 0.1,
    ) -> None:
        """Guard a controller.

        Args:
            controller: The controller to guard; it has an `impedance`.
            margin: How far inside the arm's own position limits the ends are, scalar or (nv,) [rad or m].
            velocity: v_max, scalar or (nv,); the arm's `velocity_limit` by default [rad/s or m/s].
            horizon: T, how soon a reference at full speed comes to rest [s].
        """
        arm = controller.arm
        horizon = positive_number("horizon", horizon, "time in seconds")
        if horizon < _FEWEST_PERIODS * controller.dt:
            words = f"at least {_FEWEST_PERIODS:g} control periods of {controller.dt:g} s"
            raise ParameterError("horizon", horizon, words)
        room = not_negative("margin", margin, arm.nv)
        lower, upper = arm.joint_limits()
        if not (lower + room < upper - room).all():
            raise ParameterError("margin", margin, "less than half of every joint's range")
        speed = positive_or("velocity", velocity, arm.velocity_limit)
        set_fields(
            self,
            controller=of_joints(controller),
            lower=lower + room,
            upper=upper - room,
            velocity=np.array(speed),
            horizon=horizon,
            _filter=controller.impedance.filter(arm.nv, controller.dt),
            _ends=(_end(arm, arm.lower, lower) + room, _end(arm, arm.upper, upper) - room),
        )

    def init(self) -> GuardState:
        """Return the state before the first tick: reference not moved."""
        zero, none = np.zeros(self.arm.nv), np.zeros(self.arm.nv, dtype=np.bool_)
        return GuardState(self.controller.init(), zero, zero, zero, none)

    def _step(self, state: GuardState, given: Measured) -> tuple[ControllerOutput, GuardState]:
        h, (inner, q_g, v_g, _, _) = self.dt, state
        moved = self._moved(
            check_reference(self.arm, given.reference), q_g, v_g, np.zeros_like(q_g)
        )
        given = given._replace(reference=moved)
        tick = track(self.arm, self._filter, inner.q_e, inner.v_e, given)
        k1, k2 = self._gains()
        wanted = -k1 * q_g - k2 * v_g  # back to where nothing is moved
        a = self._bounded(tick.q_r, tick.v_r, tick.a_r + wanted)
        reference_limited = a != tick.a_r + wanted
        a_g = np.where(reference_limited, a - tick.a_r, wanted)
        desired = self._moved(tick.desired, np.zeros_like(q_g), np.zeros_like(q_g), a_g)
        output, inner = self.controller.step(inner, *given._replace(reference=desired))
        following = q_g + h * v_g + h**2 / 2.0 * a_g, v_g + h * a_g
        output = output._replace(reference_limited=reference_limited)
        return output, GuardState(inner, *following, a_g, reference_limited)

    def _elapsed(self, state: GuardState, period: float) -> GuardState:
        inner, late = self.controller.elapsed(state.inner, period), float(period) - self.dt
        q_g = state.q_g + late * state.v_g + late**2 / 2.0 * state.a_g
        return state._replace(inner=inner, q_g=q_g, v_g=state.v_g + late * state.a_g)

    def handover(self, state: GuardState, now: Situation) -> GuardState:
        """Return the state with which the arm is taken over as it is now: reference not moved.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        return self.init()._replace(inner=self.controller.handover(state.inner, now))

    def _moved(self, reference: Reference, q_g: Array, v_g: Array, a_g: Array) -> Reference:
        q, v, a = reference
        return Reference(self.arm.raw_dynamics.integrate(q, q_g), v + v_g, a + a_g)

    def _gains(self) -> tuple[float, float]:
        """k1 and k2 that give (1, h; 0, 1) with (h²/2, h) a double pole at p = e^(-2h/T)."""
        h = self.dt
        p = float(np.exp(-2.0 * h / self.horizon))
        return (1.0 - p) ** 2 / h**2, (1.0 - p) * (3.0 + p) / (2.0 * h)

    def _bounded(self, q_r: Array, v_r: Array, a: Array) -> Array:
        """The acceleration nearest to a that heeds ends and speeds; beyond an end, the speed decides."""
        k1, k2 = self._gains()
        lower, upper = self._ends
        x = self.arm.raw_dynamics.difference(self.arm.neutral, q_r)
        highest = np.minimum(k1 * (upper - x) - k2 * v_r, k2 * (self.velocity - v_r))
        lowest = np.maximum(k1 * (lower - x) - k2 * v_r, k2 * (-self.velocity - v_r))
        bounded: Array = np.maximum(np.minimum(a, highest), lowest)
        return bounded


def _end(arm: ArmModel, end: Array, limits: Array) -> Array:
    """Way from `neutral` to an end of every joint, shape (nv,); infinite where there is none."""
    way = arm.raw_dynamics.difference(arm.neutral, np.where(np.isfinite(end), end, arm.neutral))
    return np.where(np.isfinite(limits), way, limits)
