"""What is measured: arms, surfaces and schemes."""

from __future__ import annotations

from benchmarks.arms import FINGERS
from rbimpedance.law.super_twisting import Scheme
from rbimpedance.robot.arm_model import ArmModel
from rbimpedance.robot.load import load_robot
from rbimpedance.simulation.scenarios import SurfaceName

SURFACES: tuple[SurfaceName, ...] = ("power", "fast-terminal", "nonsingular-terminal")
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
ARMS = ("two_link", "ur5", "panda", "kinova", "allegro_right_hand", "chain-50")


def load(name: str) -> ArmModel:
    """Return an arm by the name that `load_robot` knows, the panda without its fingers, or `chain-N`."""
    if name.startswith("chain-"):
        return chain(int(name.removeprefix("chain-")))
    return load_robot(name, lock=FINGERS if name == "panda" else ())


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
