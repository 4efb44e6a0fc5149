"""MuJoCo: computed torque by its recursive Newton-Euler, and a step of its simulation."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
from protocol import State, command, serve

spec = mujoco.MjSpec.from_string(Path(sys.argv[1]).read_text(encoding="utf-8"))
spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
spec.option.timestep = 1e-3
spec.compiler.fusestatic = True
model = spec.compile()
data, falling = mujoco.MjData(model), mujoco.MjData(model)
torque = np.zeros(model.nv)


def tick(x: State) -> np.ndarray:
    """mj_rne after the stages of kinematics that it needs."""
    data.qpos[:] = x.q
    data.qvel[:] = x.v
    data.qacc[:] = command(x)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    mujoco.mj_rne(model, data, 1, torque)
    return torque - x.tau_ext


def inverse(x: State) -> np.ndarray:
    """mj_inverse, the call that its documentation names."""
    data.qpos[:] = x.q
    data.qvel[:] = x.v
    data.qacc[:] = command(x)
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse - x.tau_ext


def step(x: State) -> np.ndarray:
    """mj_step alone, without a controller and without constraints."""
    del x
    mujoco.mj_step(model, falling)
    return torque


serve({"tick": tick, "inverse": inverse, "step": step})
