"""Sensors and observers, run along a result."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arrays import Array
from .._common.deprecation import renamed_arguments
from ..exceptions import DimensionError
from ..interaction import Sensor
from ..interaction.observers import SuperTwistingDisturbanceObserver
from ..law.super_twisting import SuperTwisting
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from .result import SimulationResult


def replay_sensor(result: SimulationResult, sensor: Sensor[Any]) -> Array:
    """Return the output of a sensor along a run, shape (N, nv) [N·m or N].

    Sensors are pure: for the sensor that the run was made with, this is exactly its controller's measurement.

    Args:
        result: The run.
        sensor: The sensor.

    Raises:
        DimensionError: The run is of an arm with another number of joints than the sensor's.
    """
    arm = getattr(sensor, "arm", None)
    if isinstance(arm, ArmModel) and arm.nv != result.v.shape[1]:
        raise DimensionError("result", f"a run with nv = {arm.nv}", f"v of shape {result.v.shape}")
    return np.array(_outputs(sensor, result))


@renamed_arguments(knowledge="model")
def estimate_disturbance(
    result: SimulationResult,
    arm: ArmModel,
    reaching: SuperTwisting,
    *,
    model: Knowledge = "full",
) -> Array:
    """Return the disturbance torque along a run, as the observer saw it.

    Args:
        result: The run.
        arm: The model that the disturbance is measured against: the controller's, say.
        reaching: Gains and scheme; see `SuperTwistingDisturbanceObserver`.
        model: "full", or "inertia" for a model of M(q) alone.

    Returns:
        w at every sample of the run, shape (N, nv) [N·m or N].

    Raises:
        DimensionError: The run is of an arm with another number of joints, or shorter than two ticks.
        ParameterError: An unknown `model`.
    """
    if len(result.t) < 2 or result.v.shape[1] != arm.nv:
        expected = f"a run of at least two samples with nv = {arm.nv}"
        raise DimensionError("result", expected, f"v of shape {result.v.shape}")
    dt = float(result.t[1] - result.t[0])
    observer = SuperTwistingDisturbanceObserver(arm, reaching, dt, model=model)
    return np.array([estimate.w for estimate in _outputs(observer, result)])


def _outputs(part: Any, result: SimulationResult) -> list[Any]:
    """What a sensor or an observer gives at every sample of a run."""
    state, outputs = part.init(), []
    held = np.vstack([np.zeros_like(result.tau[:1]), result.tau[:-1]])
    for sample in zip(result.q, result.v, held, result.tau_ext, strict=True):
        output, state = part.step(state, *sample)
        outputs.append(output)
    return outputs
