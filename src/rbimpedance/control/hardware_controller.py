"""The impedance controller for an arm as it is delivered: counted positions, and torque that is late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, choice, per_joint, positive, positive_or_infinite
from .._common.brief import brief_repr
from .._common.frozen import MadeAnew, set_fields
from ..law.impedance import TargetImpedance
from ..law.limits import Limits, as_limits
from ..law.observed_law import commanded
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..trajectories import Reference
from .baseline_law import Baseline, BaselineTorque, baseline_output
from .default_gains import default_impedance
from .errors import Tracking, track
from .estimation import Estimate, ExtendedStateObserver, FrictionLearner, NoiseGate
from .estimation.friction_learning import (
    Expectation,
    FrictionState,
    nothing_known,
    released,
    waves,
)
from .hardware_forms import PlainForm, hardware_form
from .hardware_state import HardwareState
from .protocol import Measured, checked_period
from .realtime import RealtimeController
from .telemetry import ControllerOutput, Situation

Wave: TypeAlias = tuple[Array, Array]

OBSERVER_RATIO = 3.0
"""Bandwidth of the observer over that of the loop."""

HardwareBackend: TypeAlias = Literal["numpy", "compiled"]
"""Who computes a tick."""

LEARNING_STARTS = 200
"""Ticks before friction is learned: the observer settles first."""


class Bandwidths(NamedTuple):
    """Bandwidths of the loop; the observer's are `OBSERVER_RATIO` times as high.

    Attributes:
        quiet: While counting explains what the encoders show, shape (nv,) [rad/s].
        alert: While it does not, shape (nv,) [rad/s].
    """

    quiet: Array
    alert: Array


@brief_repr("arm", "hardware", "dt", "impedance", "bandwidths", "limits")
@dataclass(frozen=True, eq=False, init=False)
class HardwareController(MadeAnew, Baseline[HardwareState]):
    """Robust impedance control on estimated speed and disturbance, for encoders that count and torque that lags.

    An `ImpedanceController` differentiates what the encoders count, and multiplies it by a high gain: on encoders of
    17 to 20 bits the torque is noise. Here an observer with model, delay and lag inside (`ExtendedStateObserver`) gives
    position, speed and disturbance; the law acts on the state that the observer expects `delay` ticks ahead, when the
    torque will begin to act:

        s = e2 + ω·e1,    tau = M(q)·{a_r + (ω·e2 + u)/(1 + ω·h/2)} + bias(q, v) - tau_ext - d + friction

    with ω the bandwidth, u the super-twisting term (`reaching_term`), d the observer's disturbance, which takes the
    place of its integral, and the learned friction at the speed of the reference when the torque will act; friction
    stands for what is learned of the load, too (`FrictionLearner`). A `NoiseGate` keeps ω low as long as counting
    explains what the encoders show and the error is small. The velocity that `step` is given is not used, and e1 and
    e2 of its output are those that the law sees.

    Attributes:
        arm: The controller's model of the arm.
        hardware: What is between tick and links.
        impedance: Target impedance.
        bandwidths: Of the loop, quiet and alert; `propose_gains(..., hardware=...)` computes them.
        dt: Control period [s].
        k2: Acceleration up to which the reaching term is linear, shape (nv,) [rad/s² or m/s²].
        learns_friction: Whether friction and load are learned; not for joints with springs.
        accuracy: Error at which the gate begins to open, shape (nv,); infinite for never [rad or m].
        expected: What is known of friction and load beforehand.
        load: The model with one more kilogram where the arm carries its load; at the tool frame by default.
        limits: Limits of the torque; the hardware's `torque_rate` is one.
        backend: "compiled"; or "numpy" for the readable form, which specifies it, and which computes the ticks at which
            a limit is exceeded, and what has no compiled form.

    Raises:
        ParameterError: A number that is not positive.
        DimensionError: A number for another number of joints.
    """

    hardware: Hardware
    bandwidths: Bandwidths
    k2: Array
    learns_friction: bool
    accuracy: Array
    expected: Expectation
    load: ArmModel
    limits: Limits | None
    backend: HardwareBackend
    observer: ExtendedStateObserver
    gate: NoiseGate
    learner: FrictionLearner
    _form: PlainForm
    _made = ("_form",)

    def __init__(
        self,
        arm: ArmModel,
        hardware: Hardware,
        impedance: TargetImpedance | None = None,
        *,
        bandwidths: tuple[ArrayLike, ArrayLike],
        dt: float = 1e-3,
        k2: ArrayLike = 1e4,
        learns_friction: bool = True,
        accuracy: ArrayLike = np.inf,
        expected: Expectation | None = None,
        load: ArmModel | None = None,
        limits: Limits | ArrayLike | None = None,
        backend: HardwareBackend = "compiled",
    ) -> None:
        super().__init__(arm, default_impedance(arm) if impedance is None else impedance, dt)
        quiet, alert = (
            per_joint(name, positive(name, value), arm.nv)
            for name, value in zip(("quiet", "alert"), bandwidths, strict=True)
        )
        set_fields(
            self,
            hardware=hardware,
            bandwidths=Bandwidths(quiet, alert),
            k2=per_joint("k2", positive("k2", k2), arm.nv),
            learns_friction=bool(learns_friction),
            accuracy=per_joint("accuracy", positive_or_infinite("accuracy", accuracy), arm.nv),
            expected=(nothing_known(arm.nv, hardware.ripple) if expected is None else expected),
            load=arm.with_payload(1.0) if load is None else load,
            limits=_with_rate(as_limits(limits, arm.nv), hardware),
            backend=choice("backend", backend, get_args(HardwareBackend)),
        )
        if self.limits is not None:
            self.limits.check(arm.nv)
        self._make_estimators()
        self._make()

    def _make_estimators(self) -> None:
        arm, dt, hardware = self.arm, self.dt, self.hardware
        (quiet, alert), count = self.bandwidths, hardware.count(arm)
        expected = self.expected if self.learns_friction else nothing_known(arm.nv)
        set_fields(
            self,
            observer=ExtendedStateObserver(
                arm, OBSERVER_RATIO * quiet, dt, lag=hardware.lag(arm), delay=hardware.delay
            ),
            gate=NoiseGate(quiet, alert, count, dt, OBSERVER_RATIO, accuracy=self.accuracy),
            learner=FrictionLearner(arm.nv, dt, stribeck=hardware.stribeck, expected=expected),
        )

    def _make(self) -> None:
        form = hardware_form(self) if self.backend == "compiled" else PlainForm()
        set_fields(self, _form=form)

    @property
    def lead(self) -> Array:
        """Time from a tick to its torque, shape (nv,): as far ahead of it friction is fed forward [s]."""
        return self.hardware.delay_bound(self.arm, self.dt)

    @property
    def ripple_periods(self) -> Array:
        """Periods of the torque's ripple to a turn, shape (nv,)."""
        return per_joint("ripple_periods", self.hardware.ripple_periods, self.arm.nv)

    @property
    def learning_starts(self) -> float:
        """Ticks before friction is learned: the observer settles first. Infinite where it is not learned."""
        return LEARNING_STARTS if self.learns_friction else np.inf

    def init(self) -> HardwareState:
        """Return the state before the first tick: filter at rest, no disturbance, no friction known."""
        observer = self.observer.init(self.arm.neutral)
        parts = self._filter_at_rest(), observer, self.gate.init(), self.learner.init()
        return HardwareState.pack(0, *parts, observer.torque)

    def _step(
        self, state: HardwareState, given: Measured
    ) -> tuple[ControllerOutput, HardwareState]:
        answer: tuple[ControllerOutput, HardwareState] | None
        try:
            answer = self._form.step(state, given)
        except (TypeError, ValueError):  # not plain vectors
            answer = None
        return self._numpy_step(state, given) if answer is None else answer

    def realtime(self, state: HardwareState | None = None) -> RealtimeController:
        """Return the tick for a real-time loop: torque only, in memory that is made once.

        Args:
            state: State to begin with; `init()` by default.
        """
        tick: Any = RealtimeController
        realtime: RealtimeController = tick(self, self._form, state)
        return realtime

    def _numpy_step(
        self, state: HardwareState, given: Measured
    ) -> tuple[ControllerOutput, HardwareState]:
        """The readable form of the tick, which specifies the compiled one."""
        q_e, v_e = state.filter.q_e, state.filter.v_e
        tick = track(self.arm, self._filter, q_e, v_e, given)
        state = state if state.ticks else self._started(state, tick.q)
        innovation = self.observer.innovation(state.observer, tick.q)
        error = self.arm.raw_dynamics.difference(state.observer.q, tick.q_r)
        gate = self.gate.step(state.gate, innovation, error)
        bandwidth = self.gate.bandwidth(gate)
        estimate = self.observer.correct(state.observer, innovation, OBSERVER_RATIO * bandwidth)
        v_f, loads = tick.v_r + self.lead * tick.a_r, self._loads(tick, estimate)
        now, then = self._waves(estimate)
        friction = self.learner.torque(state.friction, v_f, loads, then)
        state, estimate = self._released(state, estimate, v_f, v_f - self.dt * tick.a_r)
        output = self._output(state, tick, estimate, bandwidth, friction)
        learned, moved = state.friction, np.zeros(self.arm.nv)
        if state.ticks > self.learning_starts:
            learned, moved = self._learned(
                state, estimate, OBSERVER_RATIO * bandwidth, friction, v_f, loads, (now, then)
            )
        expected = self.observer.predict(estimate, output.tau, tick.tau_ext - friction)
        expected = expected._replace(disturbance=expected.disturbance + moved)
        after = self._filter_after(state.filter, tick.tau_ext)
        return output, HardwareState.pack(
            state.ticks + 1, after, expected, gate, learned, output.tau
        )

    def _elapsed(self, state: HardwareState, period: float) -> HardwareState:
        period = checked_period(period, self.dt)
        expected = state.observer
        q = self.arm.raw_dynamics.integrate(expected.q, (period - self.dt) * expected.v)
        return state.but(
            filter=self._filter_elapsed(state.filter, period), observer=expected._replace(q=q)
        )

    def handover(self, state: HardwareState, now: Situation) -> HardwareState:
        """Return the state with which the controller takes the arm over as it is now: q_r = q and v_r = v.

        Disturbance and friction keep what they know.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        observer = self.observer.init(now.q, now.v, now.tau)
        return state.but(
            ticks=max(state.ticks, 1),
            filter=self._filter_at(now),
            observer=observer._replace(disturbance=state.observer.disturbance),
            gate=self.gate.init(),
            tau=np.array(now.tau),
        )

    # --- the parts of a tick ----------------------------------------------------------------------------------------

    def _started(self, state: HardwareState, q: Array) -> HardwareState:
        """The state of the first tick: at rest where the encoders say, held by the motors."""
        return state.but(observer=self.observer.init(q))

    def _output(
        self,
        state: HardwareState,
        tick: Tracking,
        estimate: Estimate,
        bandwidth: Array,
        friction: Array,
    ) -> ControllerOutput:
        """The law, within the limits."""
        e1, e2 = self._errors_ahead(tick, estimate, friction)
        s, u, a = commanded(e1, e2, tick.a_r, bandwidth, self.k2, self.dt)
        missed = tick.tau_ext + estimate.state.disturbance - friction
        within = (self.limits or Limits()).allocate(
            estimate.M @ a + estimate.bias - missed,
            lambda: estimate.M,
            before=state.tau if state.ticks else None,
            dt=self.dt,
        )
        seen = tick._replace(e1=e1, e2=e2)
        answer = BaselineTorque(within.tau, s, u)
        return baseline_output(seen, answer, state.filter.q_e, state.filter.v_e)._replace(
            saturated=within.saturated, rate_limited=within.rate_limited
        )

    def _errors_ahead(
        self, tick: Tracking, estimate: Estimate, friction: Array
    ) -> tuple[Array, Array]:
        """The errors when the torque of this tick begins to act."""
        q, v = self.observer.ahead(estimate, tick.tau_ext - friction)
        then = self.observer.reference_ahead(Reference(tick.q_r, tick.v_r, tick.a_r))
        return self.arm.raw_dynamics.difference(q, then.q), then.v - v

    def _released(
        self, state: HardwareState, estimate: Estimate, v_f: Array, before: Array
    ) -> tuple[HardwareState, Estimate]:
        """Both without what a reversal of the reference takes out of the disturbance."""
        if not self.learns_friction:
            return state, estimate
        seen, known, rise = estimate.state, state.friction, self.hardware.stribeck
        change = released(seen.disturbance, known.parameters[0], v_f, before, rise)
        seen = seen._replace(disturbance=seen.disturbance - change)
        return state.but(friction=known.shifted(-change)), estimate._replace(state=seen)

    def _loads(self, tick: Tracking, estimate: Estimate) -> Array:
        """Torque of the model along the reference, and of one more kilogram, shape (2, nv)."""
        state = estimate.state
        model = estimate.M @ tick.a_r + estimate.bias
        heavier = self.load.raw_dynamics.inverse_dynamics(state.q, state.v, tick.a_r)
        return np.stack([model, heavier - model])

    def _waves(self, estimate: Estimate) -> tuple[Wave, Wave]:
        """What ripple is made of where the arm is, and where it will be when the torque acts."""
        state = estimate.state
        angle = self.arm.raw_dynamics.difference(self.arm.neutral, state.q)
        then = angle + self.lead * state.v
        now, ahead = (waves(at, self.ripple_periods, state.torque) for at in (angle, then))
        return now, ahead

    def _learned(
        self,
        state: HardwareState,
        estimate: Estimate,
        bandwidth: Array,
        fed: Array,
        v_f: Array,
        loads: Array,
        ripple: tuple[Wave, Wave],
    ) -> tuple[FrictionState, Array]:
        """What is known of friction and load after the tick, and what of the disturbance moves there."""
        seen = estimate.state
        now, then = ripple
        after = self.learner.step(
            state.friction, seen.v, seen.disturbance, bandwidth, fed, loads, now
        )
        moved = self.learner.torque(after, v_f, loads, then) - fed
        return after.shifted(moved), moved


def _with_rate(limits: Limits | None, hardware: Hardware) -> Limits | None:
    """The limits, and the drives' own."""
    if not np.isfinite(hardware.torque_rate).any():
        return limits
    own = Limits() if limits is None else limits
    return Limits(own.effort, np.minimum(own.rate, hardware.torque_rate))
