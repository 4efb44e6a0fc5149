"""What is measured: arms, the controller that each gets, the states that its ticks see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._common.arrays import Array
from ...control.controller import ImpedanceController
from ...control.protocol import Backend
from ...law.impedance import Impedance
from ...law.super_twisting import Scheme, SuperTwisting
from ...robot.arm_model import ArmModel
from ...robot.load import load_robot
from ...simulation.scenarios import SurfaceName, paper_surface
from ...trajectories import Reference, Trajectory, cosine

BACKENDS: tuple[Backend, ...] = ("pinocchio", "compiled")
SURFACES: tuple[SurfaceName, ...] = ("power", "fast-terminal", "nonsingular-terminal")
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
ARMS = ("two_link", "ur5", "panda", "kinova", "allegro_right_hand", "chain-50")
DT = 1e-3

_FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
STATES = 64


class Inputs(NamedTuple):
    """What one tick is given.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        reference: Desired motion.
        tau_ext: Torque of the environment, shape (nv,).
    """

    q: Array
    v: Array
    reference: Reference
    tau_ext: Array


def load(name: str) -> ArmModel:
    """Return an arm by the name that `load_robot` knows, the panda without its fingers, or `chain-N`."""
    if name.startswith("chain-"):
        return chain(int(name.removeprefix("chain-")))
    return load_robot(name, lock=_FINGERS if name == "panda" else ())


def chain(joints: int) -> ArmModel:
    """Return an arm of equal links whose joints turn about z, x and y by turns."""
    return load_robot(chain_urdf(joints))


def chain_urdf(joints: int) -> str:
    """Return the description of `chain`: links of 0.1 m and 0.5 kg."""
    body = (
        '<inertial><origin xyz="0.01 -0.01 0.05"/><mass value="0.5"/>'
        '<inertia ixx="2e-3" iyy="2e-3" izz="1e-3" ixy="1e-4" ixz="0" iyz="-1e-4"/></inertial>'
    )
    limit = '<limit lower="-3" upper="3" effort="100" velocity="10"/>'
    parts = [f'<robot name="chain-{joints}"><link name="link0"/>']
    for i in range(1, joints + 1):
        axis = ("0 0 1", "1 0 0", "0 1 0")[(i - 1) % 3]
        parts.append(
            f'<link name="link{i}">{body}</link><joint name="joint{i}" type="revolute">'
            f'<parent link="link{i - 1}"/><child link="link{i}"/><origin xyz="0 0 0.1"/>'
            f'<axis xyz="{axis}"/>{limit}</joint>'
        )
    return "".join([*parts, "</robot>"])


def controller(
    arm: ArmModel,
    backend: Backend,
    surface: SurfaceName = "fast-terminal",
    scheme: Scheme = "matched",
) -> ImpedanceController:
    """Return the controller that is measured, warmed up."""
    made = ImpedanceController(
        arm,
        impedance=Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        surface=paper_surface(surface),
        reaching=SuperTwisting(8.0, 10.0, scheme),
        dt=DT,
        backend=backend,
    )
    made.warm_up()
    return made


def motion(arm: ArmModel) -> Trajectory:
    """Return the motion: every joint about the middle of its range, where it has one."""
    bounded = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    center = np.array(arm.neutral)
    center[bounded] = (arm.lower[bounded] + arm.upper[bounded]) / 2.0
    return cosine(arm, center=center, amplitude=0.2, period=6.0)


def inputs(arm: ArmModel, seed: int = 0) -> list[Inputs]:
    """Return what ticks along a motion see.

    Joints swing by 0.2 rad in 6 s about the middle of their range, with errors about 1e-3 rad and 1e-2 rad/s.
    """
    rng, trajectory = np.random.default_rng(seed), motion(arm)
    found = []
    for t in np.linspace(0.0, 6.0, STATES, endpoint=False):
        reference, noise = trajectory(float(t)), rng.normal(size=(3, arm.nv))
        q = arm.raw_dynamics.integrate(reference.q, 1e-3 * noise[0])
        found.append(Inputs(q, reference.v + 1e-2 * noise[1], reference, noise[2]))
    return found
