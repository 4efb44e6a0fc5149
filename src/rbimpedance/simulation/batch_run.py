"""The runs behind `simulate_batch`: compiled worlds in threads, the others one after the other in Python."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import Array
from ..exceptions import DivergenceError, ParameterError
from .closed_loop import ClosedLoop, empty_channels, run
from .compiled_runs import check_inputs, verified_world
from .driven_runs import DrivenRun, driven_run, has_driven_form
from .result import SETTLING_TOLERANCES, SimulationResult
from .sampling import sample, tick_times

if TYPE_CHECKING:
    from ..trajectories import Reference
    from .compiled.environment import Drive
    from .compiled.log import MetricSums
    from .compiled.loop import Controlled
    from .compiled.world import World

METRICS = (
    *(f"{name}_{kind}" for name in ("e1", "e2", "e_im") for kind in ("max", "rms")),
    *(f"settling_1e{round(np.log10(tolerance))}" for tolerance in SETTLING_TOLERANCES),
    "tau_peak",
    "tau_variation",
)
"""Figures of `SimulationResult.metrics` that a batch keeps up to date."""

_PORTIONS = 8  # in which each thread gets its worlds, so that none waits long for the others
_STATES = 2  # at which each plant is compared with Pinocchio's; the controllers' arms at all


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchLog:
    """What the worlds leave behind; see `BatchResult`.

    Attributes:
        every: Ticks from one sample to the next.
        channels: Samples by channel, shape (N, samples, nq or nv).
        metrics: MetricSums of merit, each of shape (N, nv).
        q: Configuration at the end, shape (N, nq).
        v: Velocity at the end, shape (N, nv).
        divergence: Tick and joint of the worlds that diverged.
    """

    every: int
    channels: dict[str, Array]
    metrics: dict[str, Array]
    q: Array
    v: Array
    divergence: dict[int, tuple[int, str]] = field(default_factory=dict)

    def end_early(self, i: int, tick: int, joint: str) -> None:
        """Mark a world that has diverged in the period after a tick."""
        self.divergence[i] = tick, joint
        for channel in self.channels.values():
            channel[i, tick // self.every + 1 :] = False if channel.dtype == np.bool_ else np.nan


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
    driven = [i for i, loop in enumerate(loops) if has_driven_form(loop)]
    known: dict[int, Controlled] = {}
    worlds = {
        i: verified_world(loop, known, _STATES) for i, loop in enumerate(loops) if i not in driven
    }
    compiled = {i: world for i, world in worlds.items() if world is not None}
    left = [i for i, world in worlds.items() if world is None]
    if compiled:
        left += _Threads(loops, compiled, log, after).run(min(threads, len(compiled)))
    if driven:
        left += _run_on_drives(loops, driven, log, after, threads)
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


def _run_on_drives(
    loops: list[ClosedLoop],
    driven: Sequence[int],
    log: BatchLog,
    after: float | None,
    threads: int,
) -> list[int]:
    """Run worlds on drives, as many at once as there are threads; return those that are left to the readable form."""
    refused: list[int] = []
    with ThreadPoolExecutor(threads) as pool:
        for start in range(0, len(driven), threads):
            some = driven[start : start + threads]
            runs = [driven_run(loops[i]) for i in some]  # not in threads: they may share an arm
            for i, outcome in zip(some, pool.map(_driven_outcome, runs), strict=True):
                if outcome is None:
                    refused.append(i)
                else:
                    _keep(i, outcome, log, after)
    return refused


def _driven_outcome(run: DrivenRun | None) -> SimulationResult | DivergenceError | None:
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


class _Threads:
    """The worlds that have a compiled form, run block of ticks by block, each block by all threads."""

    def __init__(
        self,
        loops: list[ClosedLoop],
        worlds: Mapping[int, World],
        log: BatchLog,
        after: float | None,
    ) -> None:
        from .compiled.log import empty_figures  # noqa: PLC0415 (Numba is loaded when needed)

        self.loops, self.worlds, self.log = loops, worlds, log
        self.unsound: list[int] = []
        self.figures: dict[int, MetricSums] = {}
        if after is not None:
            first, tolerances = _first_tick(after, loops[0]), np.array(SETTLING_TOLERANCES)
            nv = loops[0].plant.nv
            self.figures = {i: empty_figures(nv, tolerances, first) for i in worlds}
        users = Counter(id(x) for i in worlds for x in (loops[i].trajectory, loops[i].environment))
        self.shared = {identity for identity, count in users.items() if count > 1}

    def run(self, threads: int) -> list[int]:
        """Run them; return those that are left to the readable form."""
        settings = next(iter(self.worlds.values())).settings
        with ThreadPoolExecutor(threads) as pool:
            for block in settings.blocks():
                going = [i for i in self.worlds if self._goes_on(i)]
                samples = self._shared_samples(block, going)
                portions = [going[k :: threads * _PORTIONS] for k in range(threads * _PORTIONS)]
                tasks = [pool.submit(self._run_portion, block, x, samples) for x in portions if x]
                for task in tasks:
                    task.result()
        for i, world in self.worlds.items():
            self.log.q[i], self.log.v[i] = world.memory.motion.q, world.memory.motion.v
            if i in self.figures and self._goes_on(i):
                self._put_metrics(i, settings.ticks)
        return self.unsound

    def _goes_on(self, i: int) -> bool:
        return i not in self.log.divergence and i not in self.unsound

    def _shared_samples(self, block: range, going: list[int]) -> dict[int, Any]:
        """References and drives that several worlds share, by identity of trajectory and environment."""
        samples: dict[int, Any] = {}
        for i in going:
            loop = self.loops[i]
            parts = (loop.trajectory, self._reference), (loop.environment, self._drive)
            for part, sampled in parts:
                if id(part) in self.shared and id(part) not in samples:
                    samples[id(part)] = sampled(i, block)
        return samples

    def _reference(self, i: int, block: range) -> Reference:
        loop = self.loops[i]
        times = tick_times(block, loop.controller.dt)
        return sample(loop.controller.arm, loop.trajectory, times)

    def _drive(self, i: int, block: range) -> Drive:
        world = self.worlds[i]
        return world.surroundings.sampled(world.times(block))

    def _run_portion(self, block: range, portion: list[int], samples: dict[int, Any]) -> None:
        """Run some worlds, in one thread."""
        from .compiled.log import journal  # noqa: PLC0415
        from .compiled.world import Block, desk  # noqa: PLC0415

        log, plant = self.log, self.loops[portion[0]].plant
        space = desk(plant.nq, plant.nv)
        for i in portion:
            loop, world = self.loops[i], self.worlds[i]
            reference = samples.get(id(loop.trajectory)) or self._reference(i, block)
            drive = samples.get(id(loop.environment)) or self._drive(i, block)
            book = journal({name: x[i] for name, x in log.channels.items()}, log.every)
            outcome = world.run(Block(block, reference, drive, space, book, self.figures.get(i)))
            if outcome.ending == "diverged":
                log.end_early(i, outcome.tick, loop.plant.joint_names[outcome.joint])
            elif outcome.ending == "unsound":
                check_inputs(loop, world, reference, outcome.tick - block.start)
                self.unsound.append(i)

    def _put_metrics(self, i: int, ticks: int) -> None:
        from .compiled.log import figures_of_merit  # noqa: PLC0415

        merits = figures_of_merit(self.figures[i], ticks, self.loops[i].controller.dt)
        for name, figure in zip(METRICS, merits, strict=True):
            self.log.metrics[name][i] = figure
