"""Gains for the law at the tool: the bounds of the joints, projected on translation, rotation and null space.

Plants, model and input gain are those of `propose_gains`, on joint motions that follow the tool's. An acceleration a
that the model misses is T·a at the tool, with T = [J; Vᵀ]; the largest norms of its three blocks take the place of the
joints in the design. Translations count in units of a length, so that one surface serves all blocks. T·G·T⁻¹ has the
eigenvalues of G: the margin is that of the joint space. The worst plants are then simulated, as in joint space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..law.cartesian_impedance import CartesianImpedance
from ..law.damped_inverse import DampedInverse, Damping, continued_basis
from ..law.surfaces import FastTerminalSurface
from ..robot.arm_model import ArmModel
from ..robot.inverse_kinematics import inverse_kinematics
from ..robot.tool_kinematics import ToolKinematics, rotation_error
from ..trajectories import Trajectory, samples
from ..trajectories.cartesian import CartesianTrajectory
from .checks import ROUNDS, SLOWER
from .gain_design import TORQUE_FLOOR, Design, DesignTask, Measured, design, foundations
from .mismatch import Mismatch, balanced_model, measure, missed_torque
from .motions import Motion, sample_motions
from .plant_sample import PlantSample
from .tool_checks import ToolCase, ToolTask, cases_until_failure
from .tool_proposal import BLOCKS, CartesianGainProposal
from .uncertainty import Uncertainty

_STEP = 0.01  # of the joint motion that follows the tool's [s]
_BEYOND = 0.5  # how long the joint motion continues, so that it is not braked where it counts [s]
_RATE = 5.0  # at which it removes its own error [1/s]


class _Blocks(NamedTuple):
    """The three blocks where the design of gains looks for joints."""

    nv: int
    joint_names: tuple[str, ...]
    effort_limit: Array
    position_units: tuple[str, ...] = ("rad",) * 3  # translations count in units of the length


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
    projected = _for_blocks(task, motions, kinematics, damping)
    tool = _Tool(task, projected, trajectory, q, frame, damping)
    return _checked(tool, Measured(model, payload, plants, blocks), joints, impedance)


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
    return replace(task, arm=blocks, uncertainty=uncertainty.but(**noise), limits=None)


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
        frame=tool.frame,
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
        **foundations(task, found.measured),
    )
