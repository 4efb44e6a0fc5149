"""One control tick: impedance filter, errors, sliding surface, reaching law, torque (paper, eqs. 3, 4, 6 and 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, per_joint, positive_number
from ._frozen import set_fields
from .dynamics import ArmModel
from .impedance import TargetFilter, TargetImpedance
from .limits import Allocation, BoolArray, Limits, as_limits
from .super_twisting import ReachingState, SuperTwisting
from .surfaces import Surface
from .tracking import Knowledge, check_knowledge, model_torque, track
from .trajectories import Reference


class ControllerState(NamedTuple):
    """Everything that a controller remembers from one tick to the next.

    Attributes:
        ticks: Number of ticks so far.
        q_e: Position of the impedance filter at this tick, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        z: Integral of the reaching law, shape (nv,) [s].
        x: Modified sliding variable of the implicit scheme, shape (nv,).
        a: Its correction, shape (nv,).
    """

    ticks: int
    q_e: Array
    v_e: Array
    z: Array
    x: Array
    a: Array


class ControllerOutput(NamedTuple):
    """What a tick computed.

    Attributes:
        tau: Motor torque, within the limits, shape (nv,) [N·m or N].
        q_r: Impedance reference q_d (+) q_e, shape (nq,).
        v_r: Its velocity, shape (nv,) [rad/s or m/s].
        a_r: Its acceleration, shape (nv,) [rad/s² or m/s²].
        e1: Position error q_r (-) q, shape (nv,) [rad or m].
        e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
        s: Sliding variable, shape (nv,).
        u: Reaching term that tau realises, by the controller's model, shape (nv,) [rad/s² or m/s²].
        q_e: Position of the impedance filter at this tick, shape (nv,) [rad or m].
        v_e: Its velocity, shape (nv,) [rad/s or m/s].
        saturated: Whether the joint is at its torque limit, shape (nv,), bool.
        guaranteed: Whether tau makes the joint's reaching law act in full, by the controller's model, shape (nv,),
            bool: the one premise of Theorem 1 that a controller can see. It is False exactly where a limit withholds
            acceleration. Where it turns True the theorem starts anew, from that tick's s and z; its other premise,
            the bound on the disturbance's rate, stays the user's. Always False where no super-twisting law acts.
    """

    tau: Array
    q_r: Array
    v_r: Array
    a_r: Array
    e1: Array
    e2: Array
    s: Array
    u: Array
    q_e: Array
    v_e: Array
    saturated: BoolArray
    guaranteed: BoolArray


StateT = TypeVar("StateT")


class Controller(Protocol[StateT]):
    """What `simulate` needs of a controller; the baselines share it."""

    @property
    def arm(self) -> ArmModel:
        """The controller's own model of the arm."""

    @property
    def dt(self) -> float:
        """Control period [s]."""

    def init(self) -> StateT:
        """Return the state before the first tick."""

    def step(
        self, state: StateT, q: ArrayLike, v: ArrayLike, reference: Reference, tau_ext: ArrayLike
    ) -> tuple[ControllerOutput, StateT]:
        """Return the output of one tick and the next state."""

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im of the paper's eq. (5), given the acceleration a that the tick's torque led to."""


@dataclass(frozen=True, eq=False, init=False)
class ImpedanceController:
    """Super-twisting terminal sliding-mode impedance controller for n joints.

    The law (paper, eq. 8), with a = a_r + (feedforward + u)/hold_gain and hold_gain = 1 on the paper's surface:

        tau = RNEA(q, v, a) - tau_ext                   [= -tau_ext + M(q)·a + bias(q, v)]

    It makes the sliding variable obey ṡ = -u + w, with w what the model does not know, and so brings q to the
    impedance reference q_r: the arm then moves as M_d, D_d, K_d demand under the measured tau_ext.

    A controller is immutable. `step` is pure: the same arguments give the same, bit-equal answer.

    Attributes:
        arm: The controller's model of the arm.
        impedance: Target impedance.
        surface: Sliding surface.
        reaching: Reaching law.
        dt: Control period [s].
        knowledge: "full"; or "mass" for the controller of the paper's section 4, which knows M(q) only.
        limits: `Limits`, or an array-like of torque limits; None for none. The arm's own `effort_limit` is not used
            unless it is given here.

    Raises:
        GainError: dt is not a positive number, an unknown `knowledge`, or a limit that is not positive.
        DimensionError: A gain or a limit is given for another number of joints.
    """

    arm: ArmModel
    impedance: TargetImpedance
    surface: Surface
    reaching: SuperTwisting
    dt: float
    knowledge: Knowledge
    limits: Limits | None
    _filter: TargetFilter

    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance,
        surface: Surface,
        reaching: SuperTwisting,
        dt: float,
        *,
        knowledge: Knowledge = "full",
        limits: Limits | ArrayLike | None = None,
    ) -> None:
        dt = positive_number("dt", dt, "control period in seconds")
        check_knowledge(knowledge)
        limits = as_limits(limits)
        for owner in (surface, reaching, limits):
            for name, value in vars(owner).items() if owner is not None else ():
                if isinstance(value, np.ndarray):
                    per_joint(f"{type(owner).__name__}.{name}", value, arm.nv)
        set_fields(
            self,
            arm=arm,
            impedance=impedance,
            surface=surface,
            reaching=reaching,
            dt=dt,
            knowledge=knowledge,
            limits=limits,
            _filter=impedance.filter(arm.nv, dt),
        )

    def init(self) -> ControllerState:
        """Return the state before the first tick: filter at rest, integral zero."""
        zero = np.zeros(self.arm.nv)
        zero.setflags(write=False)
        return ControllerState(0, zero, zero, zero, zero, zero)

    def step(
        self,
        state: ControllerState,
        q: ArrayLike,
        v: ArrayLike,
        reference: Reference,
        tau_ext: ArrayLike,
    ) -> tuple[ControllerOutput, ControllerState]:
        """Compute the torque of one tick.

        Args:
            state: From `init` or from the tick before.
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,) [rad/s or m/s].
            reference: Desired motion at this tick.
            tau_ext: Measured torque of the environment on the robot, shape (nv,) [N·m or N].

        Returns:
            The output, and the state for the next tick.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        tick = track(
            self.arm,
            self._filter,
            state.q_e,
            state.v_e,
            q=q,
            v=v,
            reference=reference,
            tau_ext=tau_ext,
        )
        e1, e2, a_r = tick.e1, tick.e2, tick.a_r

        s = self.surface.value(e1, e2)  # eq. (6)
        reaching = self._reaching_state(state, s)
        u, following = self.reaching.step(s, reaching, self.dt)
        gain = self.surface.hold_gain(e1, self.dt)
        a = a_r + (self.surface.feedforward(e1, e2) + u) / gain
        tau = model_torque(self.arm, self.knowledge, tick.q, tick.v, a) - tick.tau_ext  # eq. (8)
        tau, saturated, lacking = self._allocate(tick.q, tau)
        missing = gain * lacking
        following = self.reaching.without_windup(reaching, following, missing, self.dt)

        q_e, v_e = self._filter.advance(state.q_e, state.v_e, tick.tau_ext)
        output = ControllerOutput(
            tau,
            *(tick.q_r, tick.v_r, a_r, e1, e2, s),
            u=u - missing,
            q_e=state.q_e.copy(),
            v_e=state.v_e.copy(),
            saturated=saturated,
            guaranteed=missing == 0.0,
        )
        return output, ControllerState(state.ticks + 1, q_e, v_e, *following)

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        """Return e_im = M_d·(a_r - a) + D_d·e2 + K_d·e1 (paper, eq. 5), shape (nv,) [N·m or N].

        It is the residual of the target impedance; for a nonlinear one see its filter's `error`.

        Args:
            output: Of the tick.
            a: Acceleration under the tick's torque, measured or simulated, shape (nv,).
        """
        e1, e2, e3 = output.e1, output.e2, output.a_r - a
        return self._filter.error(e1, e2, e3, output.q_e, output.v_e)

    def _reaching_state(self, state: ControllerState, s: Array) -> ReachingState:
        if state.ticks == 0:
            return self.reaching.start(s)
        return ReachingState(state.z, state.x, state.a)

    def _allocate(self, q: Array, tau: Array) -> Allocation:
        if self.limits is None:
            return Allocation(tau, np.zeros(tau.shape, dtype=np.bool_), np.zeros_like(tau))
        return self.limits.allocate(tau, lambda: self.arm.unchecked.mass_matrix(q))
