"""Pink: differential inverse kinematics of a posture task. It computes velocities, no torque."""

from __future__ import annotations

import sys

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import PostureTask
from protocol import State, serve

model = pin.buildModelFromUrdf(sys.argv[1])
configuration = pink.Configuration(model, model.createData(), pin.neutral(model))
task = PostureTask(cost=1.0)


def tick(x: State) -> np.ndarray:
    """Set the reference, build the problem, solve it."""
    configuration.update(x.q)
    task.set_target(x.q_d)
    return pink.solve_ik(configuration, [task], 1e-3, solver="quadprog")


serve({"tick": tick})
