"""What makes a start unsafe: found before a torque is sent, and said in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..control.protocol import WrappableController
from ..exceptions import UnsafeError
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from ..trajectories.limits import joint_positions
from .protocol import Conventions, Robot, RobotState

FARTHEST_START = 0.2
"""Distance from the reference from which a start is refused [rad or m]."""

FASTEST_START = 0.05
"""Speed from which a start is refused [rad/s or m/s]."""

WEIGHT_ERROR, WEIGHT_SHARE = 0.5, 0.01
"""Gravity torque that the model misses: refused where it is more than this share of the largest gravity torque and of
the joint's own limit of the torque."""


def check_controller(conventions: Conventions, controller: WrappableController[Any]) -> None:
    """Refuse a controller that is not made for a robot.

    Args:
        conventions: Of the robot.
        controller: What is to drive it.

    Raises:
        UnsafeError: It is for another number of joints or another period, or its limits are none or beyond the robot's.
    """
    if reasons := list(_of_controller(conventions, controller)):
        raise UnsafeError(conventions.name, reasons)


def check_start(
    robot: Robot, controller: WrappableController[Any], state: RobotState, reference: Reference
) -> None:
    """Refuse a start that is not safe, before the robot moves.

    Args:
        robot: The robot.
        controller: What is to drive it, which `check_controller` accepts.
        state: What the robot reports, at rest.
        reference: Desired motion at the start.

    Raises:
        UnsafeError: The robot moves, is far from the reference or outside its limits, or its weight is not what the
            model says: gravity twice, or not at all.
    """
    reasons = [
        *_of_start(controller.arm, state, reference),
        *_of_gravity(robot, controller, state),
    ]
    if reasons:
        raise UnsafeError(robot.conventions.name, reasons)


def _of_controller(conventions: Conventions, controller: WrappableController[Any]) -> Iterator[str]:
    """What is wrong with a controller for a robot."""
    arm, limits, nv = controller.arm, controller.limits, len(conventions.joint_names)
    if arm.nv != nv:
        yield f"the controller's model has {arm.nv} joints, the robot {nv}"
        return
    if abs(controller.dt - conventions.period) > 1e-9:
        yield f"the controller's period is {controller.dt:g} s, the robot's {conventions.period:g} s"
    if limits is None:
        yield "the controller has no limits; give it limits=rbi.Limits(effort=..., rate=...)"
        return
    for words, own, most in (
        ("torque", limits.effort, conventions.effort),
        ("torque rate", limits.rate, conventions.torque_rate),
    ):
        beyond = np.broadcast_to(own, nv) > most * (1.0 + 1e-9)
        if beyond.any():
            joint = int(np.argmax(beyond))
            value, name = np.broadcast_to(own, nv)[joint], conventions.joint_names[joint]
            yield f"its limit of the {words} is {value:g} at {name}; the robot takes {most[joint]:g}"


def _of_start(arm: ArmModel, state: RobotState, reference: Reference) -> Iterator[str]:
    """What is wrong with where the robot is."""
    if not all(np.isfinite(x).all() for x in (state.q, state.v, state.command)):
        yield "the robot reports numbers that are not finite"
        return
    x, (lower, upper) = joint_positions(arm, state.q), arm.joint_limits()
    for j in np.flatnonzero((x < lower) | (x > upper)):
        yield f"{arm.joint_names[j]} is at {x[j]:.3f}, outside [{lower[j]:.3f}, {upper[j]:.3f}]"
    if (speed := np.abs(state.v).max()) > FASTEST_START:
        yield f"the robot moves already, at {speed:.2g} rad/s or m/s; start it at rest"
    away = np.abs(arm.raw_dynamics.difference(state.q, reference.q))
    if away.max() > FARTHEST_START:
        farthest = int(np.argmax(away))
        where = f"{arm.joint_names[farthest]} is {away[farthest]:.2f} rad or m away from"
        most = f"move the robot there first, at most {FARTHEST_START} away"
        yield f"{where} where the motion begins; {most}"


def _of_gravity(
    robot: Robot, controller: WrappableController[Any], state: RobotState
) -> Iterator[str]:
    """Whether the model's weight is compensated once: by the robot and the command together."""
    if not robot.conventions.adds_gravity:
        return
    arm, own = controller.arm, np.inf if controller.limits is None else controller.limits.effort
    held = state.command + robot.gravity(state.q)
    weight = arm.raw_dynamics.bias(state.q, np.zeros(arm.nv))
    missed, effort = np.abs(held - weight), np.minimum(own, robot.conventions.effort)
    largest = max(np.abs(weight).max(), np.abs(held).max())
    wrong = (missed > WEIGHT_ERROR * largest) & (missed > WEIGHT_SHARE * effort)
    for j in np.flatnonzero(wrong):
        yield (
            f"{arm.joint_names[j]} is held with {held[j]:.1f}, and the model says {weight[j]:.1f} N·m or N: gravity is "
            "counted twice or not at all. The robot adds its own; leave gravity in the model, the loop subtracts it"
        )
