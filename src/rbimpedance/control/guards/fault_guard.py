"""Run-time policy: what a controller does when its inputs, its state or its torque cannot be trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, choice, is_finite, per_joint, positive_number, whole_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import InputError, ParameterError
from ...law.limits import Limits, as_limits
from ...robot.arm_model import ArmModel
from ..cartesian_base import CartesianControllerBase
from ..protocol import LONGEST_PERIOD, Measured, WrappableController
from ..telemetry import ControllerOutput, Situation
from ..tool_view import in_joints
from ..wrapper import ControllerWrapper
from .belief import Belief, Believer
from .braking import Braking
from .desired_motion import DesiredMotion, desired_motion
from .effect_monitor import MEMORY, EffectMonitor, EffectState
from .fault_telemetry import FaultEvent as FaultEvent  # noqa: PLC0414 (part of this module's interface)
from .fault_telemetry import FaultGuardState as FaultGuardState  # noqa: PLC0414 (likewise)
from .fault_telemetry import GuardedOutput as GuardedOutput  # noqa: PLC0414 (likewise)
from .fault_telemetry import Policy, Response, guarded
from .faults import Fault, FaultError, OperatingRange
from .input_monitor import Monitor
from .joint_checks import SINCE_Q
from .soft_start import SoftStart, SoftStartState


@brief_repr("policy", "limits", "controller")
@dataclass(frozen=True, eq=False, init=False)
class FaultGuard(ControllerWrapper[FaultGuardState, GuardedOutput]):
    """A controller that meets faults with a policy; what leaves it is finite and within the limits, always.

    A `Monitor` checks the inputs of every tick, and the guard the torque that the controller computes; an
    `EffectMonitor` finds that the torque moves nothing. At a fault

    - "raise" raises, and the state stays as it was;
    - "hold" gives the last torque of the controller less damping, tau = tau_safe - (t/T)·λ·M(q) v, which sets in over
      T = `longest_hold`, and then does as "stop"; so it does at once where a measurement is out of range but right, or
      the torque has no effect;
    - "stop" brings the arm to rest: tau = M(q)(-λ v) + bias(q, v) - r, with r what a momentum observer of bandwidth λ
      finds to act beside the motors: an unknown payload, and the environment, whatever is said of it. Where the limits
      do not admit that, tau = bias(q, 0) - λ·diag(M) v - r: damping on every joint by itself takes energy from the arm
      also where it is cut off. A joint on which torque has no effect gets back to the torque that it carried before.

    Positions and velocities that agree are believed, however large. Where one of the two is lost on a joint, the other
    one gives it. Where both are lost on a joint the guard is blind: for `longest_blind` the model predicts q and v,
    v⁺ = v + h·a, a by ABA from tau and r. From then on the output says `brakes_requested` and the torque decays,
    tau⁺ = tau·e^(-h/`longest_blind`), or as fast as the rate limit allows. Without brakes a heavy arm then sinks.
    Where positions alone are lost the arm comes to rest as far as its velocity is measured, and drifts with an offset
    of that: after twice `longest_blind` the output says `brakes_requested`, while the torque continues to hold the arm.

    What is guaranteed: an arm that is seen comes to rest, as long as the limits admit the torque and the environment
    pushes with less. A blind arm comes to rest within `longest_blind` as far as model and r are right; whether they are
    or not, its torque never stays the same, and goes to zero.

    The controller is back after `patience` ticks without a fault; an arm that was out of range first slows down to half
    of its range of speed. Where inputs were lost for less than `LONGEST_PERIOD` control periods and the arm is near
    where the impedance wants it, the return is a late tick; else a `SoftStart` from where the arm is and the torque
    that acts. What the controller's integral knows of the load stays, unless the torque had no effect.

    A sensor that freezes at rest looks like a brake: q and v stay the same whatever the torque. Where torque has no
    effect and q is bitwise constant the output says `brakes_requested`, too, and the controller is tried again ever
    less often; the torque is taken back with its impulse, which also stops an arm that has moved unseen.

    Around a `CartesianController` the same holds: references are `CartesianReference`, outputs have the tool's as
    `at_tool`, and the way back is that of the tool. tau_ext stays a torque of the joints: Jᵀ·wrench for a wrist sensor.

    `step` is pure, as of any controller. The first tick has nothing to fall back on: there every policy raises, unless
    the measurement is right and only out of range.

    Attributes:
        controller: The controller that is guarded.
        policy: What to do at a fault.
        range: Measurements that are plausible; the arm's own by default.
        rate: λ, at which a motion dies away [1/s].
        longest_hold: Time after which "hold" becomes "stop" [s].
        longest_blind: Time for which the model replaces lost measurements, and in which the torque decays after [s].
        patience: Ticks without a fault after which the controller is back.
        way_back: Shortest time in which the controller returns to the desired motion [s].
        frozen_ticks: Fewest identical measurements that count as frozen; see `Monitor`.
        frozen_travel: Motion that has to show meanwhile [rad or m]; see `Monitor` and `EffectMonitor`.

    Raises:
        ParameterError: An unknown policy, a number that is not positive, or λ beyond half of 1/dt.
    """

    policy: Policy
    range: OperatingRange
    rate: float
    longest_hold: float
    longest_blind: float
    patience: int
    way_back: float
    frozen_ticks: int
    frozen_travel: float
    _motion: DesiredMotion
    _monitor: Monitor
    _effect: EffectMonitor
    _believer: Believer
    _braking: Braking
    _start: SoftStart
    _on_event: Callable[[FaultEvent], object] | None

    def __init__(
        self,
        controller: WrappableController[Any] | CartesianControllerBase[Any],
        policy: Policy = "stop",
        *,
        limits: Limits | ArrayLike | None = None,
        range: OperatingRange | None = None,
        rate: float = 20.0,
        longest_hold: float = 0.1,
        longest_blind: float = 0.25,
        patience: int = 5,
        way_back: float = 0.1,
        frozen_ticks: int = 3,
        frozen_travel: float = 2e-4,
        on_event: Callable[[FaultEvent], object] | None = None,
    ) -> None:
        """Guard a controller.

        Args:
            controller: The controller to guard; other guards may be inside.
            policy: "raise", "hold" or "stop".
            limits: Limits of what leaves; see the attribute.
            range: Plausible measurements.
            rate: λ [1/s].
            longest_hold: Longest time to hold [s].
            longest_blind: Longest time with the model's prediction alone [s].
            patience: Ticks without a fault after which the controller is back, at least 1.
            way_back: Shortest time of the way back [s]; see `SoftStart`.
            frozen_ticks: See `Monitor`, at least 1.
            frozen_travel: See `Monitor`; more than twice the resolution of the encoders.
            on_event: Called at every change, for logs; the result of `step` does not depend on it.
        """
        arm = controller.arm
        choice("policy", policy, get_args(Policy))
        rate = positive_number("rate", rate, "rate in 1/s")
        if rate * controller.dt > 0.5:
            raise ParameterError("rate", rate, f"at most 0.5/dt = {0.5 / controller.dt:g} 1/s")
        set_fields(
            self,
            controller=in_joints(controller),
            policy=policy,
            range=OperatingRange(arm) if range is None else range,
            rate=rate,
            longest_hold=positive_number("longest_hold", longest_hold, "time in seconds"),
            longest_blind=positive_number("longest_blind", longest_blind, "time in seconds"),
            patience=whole_number("patience", patience, 1, "ticks"),
            way_back=positive_number("way_back", way_back, "time in seconds"),
            frozen_ticks=whole_number("frozen_ticks", frozen_ticks, 1, "ticks"),
            frozen_travel=positive_number("frozen_travel", frozen_travel, "way in rad or m"),
            _on_event=on_event,
        )
        self._make_parts(_limits(arm, self.controller.limits if limits is None else limits))

    def _make_parts(self, limits: Limits) -> None:
        arm, range, dt = self.arm, self.range, self.dt
        motion = desired_motion(self.controller)
        set_fields(
            self,
            _motion=motion,
            _monitor=Monitor(motion, range, self.frozen_ticks, self.frozen_travel),
            _effect=EffectMonitor(self.frozen_travel, limits.effort),
            _believer=Believer(arm, range, self.rate, dt),
            _braking=Braking(arm, limits, self.rate, self.longest_blind, dt),
            _start=SoftStart(self.controller, self.way_back, acceleration=_EASY),
        )

    @property
    def limits(self) -> Limits:
        """What leaves is within these; those of the controller by default, else the arm's effort limits."""
        return self._braking.limits

    def init(self) -> FaultGuardState:
        """Return the state before the first tick."""
        return FaultGuardState(
            inner=self._start.init(),
            monitor=self._monitor.init(),
            effect=self._effect.init(),
            known=self._believer.init(),
            **dict.fromkeys(("tau", "safe", "tau_ext"), np.zeros(self.arm.nv)),
            reference=self._motion.at_rest(),
            offset=np.zeros((2, len(self._motion.usual_speed))),
            response="run",
            fault=None,
            since=0.0,
            sound=0,
            period=None,
        )

    def elapsed(self, state: FaultGuardState, period: float) -> FaultGuardState:
        """Return the state at a tick that comes a measured time after the one before, instead of dt after it.

        Args:
            state: From the tick before.
            period: Time since then [s]. One that cannot be is a fault of the tick to come.
        """
        try:
            measured = float(period)
        except (TypeError, ValueError):
            measured = -1.0
        return state._replace(period=measured if 0.0 < measured < np.inf else -1.0)

    def handover(self, state: FaultGuardState, now: Situation) -> FaultGuardState:
        """Return the state with which the arm is taken over as it is now; see `SoftStart.handover`.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        inner = self._start.handover(state.inner, now)
        return state._replace(inner=inner, tau=np.array(now.tau), tau_ext=np.array(now.tau_ext))

    def _step(
        self, state: FaultGuardState, given: Measured
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """A tick.

        Raises:
            FaultError: A fault, where the policy is "raise" or the tick is the first.
        """
        with np.errstate(all="ignore"):  # whatever overflows is found by looking at it
            now, fault = self._now(state, given)
            if fault is None and (state.response == "run" or now.sound >= self.patience):
                output, fault, following = self._run(state, now)
                if fault is None and output is not None:
                    return self._told(state, output, following)
                now = now._replace(sound=0, fault=fault)
            has_torque = state.monitor.ticks > 0 or (fault is not None and _is_seen(fault))
            if fault is not None and not (has_torque and self.policy != "raise"):
                raise FaultError(fault)
            return self._told(state, *self._fall_back(state, now))

    def _now(self, state: FaultGuardState, given: Measured) -> tuple[FaultGuardState, Fault | None]:
        """The state with what is known of the arm at this tick, and what is wrong."""
        fault = _NO_PERIOD if state.period == -1.0 else None
        period = self.dt if state.period is None or fault else state.period
        reading, monitor = self._monitor.read(state.monitor, given, state.offset[1], period)
        desired = state.reference if reading.reference is None else reading.reference
        told = np.zeros_like(state.tau) if reading.tau_ext is None else reading.tau_ext
        known = self._believer.update(state.known, reading, state.tau, period)
        stuck, effect = self._effects(state, known, told, period)
        fault = fault or reading.fault or stuck
        now = state._replace(
            monitor=monitor,
            effect=effect,
            known=known,
            tau_ext=told,
            reference=desired,
            fault=state.fault if _is_idle(state.fault) else fault or state.fault,
            sound=0 if fault or self._is_settling(state, known) else state.sound + 1,
            since=state.since + period,
            period=None if state.period is None else period,
        )
        return now, fault

    def _effects(
        self, state: FaultGuardState, known: Belief, tau_ext: Array, period: float
    ) -> tuple[Fault | None, EffectState]:
        """A fault where the torque that was sent moves nothing."""
        if state.monitor.ticks == 0 or known.blind > 0.0:
            return None, self._effect.init()
        stuck, effect = self._effect.look(
            state.effect,
            moved=self.arm.raw_dynamics.difference(state.known.q, known.q),
            net=state.tau + tau_ext - known.observer.bias,
            inertia=known.observer.M.diagonal().copy(),
            period=period,
        )
        if state.response != "run" or stuck is None:
            return None, effect
        joints = tuple(self.arm.joint_names[i] for i in np.flatnonzero(stuck))
        words = "the torque moves nothing (brakes, a drive that is off, something in the way)"
        return Fault("no effect", "tau", joints, f"{words}: {', '.join(joints)}"), effect

    def _is_settling(self, state: FaultGuardState, known: Belief) -> bool:
        """Whether the arm was out of range and is not yet slow, or a torque without effect is not yet back."""
        if state.response == "run" or state.fault is None:
            return False
        if _is_idle(state.fault):
            return state.since < max(MEMORY, 0.5 * state.effect.constant)
        is_fast = (np.abs(known.v) > 0.5 * self.range.velocity).any()
        return state.fault.kind == "out of range" and bool(is_fast)

    def _run(
        self, state: FaultGuardState, now: FaultGuardState
    ) -> tuple[GuardedOutput | None, Fault | None, FaultGuardState]:
        """A tick of the controller itself; a fault where it gives no finite torque."""
        (q, v, *_), reference, tau_ext = now.known, now.reference, now.tau_ext
        try:
            output, inner = self._late(state, now) or self._start.follow(
                self._taken_over(state, now), q, v, reference, tau_ext
            )
        except (InputError, ArithmeticError, np.linalg.LinAlgError) as error:
            words = f"the controller cannot compute a torque: {error}"
            return None, Fault("controller", "tau", (), words), now
        told: GuardedOutput = guarded(output)
        if not (is_finite(told.tau) and is_finite(inner.inner)):
            words = "the controller's torque or state is not finite"
            return None, Fault("controller", "tau", (), words), now
        tau = self._within(state, now, told.tau)
        if tau is not told.tau:
            told = told._replace(tau=tau)
        following = now._replace(
            inner=inner,
            tau=(own := tau.copy()),
            safe=own,
            offset=self._motion.offset(output, reference),
            response="run",
            fault=None,
            since=0.0,
            period=None,
        )
        return told, None, following

    def _late(
        self, state: FaultGuardState, now: FaultGuardState
    ) -> tuple[ControllerOutput, SoftStartState] | None:
        """The tick as a late one, where inputs were lost for a short time and the arm has stayed near its motion."""
        away = now.since + self.dt
        is_brief = state.response != "run" and away < LONGEST_PERIOD * self.dt
        if not (is_brief and state.fault is not None and state.fault.kind in _OF_INPUTS):
            return None
        inner = self._start.elapsed(state.inner, away)
        if self._start.has_jumped(inner, now.reference):
            return None
        output, inner = self._start.follow(inner, *now.known[:2], now.reference, now.tau_ext)
        is_near = (np.abs(output.e1) < _NEAR) & (np.abs(output.e2) < _EASY * self.way_back)
        return (output, inner) if is_near.all() else None

    def _taken_over(self, state: FaultGuardState, now: FaultGuardState) -> SoftStartState:
        """State of the controller for this tick; where it was away, with a soft start."""
        start, is_late, inner = self._start, _is_late(now, self.dt), state.inner
        if now.period is not None:
            inner = start.elapsed(inner, now.period)
        was_away = state.response != "run" or is_late
        if was_away or (state.monitor.ticks > 0 and start.has_jumped(inner, now.reference)):
            before = start.init() if is_late or _is_idle(state.fault) else state.inner
            return start.handover(before, self._situation(state, now))
        return inner

    def _situation(self, state: FaultGuardState, now: FaultGuardState) -> Situation:
        """The arm as it is; after a long pause, at rest with what holds it."""
        dynamics, (q, v, *_), zero = self.arm.raw_dynamics, now.known, np.zeros(self.arm.nv)
        if _is_late(now, self.dt):
            return Situation(q, v, zero, now.reference, dynamics.bias(q, zero), now.tau_ext)
        a = dynamics.forward_dynamics(q, v, state.tau + now.known.r)
        return Situation(q, v, a, now.reference, state.tau, now.tau_ext)

    def _fall_back(
        self, state: FaultGuardState, now: FaultGuardState
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """A tick of the policy."""
        since = 0.0 if state.response == "run" else now.since
        is_lost = now.known.blind > self.longest_blind
        response = self._response(state, now, since)
        braking, known = self._braking, now.known
        if is_lost:
            tau = braking.decay(state.tau, now.period or self.dt)
        elif response == "hold":
            tau = braking.hold(now.safe, known, since / self.longest_hold)
        else:
            back = braking.relax(known, state.tau, now.tau_ext, now.effect)
            tau = np.where(now.effect.stuck, back, braking.stop(known, state.tau))
        tau = self._within(state, now, tau)
        at_limit = np.abs(tau) >= self.limits.effort
        is_changing = np.abs(tau - state.tau) >= self.limits.rate * self.dt
        at = Situation(known.q, known.v, np.zeros_like(tau), now.reference, tau, now.tau_ext)
        output = self._motion.output(at, now.offset)
        output = output._replace(saturated=at_limit, rate_limited=is_changing & ~at_limit)
        following = now._replace(tau=tau, response=response, since=since, period=None)
        is_unseen = _is_idle(now.fault) and now.effect.constant >= self.frozen_ticks * self.dt
        is_adrift = (now.monitor.joints[SINCE_Q] > 2.0 * self.longest_blind).any()
        return guarded(
            output, response, now.fault, bool(is_lost or is_unseen or is_adrift)
        ), following

    def _response(self, state: FaultGuardState, now: FaultGuardState, since: float) -> Response:
        is_early = state.response != "stop" and since < self.longest_hold
        is_held = is_early and not (now.fault and _is_seen(now.fault))
        return "hold" if self.policy == "hold" and is_held else "stop"

    def _within(self, state: FaultGuardState, now: FaultGuardState, tau: Array) -> Array:
        """The nearest torque that may leave."""
        return self._braking.within(
            tau, state.tau, state.monitor.ticks == 0 or _is_late(now, self.dt)
        )

    def _told(
        self, state: FaultGuardState, output: GuardedOutput, following: FaultGuardState
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """The output; `on_event` is called at changes."""
        before, now = (state.fault or _NONE).kind, (output.fault or _NONE).kind
        if (state.response, before) != (output.response, now) and self._on_event is not None:
            self._on_event(FaultEvent(state.monitor.ticks, output.response, output.fault))
        return output, following


_EASY = 5.0  # rad/s² or m/s²: acceleration of the way back
_NEAR = 0.01  # rad or m: from which the controller goes back by itself
_OF_INPUTS = ("malformed", "not finite", "jump", "inconsistent", "frozen")
_NONE = Fault("malformed", "", (), "")
_NO_PERIOD = Fault("malformed", "period", (), "period has to be a positive time in seconds")


def _limits(arm: ArmModel, limits: Limits | ArrayLike | None) -> Limits:
    """The limits, or the arm's; one number per joint."""
    chosen = as_limits(limits, arm.nv) or Limits(effort=arm.effort_limit)
    return Limits(
        effort=per_joint("limits.effort", chosen.effort, arm.nv),
        rate=per_joint("limits.rate", chosen.rate, arm.nv),
    )


def _is_late(now: FaultGuardState, dt: float) -> bool:
    return now.period is not None and now.period > LONGEST_PERIOD * dt


def _is_seen(fault: Fault) -> bool:
    """Whether the motion is measured well and the arm is to come to rest at once."""
    is_outside = fault.kind == "out of range" and fault.name in ("q", "v")
    return is_outside or _is_idle(fault)


def _is_idle(fault: Fault | None) -> bool:
    """Whether the torque has no effect; other faults do not end that."""
    return fault is not None and fault.kind == "no effect"
