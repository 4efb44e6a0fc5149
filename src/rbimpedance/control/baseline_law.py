"""What the baselines share: the impedance filter, the errors, the checks and the figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from .._common.arrays import Array, positive_number, read_only
from .._common.deprecation import renamed_arguments
from .._common.frozen import set_fields
from ..law.baseline_formulas import RESULTS, input_names
from ..law.formulas import Formula, elementwise, gain_names
from ..law.impedance import TargetFilter, TargetImpedance
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge, as_knowledge, model_torque
from ..robot.pinocchio_dynamics import PinocchioDynamics
from .errors import Tracking, track
from .protocol import ControllerBase, Measured, StateT, checked_period
from .telemetry import ControllerOutput, Situation, flags


class BaselineState(NamedTuple):
    """What a baseline without an integrator remembers: the impedance filter.

    Attributes:
        q_e: Position of the impedance filter at this tick, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        tau_ext: Torque of the environment that was measured at the tick before, shape (nv,) [N·m or N].
        q_e_before: q_e at that tick; with v_e_before and tau_ext, all that a late tick starts from again.
        v_e_before: v_e at that tick.
    """

    q_e: Array
    v_e: Array
    tau_ext: Array
    q_e_before: Array
    v_e_before: Array


class BaselineTorque(NamedTuple):
    """Result of a law at a tick: torque, sliding variable, acceleration added to a_r."""

    tau: Array
    s: Array
    u: Array


ModelTorque: TypeAlias = Literal["inverse", "passive", "gravity"]
"""Torque of the model that a law uses, for w and a from its formula: RNEA(q, v, a); M a + C(q, v) w + g + friction(v),
which cancels nothing; or g(q)."""


@dataclass(frozen=True, eq=False, init=False)
class Baseline(ControllerBase[StateT, ControllerOutput]):
    """What every baseline has: arm, target, period, the impedance filter and the figure e_im."""

    arm: ArmModel
    impedance: TargetImpedance
    dt: float
    model: Knowledge
    _filter: TargetFilter

    @renamed_arguments(knowledge="model")
    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance,
        dt: float,
        *,
        model: Knowledge = "full",
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        set_fields(
            self,
            arm=arm,
            impedance=impedance,
            dt=dt,
            model=as_knowledge(model),
            _filter=impedance.filter(arm.nv, dt),
        )

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im of the paper's eq. (5), shape (nv,) [N·m or N]; see `ImpedanceController`.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        e1, e2, e3 = output.e1, output.e2, output.a_r - a
        return self._filter.error(e1, e2, e3, output.q_e, output.v_e)

    def _filter_at_rest(self) -> BaselineState:
        zero = read_only(np.zeros(self.arm.nv))
        return BaselineState(zero, zero, zero, zero, zero)

    def _filter_after(self, state: BaselineState, tau_ext: Array) -> BaselineState:
        """The filter after a tick."""
        q_e, v_e = state.q_e, state.v_e
        return BaselineState(*self._filter.advance(q_e, v_e, tau_ext), np.array(tau_ext), q_e, v_e)

    def _filter_elapsed(self, state: BaselineState, period: float) -> BaselineState:
        """The filter a measured period, already checked, after the tick before."""
        if period == self.dt:
            return state
        before = state.q_e_before, state.v_e_before, state.tau_ext
        q_e, v_e = self._filter.advance(*before, period)
        return state._replace(q_e=q_e, v_e=v_e)

    def _filter_at(self, now: Situation) -> BaselineState:
        """The filter that starts from the arm as it is: q_r = q and v_r = v."""
        q_e = self.arm.raw_dynamics.difference(now.reference.q, now.q)
        v_e = now.v - now.reference.v
        return BaselineState(q_e, v_e, np.array(now.tau_ext), q_e, v_e)


@dataclass(frozen=True, eq=False, init=False)
class FormulaBaseline(Baseline[StateT]):
    """A baseline whose law is one formula for every joint, and a torque of the model.

    Attributes:
        formula: One of `law.baseline_formulas`; its gains are attributes of the controller.
        model_torque: Which torque of the model.
        cancels_contact: Whether tau_ext is subtracted.
    """

    formula: ClassVar[Formula]
    model_torque: ClassVar[ModelTorque] = "inverse"
    cancels_contact: ClassVar[bool] = True

    @property
    def gains(self) -> dict[str, Array]:
        """Gains of the formula by name, in its order."""
        return {name: getattr(self, name) for name in gain_names(self.formula)}

    @property
    def has_compiled_form(self) -> bool:
        """Whether compiled code knows this law; not that of a user's own class, which may replace any part of it."""
        return type(self).__module__.rpartition(".")[0] == __package__

    def _law(self, tick: Tracking, integral: Array | None = None) -> tuple[BaselineTorque, Array]:
        """The control law, and the next integral."""
        inputs = [self._input(name, tick, integral) for name in input_names(self.formula)]
        given = elementwise(self.formula, RESULTS, *inputs, self.dt, *self.gains.values())
        w, a, torque, s, u, following = (np.broadcast_to(x, tick.v.shape).copy() for x in given)
        tau = self._torque_of_model(tick, w, a) + torque
        if self.cancels_contact:
            tau = tau - tick.tau_ext
        return BaselineTorque(tau, s, u), following

    def _input(self, name: str, tick: Tracking, integral: Array | None) -> Array:
        """A quantity of the tick by its name; see `law.baseline_formulas.INPUTS`."""
        q_d, v_d, a_d = tick.desired
        difference = self.arm.raw_dynamics.difference
        quantities: dict[str, Callable[[], Array]] = {
            "integral": lambda: np.zeros(self.arm.nv) if integral is None else integral,
            "v_d": lambda: v_d,
            "a_d": lambda: a_d,
            "restoring": lambda: self._filter.restoring_torque(
                difference(tick.q, q_d), v_d - tick.v
            ),
            "yielding": lambda: self._filter.acceleration(
                difference(q_d, tick.q), tick.v - v_d, tick.tau_ext
            ),
        }
        return quantities[name]() if name in quantities else getattr(tick, name)

    def _torque_of_model(self, tick: Tracking, w: Array, a: Array) -> Array:
        """Torque of the model for a velocity w and an acceleration a, or M a where only M is known."""
        dynamics, q, v = self.arm.raw_dynamics, tick.q, tick.v
        if self.model_torque == "inverse" or self.model == "inertia":
            return model_torque(self.arm, self.model, q, v, a)
        gravity = dynamics.bias(q, np.zeros_like(v))
        if self.model_torque == "gravity":
            return gravity
        inertial = dynamics.mass_matrix(q) @ a
        return inertial + coriolis_torque(dynamics, q, v, w) + gravity + dynamics.friction(v)


@dataclass(frozen=True, eq=False, init=False)
class MemorylessBaseline(FormulaBaseline[BaselineState]):
    """A control law that remembers nothing but the impedance filter."""

    @property
    def limits(self) -> None:
        """None: these baselines keep no torque limits."""
        return None

    def init(self) -> BaselineState:
        """Return the state before the first tick: filter at rest."""
        return self._filter_at_rest()

    def _step(
        self, state: BaselineState, given: Measured
    ) -> tuple[ControllerOutput, BaselineState]:
        q_e, v_e = state.q_e, state.v_e
        tick = track(self.arm, self._filter, q_e, v_e, given)
        answer, _ = self._law(tick)
        output = baseline_output(tick, answer, q_e, v_e)
        return output, self._filter_after(state, tick.tau_ext)

    def _elapsed(self, state: BaselineState, period: float) -> BaselineState:
        return self._filter_elapsed(state, checked_period(period, self.dt))

    def handover(self, state: BaselineState, now: Situation) -> BaselineState:
        """Return the state with which the controller takes the arm over as it is now: q_r = q and v_r = v.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        del state
        return self._filter_at(now)


def baseline_output(
    tick: Tracking, answer: BaselineTorque, q_e: Array, v_e: Array
) -> ControllerOutput:
    """Return the output of a tick without limits: every flag is False.

    Args:
        tick: Measurements, reference and errors.
        answer: What the law makes of them.
        q_e: Position of the impedance filter at this tick, shape (nv,).
        v_e: Its velocity, shape (nv,).
    """
    nv = len(tick.v)
    return ControllerOutput(
        answer.tau,
        *(tick.q_r, tick.v_r, tick.a_r, tick.e1, tick.e2, answer.s),
        u=answer.u,
        q_e=q_e.copy(),
        v_e=v_e.copy(),
        premise_holds=np.zeros(nv, dtype=np.bool_),
        **flags(nv),
    )


def coriolis_torque(dynamics: PinocchioDynamics, q: Array, v: Array, w: Array) -> Array:
    """Return C(q, v) w with the C of the Christoffel symbols, shape (nv,) [N·m or N].

    Only that C makes dM/dt - 2C skew-symmetric. It is symmetric in v and w, so that C(q, v) w is the
    polar form of c(v) = C(q, v) v, [c(v + w) - c(v - w)]/4; gravity drops out of the difference.

    Args:
        dynamics: The arm's dynamics.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        w: The vector that C multiplies, shape (nv,).
    """
    total = dynamics.bias(q, v + w) - dynamics.bias(q, v - w)
    friction = dynamics.friction(v + w) - dynamics.friction(v - w)
    torque: Array = (total - friction) / 4.0
    return torque
