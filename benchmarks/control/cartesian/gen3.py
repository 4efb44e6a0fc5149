"""A Kinova Gen3 with seven joints, four of them continuous, from the maker's published figures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

import rbimpedance as rbi


class Link(NamedTuple):
    """A joint and the link behind it.

    Attributes:
        roll: Of the joint's placement about x [rad].
        origin: Of the joint [m].
        mass: Of the link [kg].
        com: Its centre of mass [m].
        inertia: Ixx, Ixy, Ixz, Iyy, Iyz, Izz about it [kg·m²].
        continuous: Whether the joint turns without limits.
    """

    roll: float
    origin: tuple[float, float, float]
    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    continuous: bool


_UP = np.pi / 2.0
LINKS = (
    Link(np.pi, (0.0, 0.0, 0.15643), 1.377, (-2.3e-5, -0.010364, -0.07336),
         (0.00457, 1e-6, 2e-6, 0.004831, 0.000448, 0.001409), True),
    Link(_UP, (0.0, 0.005375, -0.12838), 1.163, (-4.4e-5, -0.09958, -0.013278),
         (0.011088, 5e-6, 0.0, 0.001072, -0.000691, 0.011255), False),
    Link(-_UP, (0.0, -0.21038, -0.006375), 1.163, (-4.4e-5, -0.006641, -0.117892),
         (0.010932, 0.0, -7e-6, 0.011127, 0.000606, 0.001043), True),
    Link(_UP, (0.0, 0.006375, -0.21038), 0.93, (-1.8e-5, -0.075478, -0.015006),
         (0.008147, -1e-6, 0.0, 0.000631, -0.0005, 0.008316), False),
    Link(-_UP, (0.0, -0.20843, -0.006375), 0.678, (1e-6, -0.009432, -0.063883),
         (0.001596, 0.0, 0.0, 0.001607, 0.000256, 0.000399), True),
    Link(_UP, (0.0, 0.00017505, -0.10593), 0.678, (1e-6, -0.045483, -0.00965),
         (0.001641, 0.0, 0.0, 0.00041, -0.000278, 0.001641), False),
    Link(-_UP, (0.0, -0.10593, -0.00017505), 0.364, (-9.3e-5, 0.000132, -0.022905),
         (0.000214, 0.0, 1e-6, 0.000223, -2e-6, 0.00024), True),
)  # fmt: skip


def gen3() -> rbi.ArmModel:
    """Return the arm with rotors of 0.1 kg·m²."""
    model, at = pin.Model(), 0
    for i, link in enumerate(LINKS):
        kind = pin.JointModelRUBZ() if link.continuous else pin.JointModelRZ()
        placement = pin.SE3(pin.rpy.rpyToMatrix(link.roll, 0.0, 0.0), np.array(link.origin))
        at = model.addJoint(at, kind, placement, f"joint_{i + 1}")
        xx, xy, xz, yy, yz, zz = link.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        body = pin.Inertia(link.mass, np.array(link.com), inertia)
        model.appendBodyToJoint(at, body, pin.SE3.Identity())
    flange = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.array([0.0, 0.0, -0.061525]))
    model.addFrame(pin.Frame("tool", at, 0, flange, pin.FrameType.OP_FRAME))
    model.armature = np.full(7, 0.1)
    return rbi.ArmModel(model, name="gen3", tool_frame="tool")
