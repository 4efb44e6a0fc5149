"""One tick of the law at the tool: reference, errors, surfaces, reaching laws, joint acceleration, torque.

docs/theory.md derives it ("The law at the tool"). The torque comes from a resolved acceleration and one RNEA; neither
the mass matrix nor the operational-space inertia is formed, except where a torque limit acts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from ..law.cartesian_impedance import CartesianFilter
from ..law.damped_inverse import DampedInverse, Damping, basis_rate, continued_basis
from ..law.joint_bounds import BoundedAcceleration, JointBounds
from ..law.limits import Allocation, Limits
from ..law.poses import CartesianReference, Pose
from ..law.super_twisting import ReachingState, SuperTwisting
from ..law.surfaces import Surface, terms
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolKinematics, ToolMotion
from ..trajectories.limits import joint_positions
from .cartesian_base import ToolErrors, ToolMeasured
from .cartesian_telemetry import CartesianOutput, CartesianState

LOST_STIFFNESS, LOST_DAMPING = 20.0, 9.0
"""Posture control of the joint motions that damping takes from the tool [1/s², 1/s]."""


class SlidingLaw(NamedTuple):
    """A sliding surface with its reaching law."""

    surface: Surface
    reaching: SuperTwisting


class CartesianLaw(NamedTuple):
    """All that a tick depends on besides its arguments.

    Attributes:
        arm: The controller's model of the arm.
        kinematics: Of the frame.
        target: Filter of the target impedance.
        tool: Surface and reaching law of the six directions at the frame.
        null: Those of the null space.
        posture: Configuration that the null space is drawn to, shape (nq,); None for that of the first tick.
        damping: Of the Jacobian's inverse.
        bounds: Velocity and position limits of the joints; None for none.
        limits: Limits of the torque, or None.
        dt: Control period [s].
    """

    arm: ArmModel
    kinematics: ToolKinematics
    target: CartesianFilter
    tool: SlidingLaw
    null: SlidingLaw
    posture: Array | None
    damping: Damping
    bounds: JointBounds | None
    limits: Limits | None
    dt: float


class Sliding(NamedTuple):
    """One block of coordinates at a tick; arrays have one entry per coordinate.

    Attributes:
        s: Sliding variable.
        u: Reaching term.
        y: Acceleration of the error that s asks for, (feedforward + u)/zoh_gain.
        gain: zoh_gain of the surface.
        before: Memory of the reaching law.
        after: Its next memory.
    """

    s: Array
    u: Array
    y: Array
    gain: Array
    before: ReachingState
    after: ReachingState


class NullSpace(NamedTuple):
    """The null space at a tick.

    Attributes:
        basis: V, shape (nv, n).
        rate: V̇, shape (nv, n).
        error: Vᵀ(q_n (-) q), shape (n,).
        error_rate: Its rate, shape (n,).
        speed: Vᵀ v, shape (n,).
    """

    basis: Array
    rate: Array
    error: Array
    error_rate: Array
    speed: Array


class Command(NamedTuple):
    """Joint motion and torque of a tick.

    Attributes:
        a: Joint acceleration that the torque realises, by the controller's model, shape (nv,).
        withheld: What limits take from the wanted one, shape (nv,).
        lost: Tool acceleration that a singularity takes, shape (6,).
        joint_limited: Whether a joint is at a velocity or position limit, shape (nv,), bool.
        allocation: The torque.
    """

    a: Array
    withheld: Array
    lost: Array
    joint_limited: BoolArray
    allocation: Allocation


class Tick(NamedTuple):
    """What a tick computes before its output is put together."""

    motion: ToolMotion
    pulled: Array
    reference: CartesianReference
    errors: ToolErrors
    inverse: DampedInverse
    null: NullSpace
    tool: Sliding
    rest: Sliding
    command: Command

    def unrealised(self) -> tuple[Array, Array]:
        """Return what limits and singularities withhold of u, at the tool (6,) and in the null space (n,)."""
        missing = self.command.lost + self.motion.jacobian @ self.command.withheld
        in_null = self.null.basis.T @ self.command.withheld
        return self.tool.gain * self.errors.of_error(missing), self.rest.gain * in_null


def cartesian_tick(
    law: CartesianLaw, state: CartesianState, given: ToolMeasured
) -> tuple[CartesianOutput, CartesianState]:
    """Return output and next state of one tick; see `CartesianController.step`."""
    motion = law.kinematics.motion(given.q, given.v)
    pulled = law.target.pulled_back(state.displacement, given.desired, given.wrench)
    reference = law.target.reference(state.displacement, given.desired, pulled)
    errors = ToolErrors.of(reference, motion)
    inverse = DampedInverse(motion.jacobian, law.damping)
    null = _null_space(law, state, given, motion, inverse)
    is_first, e2 = state.ticks == 0, errors.e2
    tool = _sliding(law.tool, state.tool, (errors.e1, e2, e2), law.dt, is_first=is_first)
    in_null = null.error, -null.speed, null.error_rate
    rest = _sliding(law.null, state.null, in_null, law.dt, is_first=is_first)
    b = errors.acceleration(reference, motion.v[3:], tool.y) - motion.drift
    a_null = null.basis @ (rest.y - null.rate.T @ given.v)
    command = _command(law, state, given, motion, inverse, b, a_null)
    tick = Tick(motion, pulled, reference, errors, inverse, null, tool, rest, command)
    axes = law.target.axes(given.desired)
    return _output(tick, given, axes), _next_state(law, state, given, tick)


def _command(
    law: CartesianLaw,
    state: CartesianState,
    given: ToolMeasured,
    motion: ToolMotion,
    inverse: DampedInverse,
    b: Array,
    a_null: Array,
) -> Command:
    """Resolve J a = b, keep joint and torque limits, and say what is missing."""
    wanted, lost = inverse.matrix @ b + a_null, np.zeros(6)
    if not inverse.is_whole:
        away = _posture_error(law, state, given.q)
        posture = LOST_STIFFNESS * away - LOST_DAMPING * given.v
        wanted += inverse.in_lost_directions(posture)
        lost = inverse.missing(b, posture)
    bounded = _within_bounds(law, given, motion, wanted)
    allocation = _within_limits(law, state, given, motion, bounded.a)
    a = bounded.a - allocation.acceleration_deficit
    return Command(a, wanted - a, lost, bounded.held, allocation)


def _output(tick: Tick, given: ToolMeasured, axes: Array) -> CartesianOutput:
    motion, inverse, allocation = tick.motion, tick.inverse, tick.command.allocation
    unrealised, _ = tick.unrealised()
    return CartesianOutput(
        allocation.tau,
        Pose(motion.rotation, motion.translation),
        tick.reference,
        axes,
        given.wrench.copy(),
        *(tick.errors.e1, tick.errors.e2),
        e3=unrealised / tick.tool.gain - tick.tool.y,
        s=tick.tool.s,
        u=tick.tool.u - unrealised,
        e_null=tick.null.error,
        s_null=tick.rest.s,
        a=tick.command.a,
        jacobian=motion.jacobian,
        inverse=inverse.matrix,
        basis=tick.null.basis,
        sigma=inverse.sigma,
        lost=inverse.lost,
        premise_holds=unrealised == 0.0,
        saturated=allocation.saturated,
        rate_limited=allocation.rate_limited,
        joint_limited=tick.command.joint_limited,
    )


def _next_state(
    law: CartesianLaw, state: CartesianState, given: ToolMeasured, tick: Tick
) -> CartesianState:
    at_tool, in_null = tick.unrealised()
    (tool, rest), dt = (tick.tool, tick.rest), law.dt
    return CartesianState(
        state.ticks + 1,
        law.target.advance(state.displacement, tick.pulled),
        law.tool.reaching.anti_windup(tool.before, tool.after, at_tool, dt),
        law.null.reaching.anti_windup(rest.before, rest.after, in_null, dt),
        basis=tick.null.basis,
        posture=_posture(law, state, given.q).copy(),
        tau=tick.command.allocation.tau.copy(),
        pulled=tick.pulled,
        displacement_before=state.displacement,
        z_before=tool.before.z,
        z_null_before=rest.before.z,
    )


def _sliding(
    law: SlidingLaw,
    state: ReachingState,
    errors: tuple[Array, Array, Array],
    dt: float,
    *,
    is_first: bool,
) -> Sliding:
    """Surface and reaching law of a block (eqs. (6) and (8), one block at a time), from e1, e2 and the rate of e1."""
    e1, e2, e1_rate = errors
    s, (_, feedforward, gain) = law.surface.value(e1, e2), terms(law.surface, e1, e1_rate, dt)
    before = law.reaching.start(s) if is_first else state
    u, after = law.reaching.step(s, before, dt)
    return Sliding(s, u, (feedforward + u) / gain, gain, before, after)


def _posture(law: CartesianLaw, state: CartesianState, q: Array) -> Array:
    """The posture; where none is given, the configuration of the first tick."""
    if law.posture is not None:
        return law.posture
    return state.posture if state.ticks else q


def _posture_error(law: CartesianLaw, state: CartesianState, q: Array) -> Array:
    return law.arm.raw_dynamics.difference(q, _posture(law, state, q))


def _null_space(
    law: CartesianLaw,
    state: CartesianState,
    given: ToolMeasured,
    motion: ToolMotion,
    inverse: DampedInverse,
) -> NullSpace:
    basis = inverse.basis
    if basis.shape[1] == 0:
        none = np.zeros(0)
        return NullSpace(basis, basis, none, none, none)
    q, v = given.q, given.v
    if state.ticks:
        basis = continued_basis(basis, state.basis)
    rate = basis_rate(motion.jacobian, law.kinematics.jacobian_rate(q, v), basis, law.damping)
    away, speed = _posture_error(law, state, q), basis.T @ v
    return NullSpace(basis, rate, basis.T @ away, rate.T @ away - speed, speed)


def _within_bounds(
    law: CartesianLaw, given: ToolMeasured, motion: ToolMotion, a: Array
) -> BoundedAcceleration:
    if law.bounds is None:
        return BoundedAcceleration(a, np.zeros(len(a), dtype=np.bool_))
    x = joint_positions(law.arm, given.q)
    return law.bounds.keep(a, x, given.v, motion.jacobian, law.damping)


def _within_limits(
    law: CartesianLaw, state: CartesianState, given: ToolMeasured, motion: ToolMotion, a: Array
) -> Allocation:
    """The torque RNEA(q, v, a) - tau_ext, within the limits."""
    dynamics, q = law.arm.raw_dynamics, given.q
    tau = dynamics.inverse_dynamics(q, given.v, a) - given.external_torque(motion.jacobian)
    before = state.tau if state.ticks else None
    return (law.limits or Limits()).allocate(
        tau, lambda: dynamics.mass_matrix(q), before=before, dt=law.dt
    )
