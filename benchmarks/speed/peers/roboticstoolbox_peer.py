"""Robotics Toolbox: computed torque by the C recursion of its DH model, whose masses are not those of the URDF."""

from __future__ import annotations

import numpy as np
import roboticstoolbox
from protocol import State, command, serve

robot = roboticstoolbox.models.DH.Panda()


def tick(x: State) -> np.ndarray:
    """Its rne."""
    return robot.rne(x.q, x.v, command(x)) - x.tau_ext


serve({"tick": tick})
