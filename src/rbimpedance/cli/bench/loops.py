"""Closed loops: one world through `simulate`, many through `simulate_batch`."""

from __future__ import annotations

from time import perf_counter_ns as clock

import numpy as np

from ..._common.arrays import Array
from ...control.protocol import Backend
from ...robot.arm_model import ArmModel
from ...simulation.batch import simulate_batch
from ...simulation.run import simulate
from .cases import DT, controller, motion
from .timing import Timer


def step_timer(arm: ArmModel, backend: Backend) -> Timer:
    """Return what times a run of `simulate` of so many ticks, one physics step a tick, logs included, per tick.

    Args:
        arm: Controller's model and plant.
        backend: Of controller and simulation.
    """
    made, trajectory = controller(arm, backend), motion(arm)
    q0 = trajectory(0.0).q

    def durations(count: int) -> Array:
        start = clock()
        simulate(
            made,
            arm,
            trajectory,
            q0=q0,
            duration=count * DT,
            substeps=1,
            backend=backend,
        )
        return np.array([(clock() - start) / 1e3 / (count + 1)])

    return durations


def plants(arm: ArmModel, count: int, seed: int = 0) -> list[ArmModel]:
    """Return arms that differ: each with a payload of its own, up to 2 kg."""
    rng = np.random.default_rng(seed)
    return [arm.with_payload(float(mass)) for mass in rng.uniform(0.0, 2.0, count)]


def batch_timer(arm: ArmModel, worlds: list[ArmModel], threads: int) -> Timer:
    """Return what times a run of `simulate_batch` of so many ticks, metrics included, per world and tick.

    Args:
        arm: The controller's model.
        worlds: One plant each.
        threads: How many to use.
    """
    made, trajectory = controller(arm, "compiled"), motion(arm)
    q0 = trajectory(0.0).q

    def durations(count: int) -> Array:
        start = clock()
        simulate_batch(
            made,
            worlds,
            trajectory,
            q0=q0,
            duration=count * DT,
            substeps=1,
            threads=threads,
        )
        return np.array([(clock() - start) / 1e3 / (count + 1) / len(worlds)])

    return durations
