"""Runs of a `HardwareController` on drives by compiled code; `closed_loop.run` specifies what they compute."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arrays import Array
from ..control.encoders import QuantizedEncoders
from ..control.hardware_controller import HardwareController
from ..control.telemetry import FLAGS
from ..exceptions import UnsupportedJointError
from ..interaction import Perfect
from ..trajectories import Reference
from .checkpoint import Checkpoint
from .closed_loop import ClosedLoop, OnTick, empty_channels
from .plants import DrivenPlant
from .plants.compiled_drives import can_compile, drive_tables
from .result import SimulationResult
from .sampling import sample, tick_times

BLOCK = 1000
"""Ticks in a block: between two of them the interpreter gets its turn."""


def run_driven(
    loop: ClosedLoop, on_tick: OnTick | None = None, checkpoint: Checkpoint | None = None
) -> SimulationResult | None:
    """Run a closed loop by compiled code; None where it has no compiled form, or at inputs that this refuses.

    Raises:
        DivergenceError: A joint left every sensible range.
        InputError: The reference or the environment is not what a controller takes.
    """
    run = None if checkpoint is not None else driven_run(loop)
    return None if run is None else run.result(on_tick)


def driven_run(loop: ClosedLoop) -> DrivenRun | None:
    """Return a closed loop in compiled form, at its beginning; None where it has none.

    Args:
        loop: The loop.
    """
    if not has_driven_form(loop):
        return None
    try:
        return DrivenRun(loop)
    except UnsupportedJointError:
        return None


def has_driven_form(loop: ClosedLoop) -> bool:
    """Return whether this is a `HardwareController` on drives, sensors and an environment that have a compiled form.

    Args:
        loop: The loop.
    """
    law, engine = _law(loop.controller), loop.engine
    if law is None or law._form.tables is None or not isinstance(engine, DrivenPlant):
        return False
    from .compiled.environment import can_sample  # noqa: PLC0415 (Numba is loaded when needed)

    watched = loop.stops is not None or type(loop.sensor) is not Perfect
    return can_compile(engine) and not watched and can_sample(loop.environment)


def _law(controller: Any) -> HardwareController | None:
    """The controller behind encoders, or without them."""
    inner = controller.controller if type(controller) is QuantizedEncoders else controller
    return inner if type(inner) is HardwareController else None


class DrivenRun:
    """One run in compiled form.

    Args:
        loop: One that `has_driven_form`.

    Raises:
        UnsupportedJointError: A joint without a compiled form.
    """

    def __init__(self, loop: ClosedLoop) -> None:
        from ..control.compiled import hardware_tables as tick  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled import driven  # noqa: PLC0415
        from .compiled.environment import EnvironmentTables  # noqa: PLC0415

        law, engine = _law(loop.controller), loop.engine
        assert law is not None
        assert isinstance(engine, DrivenPlant)
        nq, nv = loop.plant.nq, loop.plant.nv
        loop.environment.torque(
            loop.plant, 0.0, loop.q, loop.v
        )  # refuses what does not fit the arm
        self.loop, self.law = loop, law
        self.surroundings = EnvironmentTables(loop.environment, loop.plant)
        self.channels = empty_channels(loop.ticks + 1, nq, nv)
        for name in FLAGS:
            self.channels[name][:] = False
        started, state = engine.begin(loop.q, loop.v, loop.h), law.init()
        self.memory = tick.TickMemory(*(np.array(part) for part in state[1:]))
        self.moving = driven.DriveMemory(
            *(loop.q.copy(), loop.v.copy(), np.array(started.torque), np.array(started.pending))
        )
        form: Any = law._form
        log = driven.driven_log(self.channels)
        encoders = loop.controller
        count = encoders.resolution if isinstance(encoders, QuantizedEncoders) else None
        plant = drive_tables(engine, loop.h, count, _target(law))
        self.fixed = form.tables, plant
        self.rest = (
            *(tick.tick_space(nq, nv), driven.drive_space(nq, nv), tick.tick_output(nq, nv)),
            log,
        )

    def result(self, on_tick: OnTick | None = None) -> SimulationResult | None:
        """Do all ticks, and return what they leave behind; None where the compiled tick refuses one.

        Args:
            on_tick: Called with (ticks done, ticks in all) after every block.

        Raises:
            DivergenceError: A joint left every sensible range.
            InputError: The reference or the environment is not what a controller takes.
        """
        ticks = self.loop.ticks
        for start in range(0, ticks + 1, BLOCK):
            block = range(start, min(start + BLOCK, ticks + 1))
            if not self._do(block):
                return None
            if on_tick is not None:
                on_tick(block.stop - 1, ticks)
        return self.loop.result(self.channels, ticks + 1)

    def _do(self, block: range) -> bool:
        """Do a block of ticks; False where the compiled tick refuses one."""
        from .compiled import driven  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled.loop import ReferenceSamples  # noqa: PLC0415

        loop, dt = self.loop, self.loop.controller.dt
        times = tick_times(block, dt)
        reference = _rows(sample(loop.controller.arm, loop.trajectory, times), len(block))
        at = (np.array(block)[:, None] * dt + np.arange(loop.substeps) * loop.h).ravel()
        environment = self.surroundings.driven(self.surroundings.sampled(at))
        clock = driven.DrivenClock(
            np.array([block.start, block.stop, loop.ticks, loop.substeps]),
            np.zeros(2, dtype=np.int64),
        )
        arguments = (
            *self.fixed, environment, ReferenceSamples(*reference), self.memory, self.moving,
            *self.rest, clock,
        )  # fmt: skip
        ending = driven.driven_rollout(*arguments)
        if ending == driven.DIVERGED:
            tick, joint = clock.outcome.tolist()
            raise loop.divergence(tick, joint, self.channels)
        return bool(ending == driven.FINISHED)


def _rows(reference: Reference, rows: int) -> Reference:
    """One row for each tick."""
    return Reference(
        *(np.ascontiguousarray(np.broadcast_to(part, (rows, part.shape[1]))) for part in reference)
    )


def _target(law: HardwareController) -> Array:
    """Diagonals of M_d, D_d and K_d, shape (3, nv)."""
    target: Any = law._filter  # an `ImpedanceFilter`: others have no tables
    return np.array([np.diag(matrix) for matrix in target.matrices])
