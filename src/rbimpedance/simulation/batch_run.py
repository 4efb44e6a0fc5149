"""The runs behind `simulate_batch`: compiled worlds in threads, the others one after the other in Python."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from ..exceptions import DivergenceError, ParameterError
from .batch_log import BatchLog
from .closed_loop import ClosedLoop, empty_channels, run
from .compiled_runs import verified_world
from .driven_runs import DrivenRun, driven_run, has_driven_form
from .imperfect_runs import ImperfectRun, has_imperfect_form
from .result import SETTLING_TOLERANCES, SimulationResult

if TYPE_CHECKING:
    from .compiled.loop import Controlled

METRICS = (
    *(f"{name}_{kind}" for name in ("e1", "e2", "e_im") for kind in ("max", "rms")),
    *(f"settling_1e{round(np.log10(tolerance))}" for tolerance in SETTLING_TOLERANCES),
    "tau_peak",
    "tau_variation",
)
"""Figures of `SimulationResult.metrics` that a batch keeps up to date."""

_STATES = 1  # at which each plant is compared with Pinocchio's; the controllers' arms at all


def run_worlds(
    loops: list[ClosedLoop],
    channels: tuple[str, ...],
    every: int,
    after: float | None,
    threads: int,
) -> BatchLog:
    """Run all worlds.

    Args:
        loops: The worlds, alike in size and period.
        channels: What to log.
        every: Ticks from one sample to the next.
        after: When the figures of merit begin [s]; None where they are not wanted.
        threads: How many to use.

    Raises:
        ParameterError: Fewer than two samples remain for the figures of merit.
        InputError: A reference or an environment is not what a controller takes.
    """
    plant, n = loops[0].plant, len(loops)
    samples = empty_channels(n * (loops[0].ticks // every + 1), plant.nq, plant.nv, channels)
    log = BatchLog(
        every=every,
        channels={name: x.reshape(n, -1, x.shape[1]) for name, x in samples.items()},
        metrics={} if after is None else {x: np.full((n, plant.nv), np.nan) for x in METRICS},
        q=np.empty((n, plant.nq)),
        v=np.empty((n, plant.nv)),
    )
    if after is not None:
        _first_tick(after, loops[0])
    driven = [
        i for i, loop in enumerate(loops) if has_driven_form(loop) or has_imperfect_form(loop)
    ]
    known: dict[int, Controlled] = {}
    worlds = {
        i: verified_world(loop, known, _STATES) for i, loop in enumerate(loops) if i not in driven
    }
    compiled = {i: world for i, world in worlds.items() if world is not None}
    left = [i for i, world in worlds.items() if world is None]
    if compiled:
        from .compiled.batch import CompiledWorlds  # noqa: PLC0415 (Numba is loaded when needed)

        first = None if after is None else _first_tick(after, loops[0])
        left += CompiledWorlds(loops, compiled, log, first).run(threads)
    if driven:
        left += _run_around_laws(loops, driven, log, after, threads)
    for i in left:
        _keep(i, _outcome(loops[i]), log, after)
    return log


def _first_tick(after: float, loop: ClosedLoop) -> int:
    """The first tick that enters the figures of merit."""
    dt, end = loop.controller.dt, loop.ticks * loop.controller.dt
    if not after <= (loop.ticks - 1) * dt:
        raise ParameterError("after", after, f"before the last two samples, below {end:g} s")
    first = max(0, int(after / dt) - 1)
    while first * dt < after:
        first += 1
    return first


def _run_around_laws(
    loops: list[ClosedLoop],
    driven: Sequence[int],
    log: BatchLog,
    after: float | None,
    threads: int,
) -> list[int]:
    """Run worlds whose law is behind drives or sensors, as many at once as there are threads.

    Returns:
        Those that are left to the readable form.
    """
    refused: list[int] = []
    known: dict[int, Controlled] = {}
    with ThreadPoolExecutor(threads) as pool:
        for start in range(0, len(driven), threads):
            some = driven[start : start + threads]
            runs = [
                _fast_run(loops[i], known) for i in some
            ]  # not in threads: they may share an arm
            for i, outcome in zip(some, pool.map(_fast_outcome, runs), strict=True):
                if outcome is None:
                    refused.append(i)
                else:
                    _keep(i, outcome, log, after)
    return refused


def _fast_run(loop: ClosedLoop, known: dict[int, Controlled]) -> DrivenRun | ImperfectRun | None:
    return ImperfectRun(loop, known, _STATES) if has_imperfect_form(loop) else driven_run(loop)


def _fast_outcome(
    run: DrivenRun | ImperfectRun | None,
) -> SimulationResult | DivergenceError | None:
    try:
        return None if run is None else run.result()
    except DivergenceError as error:
        return error


def _outcome(loop: ClosedLoop) -> SimulationResult | DivergenceError:
    """What Python makes of a world."""
    try:
        return run(loop)
    except DivergenceError as error:
        return error


def _keep(
    i: int, outcome: SimulationResult | DivergenceError, log: BatchLog, after: float | None
) -> None:
    """Put the outcome of a world into the log."""
    result = outcome.result if isinstance(outcome, DivergenceError) else outcome
    if isinstance(outcome, DivergenceError):
        log.end_early(i, len(result.t) - 1, outcome.joint)
    for name, channel in log.channels.items():
        samples = getattr(result, name)[:: log.every]
        channel[i, : len(samples)] = samples
    log.q[i], log.v[i] = result.q[-1], result.v[-1]
    if after is not None and i not in log.divergence:
        figures = result.metrics(after=after)
        for name, rows in log.metrics.items():
            rows[i] = figures[name]
