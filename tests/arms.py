"""Small arms for the tests, built from Pinocchio models without the loader."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

import rbimpedance as rbi

_INERTIAL = """<inertial><origin xyz="0.02 -0.01 0.15" rpy="0.1 0.2 0.3"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0.0015"/></inertial>"""

LIMIT = '<limit lower="-1.5" upper="2" effort="30" velocity="4"/>'


def urdf_link(name: str, mass: float) -> str:
    return f'<link name="{name}">{_INERTIAL.format(mass=mass)}</link>'


def urdf_joint(
    name: str, kind: str, parent: str, child: str, axis: str = "0 0 1", more: str = ""
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.05 -0.02 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="{axis}"/>{more}</joint>'
    )


def urdf(*elements: str) -> str:
    return f'<robot name="arm"><link name="base"/>{"".join(elements)}</robot>'


def spinner_urdf(*more: str, oblique: str = "1 2 -1", tool_joint: str = "tool_joint") -> str:
    """A continuous, a prismatic and an oblique revolute joint, and a tool frame at the end."""
    return urdf(
        urdf_joint("spin", "continuous", "base", "hub", "0 1 0"),
        urdf_link("hub", 2.0),
        urdf_joint("slide", "prismatic", "hub", "carriage", "1 0 0", LIMIT),
        urdf_link("carriage", 1.5),
        urdf_joint("tilt", "revolute", "carriage", "hand", oblique, LIMIT),
        urdf_link("hand", 1.0),
        urdf_joint(tool_joint, "fixed", "hand", "tool"),
        '<link name="tool"/>',
        *more,
    )


def mimic_urdf(multiplier: float = -0.5) -> str:
    """A joint that leads, an oblique one that follows it, and a continuous one after them."""
    rule = f'<mimic joint="lead" multiplier="{multiplier}" offset="0.2"/>'
    return urdf(
        urdf_joint("lead", "revolute", "base", "first", "0 1 0", LIMIT),
        urdf_link("first", 2.0),
        urdf_joint("follow", "revolute", "first", "second", "1 1 0", LIMIT + rule),
        urdf_link("second", 1.5),
        urdf_joint("spin", "continuous", "second", "tool", "1 0 0"),
        urdf_link("tool", 1.0),
    )


def arm_from_urdf(text: str, tool_frame: str = "tool", *, mimic: bool = False) -> rbi.ArmModel:
    return rbi.ArmModel(pin.buildModelFromXML(text, mimic), name="arm", tool_frame=tool_frame)


def manipulator() -> rbi.ArmModel:
    """Six revolute joints with friction and rotors."""
    model = pin.buildSampleModelManipulator()
    model.damping = np.linspace(0.1, 0.6, 6)
    model.upperDryFrictionLimit = np.linspace(0.3, 0.8, 6)
    model.armature = np.linspace(0.05, 0.1, 6)
    return rbi.ArmModel(model, name="manipulator", tool_frame="effector_body")


def spinner() -> rbi.ArmModel:
    arm = arm_from_urdf(spinner_urdf())
    return arm.with_friction([0.1, 0.2, 0.3], [0.5, 0.4, 0.3]).with_armature([0.1, 0.2, 0.05])


def follower() -> rbi.ArmModel:
    arm = arm_from_urdf(mimic_urdf(), mimic=True)
    return arm.with_friction([0.1, 0.2], [0.5, 0.4]).with_armature([0.1, 0.05])


def pendulum() -> rbi.ArmModel:
    """A point mass of 2 kg at the end of a massless rod of 0.5 m: m l² a + m g l sin q = tau."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pivot")
    rod = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5]))
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), np.zeros((3, 3))), rod)
    model.addFrame(pin.Frame("bob", joint, 0, rod, pin.FrameType.OP_FRAME))
    return rbi.ArmModel(model, name="pendulum", tool_frame="bob")


ARMS: dict[str, Callable[[], rbi.ArmModel]] = {
    "manipulator": manipulator,
    "spinner": spinner,
    "follower": follower,
}
