"""Sensors and observers, run along a result."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arrays import Array
from .._common.deprecation import renamed_arguments
from ..exceptions import DimensionError, LogError
from ..interaction import Sensor
from ..interaction.observers import SuperTwistingDisturbanceObserver
from ..law.super_twisting import SuperTwisting
from ..logs import ArmLog
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from .result import SimulationResult

_SAME_PERIOD = 0.01  # relative difference of a log's median period from the sensor's


def replay_sensor(result: SimulationResult | ArmLog, sensor: Sensor[Any]) -> Array:
    """Return the output of a sensor along a run or the log of a real arm, shape (N, nv) [N·m or N].

    Sensors are pure: for the sensor that the run was made with, this is exactly its controller's measurement.

    Args:
        result: The run, or `log.on(arm)`.
        sensor: The sensor, or an estimator with the period of the log.

    Raises:
        DimensionError: The run is of an arm with another number of joints than the sensor's.
        LogError: The log has no torques, or its samples are not the sensor's period apart.
    """
    arm = getattr(sensor, "arm", None)
    if isinstance(arm, ArmModel) and arm.nv != result.v.shape[1]:
        raise DimensionError("result", f"a run with nv = {arm.nv}", f"v of shape {result.v.shape}")
    _check_period(result, sensor)
    return np.array(_outputs(sensor, result))


@renamed_arguments(knowledge="model")
def estimate_disturbance(
    result: SimulationResult | ArmLog,
    arm: ArmModel,
    reaching: SuperTwisting,
    *,
    model: Knowledge = "full",
) -> Array:
    """Return the disturbance torque along a run, as the observer saw it.

    Args:
        result: The run, or `log.on(arm)`.
        arm: The model that the disturbance is measured against: the controller's, say.
        reaching: Gains and scheme; see `SuperTwistingDisturbanceObserver`.
        model: "full", or "inertia" for a model of M(q) alone.

    Returns:
        w at every sample of the run, shape (N, nv) [N·m or N].

    Raises:
        DimensionError: The run is of an arm with another number of joints, or shorter than two ticks.
        ParameterError: An unknown `model`.
        LogError: The log has no torques.
    """
    if len(result.t) < 2 or result.v.shape[1] != arm.nv:
        expected = f"a run of at least two samples with nv = {arm.nv}"
        raise DimensionError("result", expected, f"v of shape {result.v.shape}")
    dt = float(result.t[1] - result.t[0])
    observer = SuperTwistingDisturbanceObserver(arm, reaching, dt, model=model)
    return np.array([estimate.w for estimate in _outputs(observer, result)])


def _check_period(result: SimulationResult | ArmLog, sensor: Sensor[Any]) -> None:
    dt = getattr(sensor, "dt", None)
    if not isinstance(result, ArmLog) or dt is None:
        return
    period = float(np.median(np.diff(result.t)))
    if abs(period / dt - 1.0) > _SAME_PERIOD:
        problem = f"its samples are {period:.4g} s apart, the sensor's period is {dt:.4g} s"
        raise LogError(result.source, problem, f"give the sensor dt={period:.4g}")


def _outputs(part: Any, result: SimulationResult | ArmLog) -> list[Any]:
    """What a sensor or an observer gives at every sample of a run; NaN stands for a tau_ext that was not measured."""
    if result.tau is None:
        raise LogError(result.source, "it has no motor torques", "record the efforts of the joints")
    tau_ext = np.full_like(result.v, np.nan) if result.tau_ext is None else result.tau_ext
    state, outputs = part.init(), []
    held = np.vstack([np.zeros_like(result.tau[:1]), result.tau[:-1]])
    for sample in zip(result.q, result.v, held, tau_ext, strict=True):
        output, state = part.step(state, *sample)
        outputs.append(output)
    return outputs
