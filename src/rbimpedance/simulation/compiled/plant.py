"""The plant between two ticks: forward dynamics with friction and environment, and the integrators of `integrators`."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ..._numba.lanes import any_of, select
from ...control.compiled.law import add_angle
from ...robot.compiled import rigid_body
from ...robot.compiled.rigid_body import friction, place_joints
from ...robot.compiled.tables import (
    ARMATURE,
    CONTINUOUS,
    COULOMB,
    KIND,
    Q_INDEX,
    VISCOUS,
    ArmTables,
    Workspace,
)
from ...robot.pinocchio_dynamics import COULOMB_SMOOTHING
from .environment import Environment, environment_torque

# Columns of `PlantTables.stops`.
LOWER, UPPER, STIFFNESS, DAMPING = 0, 1, 2, 3


class PlantTables(NamedTuple):
    """The simulated arm.

    Attributes:
        arm: Its tables; the armature in them is what the step at hand needs.
        armature: Its own armature, shape (nv,).
        stops: Lower and upper limit, stiffness and damping of every joint's stops, shape (nv, 4); no rows for none.
    """

    arm: ArmTables
    armature: Array
    stops: Array


class PlantMotion(NamedTuple):
    """Where the plant is, and what acts on it.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        a: Acceleration, shape (nv,).
        tau: Motor torque, held for a period, shape (nv,).
        tau_ext: Torque of the environment, shape (nv,).
    """

    q: Array
    v: Array
    a: Array
    tau: Array
    tau_ext: Array


class Stages(NamedTuple):
    """Work space of the Runge-Kutta method: a trial state, and the sums over the stages."""

    q: Array
    v: Array
    v_sum: Array
    a_sum: Array


@fused
def update_tau_ext(
    plant: PlantTables,
    space: Workspace,
    environment: Environment,
    row: int,
    q: Array,
    motion: PlantMotion,
) -> None:
    """Write tau_ext at (q, v); joints are placed for `update_acceleration`, which comes next.

    Args:
        plant: The simulated arm.
        space: Its work space.
        environment: What pushes.
        row: Which time it is.
        q: Configuration.
        motion: With its velocity; the torque goes here.
    """
    place_joints(plant.arm, space, q)
    environment_torque(plant.arm, space, environment, row, motion.v, motion.tau_ext)


@fused
def update_acceleration(plant: PlantTables, space: Workspace, motion: PlantMotion) -> None:
    """Write the acceleration under motors, environment, stops and friction, by ABA; see `PinocchioDynamics`.

    Args:
        plant: The simulated arm.
        space: Its work space after `update_tau_ext`.
        motion: With velocity and torques; the acceleration goes here.
    """
    v, a = motion.v, motion.a
    for j in range(len(v)):
        a[j] = acting_torque(plant, motion, j)
    rigid_body.forward_dynamics(plant.arm, space, v, a, a)


@fused
def acting_torque(plant: PlantTables, motion: PlantMotion, j: int) -> float:
    """Torque of motor, environment, friction and stops on joint j."""
    torque = motion.tau[j] + motion.tau_ext[j] - friction(plant.arm.joints, j, motion.v[j])
    if len(plant.stops):
        torque += _stop_torque(plant, motion, j)
    return torque  # type: ignore[no-any-return]


@fused
def _stop_torque(plant: PlantTables, motion: PlantMotion, j: int) -> float:
    """max(0, k·δ + d·δ̇) back towards the range, where joint j is δ beyond it; see `JointStops`."""
    stops, i = plant.stops, plant.arm.topology[j, Q_INDEX]
    x = motion.q[i]
    if plant.arm.topology[j, KIND] == CONTINUOUS:
        x = math.atan2(motion.q[i + 1], x)
    above, below = x - stops[j, UPPER], stops[j, LOWER] - x
    push = stops[j, DAMPING] * motion.v[j]
    down = -max(0.0, stops[j, STIFFNESS] * above + push)
    up = max(0.0, stops[j, STIFFNESS] * below - push)
    return select(above > 0.0, down, select(below > 0.0, up, 0.0))  # type: ignore[no-any-return]


@fused
def damp(plant: PlantTables, v: Array, h: float) -> None:
    """Let friction act at the end of a step h: h·D(v) joins the armature, D(v)·v = tau_f(v).

    Args:
        plant: The simulated arm, whose armature is changed until `undamp`.
        v: Velocity at the beginning of the step.
        h: The step [s].
    """
    joints = plant.arm.joints
    for j in range(len(v)):
        joints[j, ARMATURE] = plant.armature[j] + h * _friction_slope(joints, j, v[j])


@fused
def undamp(plant: PlantTables) -> None:
    """Give the plant its own armature back."""
    for j in range(len(plant.armature)):
        plant.arm.joints[j, ARMATURE] = plant.armature[j]


@fused
def _friction_slope(joints: Array, j: int, v: float) -> float:
    """D(v) = tau_f(v)/v of joint j."""
    slope = joints[j, VISCOUS]
    if any_of(joints[j, COULOMB] != 0.0):
        x = v / COULOMB_SMOOTHING
        x = select(abs(x) > 1e-8, x, 1e-8)
        slope += joints[j, COULOMB] / COULOMB_SMOOTHING * (math.tanh(x) / x)
    return slope  # type: ignore[no-any-return]


@fused
def integrate(arm: ArmTables, q: Array, h: float, v: Array, q_next: Array) -> None:
    """Write q (+) h·v.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,).
        h: Time [s].
        v: Velocity, shape (nv,).
        q_next: Where it goes, shape (nq,); may be q.
    """
    for j in range(len(v)):
        i = arm.topology[j, Q_INDEX]
        if arm.topology[j, KIND] == CONTINUOUS:
            q_next[i], q_next[i + 1] = add_angle(q[i], q[i + 1], h * v[j])
        else:
            q_next[i] = q[i] + h * v[j]


@fused
def euler_step(plant: PlantTables, motion: PlantMotion, h: float) -> None:
    """Semi-implicit Euler: v⁺ = v + h·a, q⁺ = q (+) h·v⁺."""
    v = motion.v
    for j in range(len(v)):
        v[j] += h * motion.a[j]
    integrate(plant.arm, motion.q, h, v, motion.q)


@routine
def runge_kutta_step(
    plant: PlantTables,
    space: Workspace,
    environment: Environment,
    stages: Stages,
    row: int,
    motion: PlantMotion,
    h: float,
) -> None:
    """The classical Runge-Kutta method in the tangent space at q; see `runge_kutta_4`.

    Args:
        plant: The simulated arm.
        space: Its work space.
        environment: What pushes, one row each for the step's begin, middle and end.
        stages: Work space.
        row: The row of its begin.
        motion: At the step's begin, acceleration included.
        h: The step [s].
    """
    trial = PlantMotion(stages.q, stages.v, motion.a, motion.tau, motion.tau_ext)
    _start_sums(motion, stages)
    _stage(plant, space, environment, row + 1, motion, h / 2.0, trial)
    _add_stage(trial, 2.0, stages)
    _stage(plant, space, environment, row + 1, motion, h / 2.0, trial)
    _add_stage(trial, 2.0, stages)
    _stage(plant, space, environment, row + 2, motion, h, trial)
    _add_stage(trial, 1.0, stages)
    integrate(plant.arm, motion.q, h / 6.0, stages.v_sum, motion.q)
    for j in range(len(motion.v)):
        motion.v[j] += h / 6.0 * stages.a_sum[j]


@fused
def _start_sums(motion: PlantMotion, stages: Stages) -> None:
    for j in range(len(motion.v)):
        stages.v[j], stages.v_sum[j], stages.a_sum[j] = motion.v[j], motion.v[j], motion.a[j]


@routine
def _stage(
    plant: PlantTables,
    space: Workspace,
    environment: Environment,
    row: int,
    start: PlantMotion,
    h: float,
    trial: PlantMotion,
) -> None:
    """Write the state reached after h with the rates of the stage before, and the acceleration there."""
    integrate(plant.arm, start.q, h, trial.v, trial.q)
    for j in range(len(start.v)):
        trial.v[j] = start.v[j] + h * trial.a[j]
    update_tau_ext(plant, space, environment, row, trial.q, trial)
    update_acceleration(plant, space, trial)


@fused
def _add_stage(trial: PlantMotion, weight: float, stages: Stages) -> None:
    for j in range(len(trial.v)):
        stages.v_sum[j] += weight * trial.v[j]
        stages.a_sum[j] += weight * trial.a[j]
