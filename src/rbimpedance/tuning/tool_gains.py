"""Gains for the law at the tool: the bounds of the joints, projected on translation, rotation and null space.

Plants, model and input gain are those of `propose_gains`, on joint motions that follow the tool's. An acceleration a
that the model misses is T·a at the tool, with T = [J; Vᵀ]; the largest norms of its three blocks take the place of the
joints in the design. Translations count in units of a length, so that one surface serves all blocks. T·G·T⁻¹ has the
eigenvalues of G: the margin is that of the joint space. The worst plants are then simulated, as in joint space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..control.cartesian import CartesianController, Posture
from ..control.cartesian_defaults import tool_surface
from ..exceptions import ParameterError
from ..law.cartesian_impedance import CartesianImpedance
from ..law.damped_inverse import DampedInverse, Damping, continued_basis
from ..law.limits import Limits
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import FastTerminalSurface
from ..robot.arm_model import ArmModel
from ..robot.inverse_kinematics import inverse_kinematics
from ..robot.tool_kinematics import ToolKinematics, rotation_error
from ..trajectories import Trajectory, samples
from ..trajectories.cartesian import CartesianTrajectory
from .checks import ROUNDS, SLOWER
from .gain_design import TORQUE_FLOOR, Design, DesignTask, Measured, design
from .mismatch import Mismatch, balanced_model, measure, missed_torque
from .motions import Motion, sample_motions
from .plant_sample import PlantSample
from .tool_checks import ToolCase, ToolTask, cases_until_failure
from .uncertainty import Uncertainty

BLOCKS = ("translation", "rotation", "null space")
"""What has gains of its own."""

_STEP = 0.01  # of the joint motion that follows the tool's [s]
_BEYOND = 0.5  # how long the joint motion continues, so that it is not braked where it counts [s]
_RATE = 5.0  # at which it removes its own error [1/s]


class _Blocks(NamedTuple):
    """The three blocks where the design of gains looks for joints."""

    nv: int
    joint_names: tuple[str, ...]
    effort_limit: Array
    position_units: tuple[str, ...] = (
        "rad",
        "rad",
        "rad",
    )  # translations count in units of the length


@brief_repr("feasible", "reason", "k1", "k2", "margin", "payload")
@dataclass(frozen=True, eq=False, kw_only=True)
class CartesianGainProposal:
    """Gains for a `CartesianController`, or why there are none; arrays are for translation, rotation and null space.

    Attributes:
        feasible: Whether bounds, the scheme's margins and the simulated worst plants all allow these gains.
        reason: Why not; empty where feasible.
        block: One of `BLOCKS` that makes it infeasible, or None.
        nominal: The arm as it was given.
        arm: The model that the controller should use.
        payload: Payload in that model [kg].
        frame: Name of the frame.
        dt: Control period [s].
        damping: Of the Jacobian's inverse.
        surface: Sliding surface of an angle; `tool_surface` makes that of the tool.
        k1: Gains of the root, shape (3,).
        k2: Gains of the integral, shape (3,) [m/s³, rad/s³].
        margin: Of the matched scheme.
        missed: Largest acceleration that the model misses, shape (3,) [m/s², rad/s²].
        error: Error that the scheme leaves, predicted, shape (3,) [m, rad].
        noise_error: Error caused by sensor noise, shape (3,) [m, rad].
        mismatch: The bounds in joint space.
        worst: The simulated worst plants; empty where the bounds alone say no.
        limits: Of the actuators, which the controller keeps; None for none.
    """

    feasible: bool
    reason: str
    block: str | None
    nominal: ArmModel
    arm: ArmModel
    payload: float
    frame: str
    dt: float
    damping: Damping
    surface: FastTerminalSurface
    k1: Array
    k2: Array
    margin: float
    missed: Array
    error: Array
    noise_error: Array
    mismatch: Mismatch
    worst: tuple[ToolCase, ...]
    limits: Limits | None

    def controller(
        self,
        impedance: CartesianImpedance | None = None,
        *,
        posture: ArrayLike | None = None,
        limits: Limits | ArrayLike | None = None,
        **options: Any,
    ) -> CartesianController:
        """Build the controller that was proposed.

        Args:
            impedance: Target impedance; the controller's default by default.
            posture: Configuration for the null space, shape (nq,); that of the first tick by default.
            limits: Of the actuators; those of the proposal by default, +inf for none.
            **options: Others of `CartesianController`: joint_limits.

        Raises:
            ParameterError: The proposal is not feasible.
        """
        if not self.feasible:
            raise ParameterError("proposal", self.reason, "feasible")
        k1, k2, margin = self.k1, self.k2, self.margin
        six = SuperTwisting(np.repeat(k1[:2], 3), np.repeat(k2[:2], 3), "matched", margin)
        null = SuperTwisting(float(k1[2]), float(k2[2]), "matched", margin)
        return CartesianController(
            self.arm,
            impedance,
            tool_surface(self.surface, self.damping.length),
            six,
            self.dt,
            frame=self.frame,
            posture=Posture(posture, self.surface, null),
            damping=self.damping,
            limits=self.limits if limits is None else limits,
            **options,
        )

    def explain(self) -> str:
        """Explain the proposal, or why it is infeasible."""
        if not self.feasible:
            return f"No gains: {self.reason}."
        gains = f"{self.mismatch.gain_low:.2g} to {self.mismatch.gain_high:.2g}"
        error = self.error + self.noise_error
        return (
            f"The controller's model holds {self.payload:.3g} kg. A plant answers with {gains} times the acceleration "
            f"that the model expects; margin {self.margin:.3g} tolerates that at dt = {self.dt:g} s. The model misses "
            f"up to {self.missed[0]:.3g} m/s² and {self.missed[1]:.3g} rad/s². The error that is left is about "
            f"{error[0]:.2g} m and {error[1]:.2g} rad{self._explain_simulated()}."
        )

    def _explain_simulated(self) -> str:
        """The largest error of the simulated plants without noise."""
        m, rad = np.max([case.error for case in self.worst if not case.noisy], axis=0)
        return f", in simulation of the worst plants {m:.2g} m and {rad:.2g} rad"


def propose_at_tool(
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: CartesianTrajectory,
    dt: float,
    *,
    frame: str,
    impedance: CartesianImpedance | None = None,
    q0: ArrayLike | None = None,
    damping: Damping | None = None,
    duration: float,
    accuracy: float,
    **search: Any,
) -> CartesianGainProposal:
    """Propose gains for the law at the tool from what is not known about an arm: `propose_gains` with a frame.

    Args:
        arm: The arm as it is modelled.
        uncertainty: What is not known: payload, masses, friction, noise, delay and the rest.
        trajectory: Desired motion of the frame.
        dt: Control period [s].
        frame: Name of the frame.
        impedance: Target impedance that the plants are simulated with; the controller's default by default.
        q0: Configuration at the beginning, shape (nq,); by `inverse_kinematics` by default.
        damping: Of the Jacobian's inverse; its length is the unit of translations.
        duration: Length of the motion that counts [s].
        accuracy: Largest error allowed [rad]; translations times the length.
        **search: The other fields of `gain_design.DesignTask`.

    Raises:
        ParameterError: A period, duration, accuracy or count that cannot be, or a start that is out of reach.
        DimensionError: A range, a limit or q0 is for another number of joints.
        ModelError: No such frame.
    """
    kinematics, damping = ToolKinematics(arm, frame), damping or Damping()
    q = inverse_kinematics(arm, trajectory(0.0).pose, frame=frame) if q0 is None else q0
    q = np.array(arm.check_configuration("q0", q))
    task = DesignTask(
        arm=arm,
        uncertainty=uncertainty,
        trajectory=joint_motion(arm, kinematics, trajectory, q, duration + _BEYOND, damping),
        dt=dt,
        duration=duration,
        accuracy=accuracy,
        **search,
    )
    motions = sample_motions(
        arm, task.trajectory, duration, dt, task.instants, task.seed, task.spread
    )
    model, payload = balanced_model(arm, uncertainty, motions, dt)
    plants = uncertainty.sample(arm, task.samples, seed=task.seed)
    joints = measure(model, plants, motions, dt)
    blocks = _projected(model, plants, motions, joints, _Projection(kinematics, damping, dt))
    measured = Measured(model, payload, plants, blocks)
    projected = _for_blocks(task, motions, kinematics, damping)
    return _checked(
        _Tool(task, projected, trajectory, q, kinematics.frame, damping),
        measured,
        joints,
        impedance,
    )


class _Tool(NamedTuple):
    """What gains at a frame are for.

    Attributes:
        task: The task with the joint motion that follows the tool's.
        projected: The same with blocks in the place of joints.
        trajectory: Desired motion of the frame.
        q0: Configuration at the beginning, shape (nq,).
        frame: Name of the frame.
        damping: Of the Jacobian's inverse.
    """

    task: DesignTask
    projected: DesignTask
    trajectory: CartesianTrajectory
    q0: Array
    frame: str
    damping: Damping


def _checked(
    tool: _Tool, measured: Measured, joints: Mismatch, impedance: CartesianImpedance | None
) -> CartesianGainProposal:
    """Design gains, simulate the worst plants, and slow the scheme down where one of them chatters or diverges."""
    slower = 1.0
    worst: tuple[ToolCase, ...] = ()
    for _ in range(ROUNDS):
        found = design(tool.projected, measured, slower=slower)
        if found.joint is not None:
            so_far = f"{worst[-1].reason}, and slower, " if worst else ""
            return _proposal(tool, replace(found, reason=so_far + found.reason), joints, worst)
        proposal = _proposal(tool, found, joints, ())
        controller = proposal.controller(impedance, posture=tool.q0)
        worst = cases_until_failure(_to_simulate(tool, proposal, measured), controller)
        failed = worst[-1]
        found = replace(found, joint=failed.block, reason=failed.reason)
        if not failed.unstable:
            break
        slower *= SLOWER
    return _proposal(tool, found, joints, worst)


def _to_simulate(tool: _Tool, proposal: CartesianGainProposal, measured: Measured) -> ToolTask:
    task, extremes = tool.task, measured.mismatch.extremes
    return ToolTask(
        task,
        tool.trajectory,
        tool.q0,
        samples=tuple(measured.samples[i] for i in dict.fromkeys(extremes)),
        accuracy=task.accuracy * np.array([tool.damping.length, 1.0]),
        noise_error=proposal.noise_error[:2],
    )


def joint_motion(
    arm: ArmModel,
    kinematics: ToolKinematics,
    trajectory: CartesianTrajectory,
    q: Array,
    duration: float,
    damping: Damping,
) -> Trajectory:
    """Return a joint motion by which the tool follows a trajectory, by the inverse of the Jacobian.

    Args:
        arm: The arm.
        kinematics: Of the frame.
        trajectory: Of the frame.
        q: Configuration at the beginning, shape (nq,).
        duration: How long [s].
        damping: Of the inverse.
    """
    times = np.arange(0.0, duration + _STEP, _STEP)
    rows, zero = [q], np.zeros(arm.nv)
    for t in times[:-1].tolist():
        (R, p), v, _ = trajectory(t)
        now = kinematics.motion(rows[-1], zero)
        error = np.concatenate([p - now.translation, rotation_error(R, now.rotation)])
        speed = DampedInverse(now.jacobian, damping).matrix @ (v + _RATE * error)
        rows.append(arm.raw_dynamics.integrate(rows[-1], _STEP * speed))
    return samples(arm, times, np.array(rows), check_limits=False)


class _Projection(NamedTuple):
    """From joint accelerations to the sizes of the three blocks."""

    kinematics: ToolKinematics
    damping: Damping
    dt: float

    def matrix(self, q: Array) -> Array:
        """Return T = [J; Vᵀ] with translations in units of the length."""
        J = self.kinematics.motion(q, np.zeros(self.kinematics.nv)).jacobian
        return np.vstack(
            [self.damping.scales()[:, None] * J, DampedInverse(J, self.damping).basis.T]
        )

    @staticmethod
    def sizes(x: Array) -> Array:
        """Return the largest norm of each block's rows over the columns of x, shape (3,)."""
        blocks = (x[:3], x[3:6], x[6:])
        return np.array([np.linalg.norm(each, axis=0).max(initial=0.0) for each in blocks])


def _projected(
    model: ArmModel,
    plants: Sequence[PlantSample],
    motions: Sequence[Motion],
    joints: Mismatch,
    projection: _Projection,
) -> Mismatch:
    """The mismatch with blocks in the place of joints."""
    missed, rate = np.zeros(3), np.zeros(3)
    for motion in motions:
        T = projection.matrix(motion.now.q)
        T_then = projection.matrix(motion.then.q)
        T_then[6:] = continued_basis(T_then[6:].T, T[6:].T).T
        for sample in plants:
            held = projection.dt * sample.plant.viscous
            _, pushed = missed_torque(model, sample, motion.now, held)
            _, pushed_then = missed_torque(model, sample, motion.then, held)
            inverse = np.linalg.inv(sample.plant.raw_dynamics.mass_matrix(motion.now.q))
            floor = projection.sizes(T @ inverse * TORQUE_FLOOR)
            change = (T_then @ pushed_then - T @ pushed)[:, None] / projection.dt
            missed = np.maximum(missed, np.maximum(projection.sizes((T @ pushed)[:, None]), floor))
            rate = np.maximum(rate, projection.sizes(change))
    ones = np.ones(3)
    return replace(
        joints,
        torque=missed,
        disturbance=missed,
        disturbance_rate=rate,
        inertia=ones,
        joint_low=0,
        joint_high=0,
    )


def _for_blocks(
    task: DesignTask, motions: Sequence[Motion], kinematics: ToolKinematics, damping: Damping
) -> DesignTask:
    """The task of the design with blocks in the place of joints, and noise as it is at the tool."""
    projection = _Projection(kinematics, damping, task.dt)
    rows = [np.linalg.norm(projection.matrix(now.q), axis=1).max() for now, _ in motions]
    factor, uncertainty = float(np.max(rows)), task.uncertainty
    noise = {
        "position_noise": factor * uncertainty.position_noise,
        "velocity_noise": factor * uncertainty.velocity_noise,
    }
    blocks = cast("ArmModel", _Blocks(3, BLOCKS, np.full(3, np.inf)))
    return replace(task, arm=blocks, uncertainty=uncertainty.but(**noise))


def _proposal(
    tool: _Tool, found: Design, joints: Mismatch, worst: tuple[ToolCase, ...]
) -> CartesianGainProposal:
    """The design in metres and radians."""
    task, damping = tool.task, tool.damping
    unit = np.array([damping.length, 1.0, 1.0])
    reason, block = found.reason, found.joint
    for name in BLOCKS:
        reason = reason.replace(f"joint '{name}'", f"the '{name}'")
    if not np.isfinite(found.margin):
        high = joints.gain_high * joints.gain_low > 1.0
        name = task.arm.joint_names[joints.joint_high if high else joints.joint_low]
        reason, block = reason.replace(f"the '{BLOCKS[0]}'", f"joint '{name}'"), None
    surface = found.surface
    if not isinstance(surface, FastTerminalSurface):  # the usual surfaces are
        raise TypeError(type(surface).__name__)
    return CartesianGainProposal(
        feasible=not reason,
        reason=reason,
        block=None if block is None else BLOCKS[block],
        nominal=task.arm,
        arm=found.measured.model,
        payload=found.measured.payload,
        frame=tool.frame,
        dt=task.dt,
        damping=damping,
        surface=surface,
        k1=found.k1 * np.sqrt(unit),
        k2=found.k2 * unit,
        margin=found.margin,
        missed=found.measured.mismatch.torque * unit,
        error=found.error * unit,
        noise_error=found.noise_error * unit,
        mismatch=joints,
        worst=worst,
        limits=task.limits,
    )
