"""Two-link arms whose joints are a few centimetres apart, with friction on one joint: strongly coupled."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import rbimpedance as rbi
from rbimpedance.trajectories import Trajectory

from ..arms import urdf


def two_links_close_together(rng: np.random.Generator) -> str:
    """Joints a few centimetres apart: the second link swings about both, so M couples them strongly."""
    offset, mass = rng.uniform(0.01, 0.1), 10.0 ** rng.uniform(-1.0, 0.5)
    inertia, reach = 10.0 ** rng.uniform(-4.0, -2.5), rng.uniform(0.05, 0.3)

    def link(name: str, place: float, mass: float, inertia: float) -> str:
        about = f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"'
        return (
            f'<link name="{name}"><inertial><origin xyz="{place} 0 0"/><mass value="{mass}"/>'
            f"<inertia {about}/></inertial></link>"
        )

    def joint(name: str, kind: str, parent: str, child: str, place: float) -> str:
        return (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{place} 0 0"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" effort="1000" velocity="100"/></joint>'
        )

    return urdf(
        joint("first", "revolute", "base", "a", 0.0)
        + link("a", offset / 2.0, 0.1, 1e-4)
        + joint("second", "revolute", "a", "b", offset)
        + link("b", reach, mass, inertia)
        + joint("fixed", "fixed", "b", "tool", 2.0 * reach)
        + '<link name="tool"/>'
    )


def task_of(folder: Path, seed: int) -> tuple[rbi.ArmModel, rbi.Uncertainty, Trajectory]:
    rng = np.random.default_rng(seed)
    path = folder / "arm.urdf"
    path.write_text(two_links_close_together(rng), encoding="utf-8")
    arm = rbi.load_robot(path)
    motion = rbi.trajectories.cosine(arm, center=np.array([0.0, rng.uniform(-1.0, 1.0)]))
    payload, viscous = 2.0 * rng.uniform(0.05, 1.0), 10.0 ** rng.uniform(-1.0, 0.7)
    second = [[0.0, 0.0], [0.0, viscous]]  # friction on one joint: its gains are larger
    return arm, rbi.Uncertainty(payload, 1.1, viscous=second), motion
