"""PyBullet: computed torque by calculateInverseDynamics."""

from __future__ import annotations

import sys

import numpy as np
import pybullet as bullet
from protocol import State, command, serve

bullet.connect(bullet.DIRECT)
bullet.setGravity(0.0, 0.0, -9.81)
robot = bullet.loadURDF(sys.argv[1], useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE)


def tick(x: State) -> np.ndarray:
    """It takes and returns lists."""
    torque = bullet.calculateInverseDynamics(robot, x.q.tolist(), x.v.tolist(), command(x).tolist())
    return np.array(torque) - x.tau_ext


serve({"tick": tick})
