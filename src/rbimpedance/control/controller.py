"""One control tick: impedance filter, errors, sliding surface, reaching law, torque."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number
from .._common.brief import brief_repr
from .._common.deprecation import renamed_arguments, renamed_attribute
from .._common.frozen import MadeAnew, set_fields
from ..law.impedance import TargetFilter, TargetImpedance
from ..law.limits import Limits, as_limits
from ..law.super_twisting import FormulaReaching
from ..law.surfaces import Surface
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge, as_knowledge
from .backends import tick_form
from .default_gains import default_impedance, default_law
from .errors import check_measurements
from .protocol import Backend, ControllerBase, Measured, checked_period
from .realtime import RealtimeController
from .telemetry import ControllerOutput as ControllerOutput  # noqa: PLC0414 (part of this module's interface)
from .telemetry import ControllerState as ControllerState  # noqa: PLC0414 (part of this module's interface)
from .telemetry import Situation as Situation  # noqa: PLC0414 (part of this module's interface)
from .tick import ControlLaw, Step, TickForm, numpy_tick


@brief_repr("arm", "dt", "backend", "impedance", "surface", "reaching", "limits")
@dataclass(frozen=True, eq=False, init=False)
class ImpedanceController(MadeAnew, ControllerBase[ControllerState, ControllerOutput]):
    """Super-twisting terminal sliding-mode impedance controller for n joints.

    The law of the paper's eq. (8), with a = a_r + (feedforward + u)/zoh_gain and zoh_gain = 1 on the paper's surface:

        tau = RNEA(q, v, a) - tau_ext                   [= -tau_ext + M(q)·a + bias(q, v)]

    It makes the sliding variable obey ṡ = -u + w, with w what the model does not know, and so brings q to the
    impedance reference q_r: the arm then moves as M_d, D_d, K_d demand under the measured tau_ext. With zeros in its
    place the arm is rigid: what is not measured is rejected like any other disturbance. Without a force sensor take a
    `CompliantController`, or put a `SensorlessController` around this one (docs/how-to/no-force-sensor.md).

    `ImpedanceController(arm)` is complete: omitted parts are computed from the arm, see `control.default_gains` for
    what that tolerates.

    A controller is immutable. `step` is pure: the same arguments give the same, bit-equal answer, in any thread.

    Attributes:
        arm: The controller's model of the arm; with default gains, where friction is stiff against the period, it holds
            friction as `control.default_gains.model_for_period` says.
        impedance: Target impedance; by default critically damped and no lighter than the arm.
        surface: Sliding surface; by default a fast terminal one, bounded to half of the joints' velocity limits.
        reaching: Reaching law; by default for links 10 % heavier or lighter, a payload of 5 % of the arm's mass and
            0.5 N·m of friction that the model does not hold.
        dt: Control period, 1 ms by default [s].
        model: "full"; or "inertia" for the controller of the paper's section 4, which knows M(q) only.
        limits: `Limits`, or an array-like of torque limits; None for none. The arm's own `effort_limit` is not used
            unless it is given here.
        backend: "numpy" for the readable form, which specifies the others; "pinocchio" for Pinocchio's algorithms with
            the law compiled around them; "compiled" for algorithms compiled as well. All are equal to rounding
            (docs/how-a-tick-runs.md), and `simulate` follows the choice. NumPy does what cannot be compiled; the
            logger "rbimpedance" says so, once.

    Raises:
        ParameterError: dt is not a positive number, an unknown `model` or `backend`, a limit that is not positive, or
            a part that has no default beside the others.
        DimensionError: A gain or a limit is given for another number of joints.
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """

    arm: ArmModel
    impedance: TargetImpedance
    surface: Surface
    reaching: FormulaReaching
    dt: float
    model: Knowledge
    limits: Limits | None
    backend: Backend
    _filter: TargetFilter
    _law: ControlLaw
    _form: TickForm
    _compute: Step
    _own: Any
    _made = "_law", "_form", "_compute", "_own"

    @renamed_arguments(knowledge="model")
    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance | None = None,
        surface: Surface | None = None,
        reaching: FormulaReaching | None = None,
        dt: float = 1e-3,
        *,
        model: Knowledge = "full",
        limits: Limits | ArrayLike | None = None,
        backend: Backend = "pinocchio",
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        limits, model = as_limits(limits, arm.nv), as_knowledge(model)
        impedance = default_impedance(arm) if impedance is None else impedance
        if surface is None or reaching is None:
            law = default_law(arm, dt, model, surface)
            surface = law.surface
            arm, reaching = (arm, reaching) if reaching is not None else (law.arm, law.reaching)
        for part in (surface, reaching):
            part.check(arm.nv)
        set_fields(
            self,
            arm=arm,
            impedance=impedance,
            surface=surface,
            reaching=reaching,
            dt=dt,
            model=model,
            limits=limits,
            backend=backend,
            _filter=impedance.filter(arm.nv, dt),
        )
        self._make()

    def _make(self) -> None:
        law = ControlLaw(
            self.arm, self._filter, self.surface, self.reaching, self.dt, self.model, self.limits
        )
        form = tick_form(self.backend, law)  # "numpy", "pinocchio" or "compiled"
        step, own = form.step
        set_fields(self, _law=law, _form=form, _compute=step, _own=own)

    def init(self) -> ControllerState:
        """Return the state before the first tick: filter at rest, integral zero."""
        return self._form.init()

    def realtime(self, state: ControllerState | None = None) -> RealtimeController:
        """Return the tick for a real-time loop: torque only, in memory that is made once.

        Args:
            state: State to begin with; `init()` by default.
        """
        return RealtimeController(self, self._form, state)

    def _elapsed(self, state: ControllerState, period: float) -> ControllerState:
        period = checked_period(period, self.dt)
        if state.ticks == 0 or period == self.dt:
            return state
        before = state.q_e_before, state.v_e_before, state.tau_ext
        q_e, v_e = self._filter.advance(*before, period)
        z = state.z_before + (state.z - state.z_before) * (period / self.dt)
        return state._replace(q_e=q_e, v_e=v_e, z=z)

    def handover(self, state: ControllerState, now: Situation) -> ControllerState:
        """Return the state with which the controller takes the arm over as it is now.

        The impedance filter starts from where the arm is: q_e = q (-) q_d, v_e = v - v_d, so that q_r = q, v_r = v and
        s = 0. The integral keeps what it knows of the load, and the rate limit counts from the torque that acts.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        q_e = self.arm.raw_dynamics.difference(now.reference.q, now.q)
        v_e, zero = now.v - now.reference.v, np.zeros(self.arm.nv)
        return state._replace(
            ticks=max(state.ticks, 1),
            q_e=q_e,
            v_e=v_e,
            x=zero,
            a=zero.copy(),
            tau=np.array(now.tau),
            tau_ext=np.array(now.tau_ext),
            q_e_before=q_e,
            v_e_before=v_e,
            z_before=state.z,
        )

    def with_impedance(self, impedance: TargetImpedance) -> ImpedanceController:
        """Return the same controller with another target; a run continues with its present state.

        q_r and v_r do not jump at the change, only a_r does: with s and z as they were, the torque jumps by
        M(q)·Δa_e, where Δa_e is the change of a_e = M_d⁻¹(tau_ext - D_d·v_e - K_d·q_e) at the present q_e
        and v_e. Changed a little at every tick (`blend`), the target moves without a jump of the torque;
        docs/interaction.md has the figures, and `check_variation` says which changes keep it stable. Costs a matrix
        exponential.

        Args:
            impedance: The target from the next tick on.

        Raises:
            DimensionError: It is for another number of joints.
        """
        return self._with(impedance=impedance)

    def with_backend(self, backend: Backend) -> ImpedanceController:
        """Return the same controller computed by another backend.

        Args:
            backend: "numpy", "pinocchio" or "compiled".

        Raises:
            ParameterError: An unknown backend.
            ModelError: The compiled dynamics of the arm are not Pinocchio's.
        """
        return self._with(backend=backend)

    def _with(
        self, impedance: TargetImpedance | None = None, backend: Backend | None = None
    ) -> ImpedanceController:
        return ImpedanceController(
            self.arm,
            impedance or self.impedance,
            self.surface,
            self.reaching,
            self.dt,
            model=self.model,
            limits=self.limits,
            backend=backend or self.backend,
        )

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im = M_d·(a_r - a) + D_d·e2 + K_d·e1, the paper's eq. (5), shape (nv,) [N·m or N].

        It is the residual of the target impedance; for a nonlinear one see its filter's `error`.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        e1, e2, e3 = output.e1, output.e2, output.a_r - a
        return self._filter.error(e1, e2, e3, output.q_e, output.v_e)

    def _step(
        self, state: ControllerState, given: Measured
    ) -> tuple[ControllerOutput, ControllerState]:
        """The tick for inputs that its form has refused: an error, or another try with plain vectors."""
        checked = check_measurements(self.arm, given)
        answer: tuple[ControllerOutput, ControllerState] | None = None
        with contextlib.suppress(TypeError):  # not aligned in memory
            answer = self._compute(self._own, self._form.pack(state), *checked)
        return numpy_tick(self._law, state, *checked) if answer is None else answer

    knowledge = renamed_attribute("knowledge", "model")
    lean = renamed_attribute("lean", "realtime")
