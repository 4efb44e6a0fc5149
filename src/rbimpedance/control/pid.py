"""The linear baseline with an integrator: inverse dynamics and a PID around the impedance reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive
from .._common.frozen import set_fields
from ..law import baseline_formulas as formulas
from ..law.impedance import TargetImpedance
from ..law.limits import Limits, as_limits
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from .baseline_law import BaselineState, FormulaBaseline, baseline_output
from .errors import track
from .protocol import Measured, checked_period
from .telemetry import ControllerOutput, Situation


class PIDState(NamedTuple):
    """What the PID remembers.

    Attributes:
        ticks: Number of ticks so far.
        filter: The impedance filter.
        integral: Integral of e1, shape (nv,) [rad·s or m·s].
        integral_before: The same at the tick before; a late tick starts from it again.
        tau: Torque of the tick before, shape (nv,) [N·m or N].
    """

    ticks: int
    filter: BaselineState
    integral: Array
    integral_before: Array
    tau: Array


@dataclass(frozen=True, eq=False, init=False)
class PIDImpedance(FormulaBaseline[PIDState]):
    """Computed torque with a PID around the impedance reference q_r: the linear counterpart of our law.

        tau = RNEA(q, v, a_r + u) - tau_ext,    u = k_p·e1 + k_d·e2 + k_i·∫e1 dt

    With an exact model e1 obeys (d/dt + p)³ e1 = 0 with p = `bandwidth`: a triple pole. A constant disturbance leaves
    no error, one that changes at the rate ẇ leaves about ẇ/p³. The gains place the poles of the sampled loop at
    exp(-p·dt), exact for an acceleration that is held for dt.

    Where a limit holds a joint back, its integral does not grow in that direction (clamping). s is zero.

    Attributes:
        arm: The controller's model of the arm.
        impedance: Target impedance.
        bandwidth: p > 0, scalar or (nv,) [rad/s].
        dt: Control period [s].
        model: "full"; or "inertia", with M(q)·a in place of RNEA.
        limits: `Limits`; an array-like means torque limits, None no limits.

    Raises:
        ParameterError: A bandwidth or limit that is not positive, or an unknown `model`.
        DimensionError: A number is given for another number of joints.
    """

    formula = staticmethod(formulas.pid)
    bandwidth: Array
    limits: Limits | None
    _gains: tuple[Array, Array, Array]

    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance,
        bandwidth: ArrayLike,
        dt: float,
        *,
        model: Knowledge = "full",
        limits: Limits | ArrayLike | None = None,
    ) -> None:
        super().__init__(arm, impedance, dt, model=model)
        limits = as_limits(limits, arm.nv)
        bandwidth = positive("bandwidth", bandwidth, arm.nv)
        set_fields(self, bandwidth=bandwidth, limits=limits, _gains=pid_gains(bandwidth, self.dt))

    @property
    def gains(self) -> dict[str, Array]:
        """k_p, k_d and k_i."""
        return dict(zip(("k_p", "k_d", "k_i"), self._gains, strict=True))

    def init(self) -> PIDState:
        """Return the state before the first tick: filter at rest, integral zero."""
        at_rest = self._filter_at_rest()
        return PIDState(0, at_rest, *[at_rest.q_e] * 3)

    def _step(self, state: PIDState, given: Measured) -> tuple[ControllerOutput, PIDState]:
        q_e, v_e, integral = state.filter.q_e, state.filter.v_e, state.integral
        tick = track(self.arm, self._filter, q_e, v_e, given)
        answer, grown = self._law(tick, integral)
        allocation = (self.limits or Limits()).allocate(
            answer.tau,
            lambda: self.arm.raw_dynamics.mass_matrix(tick.q),
            before=state.tau if state.ticks else None,
            dt=self.dt,
        )
        deficit = allocation.acceleration_deficit
        grows = deficit * tick.e1 <= 0.0  # clamping: not towards what the limit refuses
        output = baseline_output(tick, answer, q_e, v_e)._replace(
            tau=allocation.tau,
            u=answer.u - deficit,
            saturated=allocation.saturated,
            rate_limited=allocation.rate_limited,
        )
        following = np.where(grows, grown, integral)
        filtered = self._filter_after(state.filter, tick.tau_ext)
        tau = output.tau.copy()
        return output, PIDState(state.ticks + 1, filtered, following, integral, tau)

    def _elapsed(self, state: PIDState, period: float) -> PIDState:
        period = checked_period(period, self.dt)
        before = state.integral_before
        integral = before + (state.integral - before) * (period / self.dt)
        return state._replace(filter=self._filter_elapsed(state.filter, period), integral=integral)

    def handover(self, state: PIDState, now: Situation) -> PIDState:
        """Return the state with which the controller takes the arm over as it is now: q_r = q and v_r = v.

        The integral keeps what it knows of the load.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        return state._replace(
            ticks=max(state.ticks, 1),
            filter=self._filter_at(now),
            integral_before=state.integral,
            tau=np.array(now.tau),
        )


def pid_gains(bandwidth: Array, dt: float) -> tuple[Array, Array, Array]:
    """Return k_p, k_d, k_i that place the sampled loop's three poles at exp(-bandwidth·dt).

    The plant is ë1 = -u with u held for dt. With δ = (z - 1)/dt, z the shift by a period, the loop is
    δ³ + (k_d + k_p·dt/2) δ² + (k_p + k_i·dt/2) δ + k_i = (δ + p')³ with p' = (1 - exp(-bandwidth·dt))/dt. For small
    bandwidth·dt the gains are 3p², 3p and p³.

    Args:
        bandwidth: p > 0 [rad/s].
        dt: Control period [s].
    """
    p = -np.expm1(-bandwidth * dt) / dt
    k_i = p**3
    k_p = 3.0 * p**2 - k_i * dt / 2.0
    k_d = 3.0 * p - k_p * dt / 2.0
    return k_p, k_d, k_i
