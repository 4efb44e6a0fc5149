"""What acts on the arm beyond the model: a super-twisting observer of the disturbance torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive_number, read_only, vector
from .._common.brief import brief_repr
from .._common.deprecation import renamed_arguments
from .._common.frozen import set_fields
from ..law.super_twisting import ReachingState, SuperTwisting
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge, as_knowledge


class ObserverState(NamedTuple):
    """What the observer remembers of the tick before.

    Attributes:
        ticks: Number of ticks so far.
        v: Velocity, shape (nv,) [rad/s or m/s].
        M: Mass matrix, shape (nv, nv).
        load: tau_ext - bias, shape (nv,) [N·m or N].
        s: Momentum that the observer has not explained, shape (nv,) [N·m·s or N·s].
        u: Correction, shape (nv,) [N·m or N].
        z: Integral of the reaching law, shape (nv,) [s].
        x: Modified sliding variable of the implicit scheme, shape (nv,).
        a: Its correction, shape (nv,).
    """

    ticks: int
    v: Array
    M: Array
    load: Array
    s: Array
    u: Array
    z: Array
    x: Array
    a: Array


class DisturbanceEstimate(NamedTuple):
    """What a tick found.

    Attributes:
        w: Disturbance torque beyond the model, shape (nv,) [N·m or N].
        s: Momentum not yet explained, shape (nv,) [N·m·s or N·s]; near zero once w has converged.
    """

    w: Array
    s: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class SuperTwistingDisturbanceObserver:
    """Observer of the torque w in M(q) a + bias(q, v) = tau + tau_ext + w.

    With s the difference between ∫M dv as measured and as the model and the estimate explain it,

        ṡ = w - u,    u = k1·abs(s)^½·sgn(s) + k2·z,    ż = sgn(s),

    which is super-twisting with an input gain of exactly 1: for gains that `certify` accepts with
    d_max = sup abs(ẇ), s and ṡ reach zero in finite time, on every joint by itself, and then
    w = k2·z. No acceleration and no inverse of M is needed.

    Sampled, M dv and the model's torques go by the trapezoidal rule. A ramp is followed with a lag of
    h/2 by the implicit scheme, and of h/2 + (k1/k2)·abs(s)^½ by the matched one, which is less
    sensitive to noisy velocities.

    Immutable; `step` is pure.

    Attributes:
        arm: The model that the disturbance is measured against.
        reaching: Gains and scheme; here k1 is in (N·m/s)^½ and k2, which has to exceed abs(ẇ), in
            N·m/s.
        dt: Period [s].
        model: "full"; or "inertia", for a model of M(q) alone: bias(q, v) then is disturbance.

    Raises:
        ParameterError: dt is not a positive number, or an unknown `model`.
        DimensionError: A gain is given for another number of joints.

    References:
        A. Levant, Robust exact differentiation via sliding mode technique, Automatica 34, 1998.
        G. Garofalo, N. Mansfeld, J. Jankowski, C. Ott, Sliding mode momentum observers for estimation
        of external torques and joint acceleration, ICRA 2019.
    """

    arm: ArmModel
    reaching: SuperTwisting
    dt: float
    model: Knowledge

    @renamed_arguments(knowledge="model")
    def __init__(
        self,
        arm: ArmModel,
        reaching: SuperTwisting,
        dt: float,
        *,
        model: Knowledge = "full",
    ) -> None:
        dt = positive_number("dt", dt, "period in seconds")
        for name in ("k1", "k2", "margin"):
            per_joint(f"reaching.{name}", getattr(reaching, name), arm.nv)
        set_fields(self, arm=arm, reaching=reaching, dt=dt, model=as_knowledge(model))

    def init(self) -> ObserverState:
        """Return the state before the first tick: no disturbance seen."""
        zero = read_only(np.zeros(self.arm.nv))
        M = read_only(np.zeros((self.arm.nv, self.arm.nv)))
        return ObserverState(0, zero, M, zero, zero, zero, zero, zero, zero)

    def step(
        self,
        state: ObserverState,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        tau_ext: ArrayLike,
    ) -> tuple[DisturbanceEstimate, ObserverState]:
        """Take in one tick's measurements.

        Args:
            state: From `init` or from the tick before.
            q: Configuration now, shape (nq,).
            v: Velocity now, shape (nv,) [rad/s or m/s].
            tau: Motor torque held since the tick before, shape (nv,) [N·m or N]; without meaning at
                the first tick.
            tau_ext: Torque of the environment now, shape (nv,) [N·m or N].

        Returns:
            The estimate, and the state for the next tick.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        nv, h = self.arm.nv, self.dt
        q, v = self.arm.check_configuration("q", q), vector("v", v, nv)
        tau, load = vector("tau", tau, nv), vector("tau_ext", tau_ext, nv)
        M = self.arm.raw_dynamics.mass_matrix(q)
        if self.model == "full":
            load = load - self.arm.raw_dynamics.bias(q, v)
        if state.ticks == 0:
            s = np.zeros(nv)
            memory = self.reaching.start(s)
        else:
            gained = (M + state.M) @ (v - state.v) / 2.0
            explained = h * (tau + (load + state.load) / 2.0 + state.u)
            s = state.s + gained - explained
            memory = ReachingState(state.z, state.x, state.a)
        u, memory = self.reaching.step(s, memory, h)
        estimate = DisturbanceEstimate(self.reaching.k2 * memory.z, s.copy())
        return estimate, ObserverState(state.ticks + 1, v.copy(), M, load.copy(), s, u, *memory)
