"""Run-time policy: what a controller does when its inputs, its state or its torque cannot be trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, is_finite, per_joint, positive_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import InputError, ParameterError
from ...interaction.estimators import MomentumObserver, MomentumState
from ...law.limits import Limits, as_limits
from ...robot.arm_model import ArmModel
from ...trajectories import Reference
from ..controller import LONGEST_PERIOD, ControllerOutput
from ..protocol import Controller
from ..telemetry import flags
from .fault_telemetry import FaultEvent as FaultEvent  # noqa: PLC0414 (part of this module's interface)
from .fault_telemetry import FaultGuardState as FaultGuardState  # noqa: PLC0414 (likewise)
from .fault_telemetry import GuardedOutput as GuardedOutput  # noqa: PLC0414 (likewise)
from .fault_telemetry import Policy, Response
from .faults import Fault, FaultError, OperatingRange
from .handover import handed_over, takes_period
from .input_monitor import Monitor, Reading


@brief_repr("policy", "limits", "controller")
@dataclass(frozen=True, eq=False, init=False)
class FaultGuard:
    """A controller that meets faults with a policy; what leaves it is finite and within the limits, always.

    Every tick is judged by a `Monitor`, and so is the torque that the controller computes. At a fault

    - "raise" raises, and the state stays as it was;
    - "hold" gives the last torque of the controller less damping, tau = tau_safe - (t/T)·λ·M(q) v, which sets in over
      T = `longest_hold`, and then does as "stop";
    - "stop" brings the arm to rest: tau = M(q)(-λ v) + bias(q, v) - r, with r what a momentum observer of bandwidth λ
      finds to act beside the motors: an unknown payload, and the environment, whatever is told of it.

    Where q and v cannot be used the model tells how they went on: v⁺ = v + h·a, a by ABA from tau and r.

    The controller is back after `patience` ticks without a fault. Its impedance filter then starts from where the arm
    is, q_e = q (-) q_d and v_e = v - v_d, so that the errors are zero and the arm returns to the desired motion as its
    target impedance lets it; what the integrator knows of the load stays. The torque meets the rate limit all along.

    `step` is pure, as of any controller. The first tick has nothing to fall back on: there every policy raises.

    Attributes:
        controller: The controller that is guarded.
        policy: What to do at a fault.
        limits: What leaves is within these; those of the controller by default, else the arm's effort limits.
        range: Measurements that are plausible; the arm's own by default.
        rate: λ, at which a motion dies away [1/s].
        longest_hold: Time after which "hold" becomes "stop" [s].
        patience: Ticks without a fault after which the controller is back.
        frozen_ticks: Fewest identical measurements that count as frozen; see `Monitor`.
        frozen_travel: Motion that has to show meanwhile [rad or m]; see `Monitor`.

    Raises:
        ParameterError: An unknown policy, a number that is not positive, or λ beyond half of 1/dt.
    """

    controller: Controller[Any]
    policy: Policy
    limits: Limits
    range: OperatingRange
    rate: float
    longest_hold: float
    patience: int
    frozen_ticks: int
    frozen_travel: float
    _monitor: Monitor
    _observer: MomentumObserver
    _on_event: Callable[[FaultEvent], object] | None

    def __init__(
        self,
        controller: Any,
        policy: Policy = "stop",
        *,
        limits: Limits | ArrayLike | None = None,
        range: OperatingRange | None = None,
        rate: float = 20.0,
        longest_hold: float = 0.1,
        patience: int = 5,
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
            patience: Ticks without a fault after which the controller is back, at least 1.
            frozen_ticks: See `Monitor`, at least 1.
            frozen_travel: See `Monitor`; more than twice the resolution of the encoders.
            on_event: Is told of every change, for logs; the answer of `step` does not depend on it.
        """
        arm: ArmModel = controller.arm
        if policy not in get_args(Policy):
            raise ParameterError("policy", policy, '"raise", "hold" or "stop"')
        rate = positive_number("rate", rate, "rate in 1/s")
        if rate * controller.dt > 0.5:
            raise ParameterError("rate", rate, f"at most 0.5/dt = {0.5 / controller.dt:g} 1/s")
        range = OperatingRange(arm) if range is None else range
        frozen_ticks = _count("frozen_ticks", frozen_ticks)
        travel = positive_number("frozen_travel", frozen_travel, "way in rad or m")
        set_fields(
            self,
            controller=controller,
            policy=policy,
            limits=_limits(arm, limits, controller),
            range=range,
            rate=rate,
            longest_hold=positive_number("longest_hold", longest_hold, "time in seconds"),
            patience=_count("patience", patience),
            frozen_ticks=frozen_ticks,
            frozen_travel=travel,
            _monitor=Monitor(arm, range, frozen_ticks, travel),
            _observer=MomentumObserver(arm, rate, controller.dt),
            _on_event=on_event,
        )

    @property
    def arm(self) -> ArmModel:
        """The controller's own model of the arm."""
        return self.controller.arm

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return self.controller.dt

    def init(self) -> FaultGuardState:
        """Return the state before the first tick."""
        zero, q = np.zeros(self.arm.nv), np.array(self.arm.neutral)
        return FaultGuardState(
            inner=self.controller.init(),
            monitor=self._monitor.init(),
            observer=self._observer.init(),
            q=q,
            v=zero,
            tau=zero,
            safe=zero,
            tau_ext=zero,
            q_e=zero,
            v_e=zero,
            reference=Reference(q, zero, zero),
            response="run",
            fault=None,
            since=0.0,
            sound=0,
        )

    def step(
        self,
        state: FaultGuardState,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
        period: float | None = None,
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """Compute the torque of one tick; see `ImpedanceController.step`.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick.
            tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].
            period: Measured time since the tick before; dt if it is not given [s].

        Raises:
            FaultError: A fault, where the policy is "raise" or the tick is the first.
        """
        with np.errstate(all="ignore"):  # whatever overflows is found by looking at it
            elapsed, fault = self._elapsed(period)
            reading, monitor = self._monitor.read(
                state.monitor, q, v, reference, tau_ext, state.v_e, elapsed
            )
            fault = fault or reading.fault
            believed = self._believed(state, reading, elapsed)._replace(monitor=monitor)
            sound = 0 if fault else state.sound + 1
            believed = believed._replace(sound=sound, fault=fault or state.fault)
            is_running = state.response == "run"
            if fault is None and (is_running or sound >= self.patience):
                output, fault, following = self._run(state, believed, elapsed, period)
                if fault is None and output is not None:
                    return self._told(state, output, following)
                believed = believed._replace(sound=0, fault=fault)
            if fault is not None and (self.policy == "raise" or state.monitor.ticks == 0):
                raise FaultError(fault)
            return self._told(state, *self._fall_back(state, believed, elapsed))

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im; see `ImpedanceController.impedance_error`.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        return self.controller.impedance_error(output, a)

    def _elapsed(self, period: float | None) -> tuple[float, Fault | None]:
        """Time since the tick before; the period, and a fault, where what was measured cannot be."""
        if period is None:
            return self.dt, None
        try:
            elapsed = float(period)
        except (TypeError, ValueError):
            elapsed = np.nan
        if 0.0 < elapsed < np.inf:
            return elapsed, None
        words = f"period is {period!r}; it has to be a positive time in seconds"
        return self.dt, Fault("malformed", "period", (), words)

    def _believed(
        self, state: FaultGuardState, reading: Reading, elapsed: float
    ) -> FaultGuardState:
        """The state with q, v, tau_ext, reference and r as far as they are known at this tick."""
        tau_ext = np.zeros_like(state.tau) if reading.tau_ext is None else reading.tau_ext
        desired = state.reference if reading.reference is None else reading.reference
        following = state._replace(tau_ext=tau_ext, reference=desired)
        if reading.q is not None and reading.v is not None:
            observer = self._observed(state, reading.q, reading.v, elapsed)
            return following._replace(q=reading.q, v=reading.v, observer=observer)
        following = following._replace(observer=state.observer._replace(v=None))
        q, v = self._predicted(state, min(elapsed, LONGEST_PERIOD * self.dt))
        return following._replace(q=q, v=v) if is_finite((q, v)) else following

    def _observed(
        self, state: FaultGuardState, q: Array, v: Array, elapsed: float
    ) -> MomentumState:
        """What the momentum says of the torque that neither motors nor model explain."""
        observer = self._observer
        if elapsed != self.dt:
            observer = MomentumObserver(self.arm, self.rate, elapsed)
        _, following = observer.step(state.observer, q, v, state.tau, state.tau_ext)
        return following if is_finite(following) else state.observer._replace(v=None)

    def _predicted(self, state: FaultGuardState, elapsed: float) -> tuple[Array, Array]:
        """Where the model says that the state went since the tick before."""
        dynamics, q, v = self.arm.raw_dynamics, state.q, state.v
        torque = state.tau + state.observer.r
        steps = max(round(elapsed / self.dt), 1)
        h = elapsed / steps
        for _ in range(steps):
            v = v + h * dynamics.damped_forward_dynamics(q, v, torque, h)
            if not (np.abs(v) <= 2.0 * self.range.velocity).all():
                return q, np.full_like(v, np.nan)
            q = dynamics.integrate(q, h * v)
        return q, v

    def _run(
        self,
        state: FaultGuardState,
        believed: FaultGuardState,
        elapsed: float,
        period: float | None,
    ) -> tuple[GuardedOutput | None, Fault | None, FaultGuardState]:
        """A tick of the controller itself; a fault where it gives no finite torque."""
        step: Any = self.controller.step
        inner, since = state.inner, {}
        is_late = elapsed > LONGEST_PERIOD * self.dt
        if state.response != "run" or is_late:
            inner = handed_over(self.controller, inner, believed)
        elif period is not None and takes_period(self.controller):
            since = {"period": elapsed}
        try:
            output, following = step(
                inner, believed.q, believed.v, believed.reference, believed.tau_ext, **since
            )
        except (InputError, ArithmeticError, np.linalg.LinAlgError) as error:
            words = f"the controller cannot compute a torque: {error}"
            return None, Fault("controller", "tau", (), words), believed
        if not (is_finite(output.tau) and is_finite(following)):
            words = "the controller's torque or state is not finite"
            return None, Fault("controller", "tau", (), words), believed
        tau = self._within(state, output.tau)
        if not np.array_equal(tau, output.tau):
            output = output._replace(tau=tau)
        following = believed._replace(
            inner=following,
            tau=tau,
            safe=tau,
            q_e=output.q_e,
            v_e=output.v_e,
            response="run",
            fault=None,
            since=0.0,
        )
        return GuardedOutput.of(output), None, following

    def _fall_back(
        self, state: FaultGuardState, believed: FaultGuardState, elapsed: float
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """A tick of the policy."""
        since = 0.0 if state.response == "run" else state.since + elapsed
        is_held = self.policy == "hold" and state.response != "stop" and since < self.longest_hold
        response: Response = "hold" if is_held else "stop"
        dynamics, q, v = self.arm.raw_dynamics, believed.q, believed.v
        if is_held:
            rate = self.rate * since / self.longest_hold
            tau = believed.safe - rate * dynamics.mass_matrix(q) @ v
        else:
            tau = dynamics.inverse_dynamics(q, v, -self.rate * v) - believed.observer.r
        tau = self._within(state, tau)
        output = self._output(believed, tau)
        following = believed._replace(tau=tau, response=response, since=since)
        return GuardedOutput.of(output, response, believed.fault), following

    def _output(self, believed: FaultGuardState, tau: Array) -> ControllerOutput:
        """What there is to say of a tick without the controller."""
        q_d, v_d, a_d = believed.reference
        q_r = self.arm.raw_dynamics.integrate(q_d, believed.q_e)
        v_r = v_d + believed.v_e
        e1 = self.arm.raw_dynamics.difference(believed.q, q_r)
        zero = np.zeros_like(tau)
        at_limit = np.abs(tau) >= self.limits.effort
        change = np.abs(tau - believed.tau) >= self.limits.rate * self.dt
        return ControllerOutput(
            tau.copy(),
            *(q_r, v_r, a_d.copy(), e1, v_r - believed.v),
            s=zero,
            u=zero.copy(),
            q_e=believed.q_e.copy(),
            v_e=believed.v_e.copy(),
            premise_holds=np.zeros(self.arm.nv, dtype=np.bool_),
            **flags(self.arm.nv, saturated=at_limit, rate_limited=change & ~at_limit),
        )

    def _within(self, state: FaultGuardState, tau: Array) -> Array:
        """The nearest torque that may leave; the one before where there is none."""
        effort = self.limits.effort
        if not np.isfinite(tau).all():
            tau = state.tau
        if state.monitor.ticks > 0:
            change = self.limits.rate * self.dt
            tau = np.clip(tau, state.tau - change, state.tau + change)
        within: Array = np.clip(tau, -effort, effort)
        return within

    def _told(
        self, state: FaultGuardState, output: GuardedOutput, following: FaultGuardState
    ) -> tuple[GuardedOutput, FaultGuardState]:
        """The answer; whoever wants to know of changes is told."""
        before, now = (state.fault or _NONE).kind, (output.fault or _NONE).kind
        has_changed = (state.response, before) != (output.response, now)
        if has_changed and self._on_event is not None:
            self._on_event(FaultEvent(state.monitor.ticks, output.response, output.fault))
        return output, following


_NONE = Fault("malformed", "", (), "")


def _limits(arm: ArmModel, limits: Limits | ArrayLike | None, controller: object) -> Limits:
    """The limits given, or the controller's, or the arm's; one number per joint."""
    while limits is None and controller is not None:
        limits = getattr(controller, "limits", None)
        controller = getattr(controller, "controller", None)
    chosen = as_limits(limits) or Limits(effort=arm.effort_limit)
    return Limits(
        effort=per_joint("limits.effort", chosen.effort, arm.nv),
        rate=per_joint("limits.rate", chosen.rate, arm.nv),
    )


def _count(name: str, value: Any) -> int:
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
        raise ParameterError(name, value, "a whole number of ticks, at least 1")
    return int(value)
