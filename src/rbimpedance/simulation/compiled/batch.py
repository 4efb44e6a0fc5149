"""The worlds of a batch that have a compiled form, in threads: those that are alike eight at once, the others alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from ..._numba.lanes import WIDTH
from ...trajectories import Reference
from ..batch_log import BatchLog
from ..closed_loop import ClosedLoop
from ..compiled_runs import check_inputs
from ..result import SETTLING_TOLERANCES
from ..sampling import sample, tick_times
from .environment import Drive
from .lane_groups import LEAST, LaneGroup, LaneMember, lane_desk, lane_kind
from .lane_loop import ALONE
from .log import MetricSums, empty_figures, figures_of_merit, journal
from .loop import JOINT, TICK, LoopWorkspace, ReferenceSamples
from .world import Block, World, desk

_PORTIONS = 8  # in which each thread gets its worlds, so that none waits long for the others


class CompiledWorlds:
    """The worlds, run block of ticks by block, each block by all threads.

    Args:
        loops: All loops of the batch.
        worlds: The compiled form of those that have one, by their number.
        log: Where samples and figures go.
        first: First tick that enters the figures of merit; None where they are not wanted.
    """

    def __init__(
        self,
        loops: Sequence[ClosedLoop],
        worlds: Mapping[int, World],
        log: BatchLog,
        first: int | None,
    ) -> None:
        self.loops, self.worlds, self.log = loops, worlds, log
        self.unsound: list[int] = []
        self.figures: dict[int, MetricSums] = {}
        if first is not None:
            nv, tolerances = loops[0].plant.nv, np.array(SETTLING_TOLERANCES)
            self.figures = {i: empty_figures(nv, tolerances, first) for i in worlds}
        users = Counter(id(x) for i in worlds for x in (loops[i].trajectory, loops[i].environment))
        self.shared = {identity for identity, count in users.items() if count > 1}
        kinds = {i: lane_kind(world, loops[i].controller) for i, world in worlds.items()}
        self.kinds = {i: kind for i, kind in kinds.items() if kind is not None}
        self.groups: dict[tuple[int, ...], LaneGroup] = {}
        self.spaces: list[tuple[LoopWorkspace, LoopWorkspace]] = []

    def run(self, threads: int) -> list[int]:
        """Run them; return those that are left to the readable form."""
        settings = next(iter(self.worlds.values())).settings
        with ThreadPoolExecutor(threads) as pool:
            for block in settings.blocks():
                going = [i for i in self.worlds if self._goes_on(i)]
                samples = self._shared_samples(block, going)
                units = self._units(going)
                portions = [units[k :: threads * _PORTIONS] for k in range(threads * _PORTIONS)]
                work = partial(self._run_portion, block, samples, {})
                tasks = [pool.submit(work, portion) for portion in portions if portion]
                for task in tasks:
                    task.result()
        for i, world in self.worlds.items():
            self.log.q[i], self.log.v[i] = world.memory.motion.q, world.memory.motion.v
            if i in self.figures and self._goes_on(i):
                merits = figures_of_merit(self.figures[i], settings.ticks, world.dt)
                for rows, figure in zip(self.log.metrics.values(), merits, strict=True):
                    rows[i] = figure
        return self.unsound

    def _goes_on(self, i: int) -> bool:
        return i not in self.log.divergence and i not in self.unsound

    def _units(self, going: Sequence[int]) -> list[tuple[int, ...]]:
        """The worlds in groups of up to eight that are alike, and one by one."""
        alike: dict[Any, list[int]] = {}
        for i in going:
            alike.setdefault(self.kinds.get(i), []).append(i)
        units: list[tuple[int, ...]] = [(i,) for i in alike.pop(None, [])]
        for members in alike.values():
            for k in range(0, len(members), WIDTH):
                group = tuple(members[k : k + WIDTH])
                units += [group] if len(group) >= LEAST else [(i,) for i in group]
        return units

    def _shared_samples(self, block: range, going: Sequence[int]) -> dict[int, Any]:
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

    def _run_portion(
        self,
        block: range,
        samples: Mapping[int, Any],
        in_lanes: dict[int, ReferenceSamples],
        units: Sequence[tuple[int, ...]],
    ) -> None:
        """Run some worlds, in one thread; `in_lanes` are the references that its groups share with others."""
        try:  # in the end there is one for each thread
            alone, lanes = self.spaces.pop()
        except IndexError:
            plant = self.loops[units[0][0]].plant
            alone, lanes = desk(plant.nq, plant.nv), lane_desk(plant.nq, plant.nv)
        for unit in units:
            members = [self._member(i, block, samples) for i in unit]
            if len(unit) == 1:
                self._run_alone(unit[0], block, block.start, members[0], alone)
                continue
            ended = self._group(unit).run(block, members, lanes, in_lanes, self.log.every)
            for lane, i in enumerate(unit):
                tick, joint = int(ended[TICK, lane]), int(ended[JOINT, lane])
                if tick >= 0 and joint == ALONE:
                    self._run_alone(i, block, tick, members[lane], alone)
                elif tick >= 0:
                    self._end(i, tick, joint)
        self.spaces.append((alone, lanes))

    def _member(self, i: int, block: range, samples: Mapping[int, Any]) -> LaneMember:
        """A world, and what it needs in a block."""
        loop = self.loops[i]
        return LaneMember(
            world=self.worlds[i],
            reference=samples.get(id(loop.trajectory)) or self._reference(i, block),
            drive=samples.get(id(loop.environment)) or self._drive(i, block),
            channels={name: x[i] for name, x in self.log.channels.items()},
            figures=self.figures.get(i),
        )

    def _group(self, unit: tuple[int, ...]) -> LaneGroup:
        if unit not in self.groups:
            addresses = self.kinds[unit[0]].addresses
            self.groups[unit] = LaneGroup([self.worlds[i] for i in unit], addresses)
        return self.groups[unit]

    def _run_alone(self, i: int, block: range, tick: int, member: LaneMember, space: Any) -> None:
        """Run one world from a tick of a block to its end."""
        world, done = member.world, tick - block.start
        reference = Reference(*(_rest(rows, done) for rows in member.reference))
        steps = done * world.settings.substeps
        drive = Drive(*(_rest(rows, steps) for rows in member.drive))
        book = journal(member.channels, self.log.every)
        ticks = range(tick, block.stop)
        outcome = world.run(Block(ticks, reference, drive, space, book, member.figures))
        if outcome.ending == "diverged":
            self._end(i, outcome.tick, outcome.joint)
        elif outcome.ending == "unsound":
            check_inputs(self.loops[i], world, reference, outcome.tick - tick)
            self.unsound.append(i)

    def _end(self, i: int, tick: int, joint: int) -> None:
        self.log.end_early(i, tick, self.loops[i].plant.joint_names[joint])


def _rest(rows: Any, done: int) -> Any:
    """The rows from one on, where there is more than one for all."""
    return rows if len(rows) == 1 else rows[done:]
