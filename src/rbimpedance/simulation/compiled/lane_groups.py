"""Worlds that are alike, in lanes: which they are, and how a block of ticks of eight is run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.lanes import WIDTH
from ..._numba.layouts.lane_arrays import lane_array
from ...control.compiled.block import BIT_OF, FLAGS, Q_R
from ...control.compiled.law import FULL, KNOWLEDGE, REACHING, SURFACE
from ...control.compiled.pack import lane_addresses
from ...robot.compiled.tables import CONTINUOUS, KIND
from ...trajectories import Reference
from .environment import Drive
from .lane_loop import (
    ALONE,
    LEFT,
    LOG_E_IM,
    LOG_Q,
    LOG_TAU_EXT,
    LOG_V,
    LaneLog,
    lane_rollout,
    put_lane,
    stacked,
)
from .log import COLUMN_OF, MetricSums, no_figures
from .loop import JOINT, TICK, ReferenceSamples
from .world import Settings, World, desk

LEAST = 4
"""Fewer worlds that are alike are run one by one."""

_COLUMNS = {
    **COLUMN_OF,
    **{"q": LOG_Q, "v": LOG_V, "e_im": LOG_E_IM, "tau_ext": LOG_TAU_EXT, "q_r": Q_R},
}


class LaneMember(NamedTuple):
    """A world of a group, in a block of ticks.

    Attributes:
        world: The world.
        reference: Desired motion, as for `World.run`.
        drive: What of the environment depends on time.
        channels: Where its samples go, by channel.
        figures: Where its figures of merit go; None where they are not wanted.
    """

    world: World
    reference: Reference
    drive: Drive
    channels: Mapping[str, Array]
    figures: MetricSums | None


class LaneKind(NamedTuple):
    """What worlds have in common that may share lanes.

    Attributes:
        settings: How the plant is stepped.
        topology: Of both arms.
        contacts: Where the environment acts, and how.
        choices: Surface, reaching law and filter.
        addresses: Their loops in lanes, see `lane_addresses`.
        shapes: Of tables.
    """

    settings: Settings
    topology: bytes
    contacts: bytes
    choices: bytes
    addresses: tuple[int, int]
    shapes: tuple[Any, ...]


def lane_kind(world: World, controller: Any) -> LaneKind | None:
    """Return what worlds have in common that may share lanes; None for one that has to run alone.

    Args:
        world: The world.
        controller: Its `ImpedanceController`.
    """
    arm, law, target = world.controlled
    topology, plant = arm.topology, world.plant
    if world.has_parts or world.settings.integrator == "rk4" or law.choices[0, KNOWLEDGE] != FULL:
        return None
    if (topology[:, KIND] == CONTINUOUS).any() or (topology != plant.arm.topology).any():
        return None
    addresses = lane_addresses(controller.surface, controller.reaching)
    if addresses is None:
        return None
    return LaneKind(
        settings=world.settings,
        topology=topology.tobytes(),
        contacts=world.surroundings.contacts.tobytes(),
        choices=law.choices.tobytes(),
        addresses=addresses,
        shapes=(law.filter.shape, target.shape, plant.stops.shape),
    )


class LaneGroup:
    """Up to eight worlds that are alike, in lanes.

    Args:
        worlds: The worlds.
        addresses: Loops of their surface and reaching law, see `lane_addresses`.
    """

    def __init__(self, worlds: Sequence[World], addresses: tuple[int, int]) -> None:
        controlled = stacked(_eight([world.controlled for world in worlds]))
        choices = controlled.law.choices.copy()
        choices[0, SURFACE], choices[0, REACHING] = addresses
        self._controlled = controlled._replace(law=controlled.law._replace(choices=choices))
        self._plant = stacked(_eight([world.plant for world in worlds]))

    def run(
        self,
        block: range,
        members: Sequence[LaneMember],
        space: Any,
        shared: dict[int, ReferenceSamples],
        every: int,
    ) -> Array:
        """Do a block of ticks, without the interpreter's lock.

        Args:
            block: The ticks.
            members: The worlds, in their order.
            space: Work space from `lane_desk`.
            shared: References in lanes that groups share in this block, by identity; added to.
            every: Ticks from one sample to the next.

        Returns:
            Tick and joint at which each world ended early, shape (2, 8); the tick is -1 where it did not, the joint
            `ALONE` where the world has to continue alone from that tick.
        """
        eight = _eight(members)
        first = eight[0].world
        environments = [x.world.surroundings.driven(x.drive) for x in eight]
        memory = stacked([x.world.memory for x in eight])
        log = _lane_log(members[0].channels, block, every, len(first.memory.motion.v))
        figures = stacked([x.figures or no_figures() for x in eight])
        clock, ended = first.clock(block), lane_array(2)
        clock.outcome[TICK], ended[:] = block.start, -1.0
        ended[TICK, len(members) :] = block.start
        arguments = (
            self._controlled, self._plant, stacked(environments),
            _references(eight, shared),
            memory, space, clock, log, figures, ended,
        )  # fmt: skip
        known = ended[TICK] >= 0.0
        while lane_rollout(*arguments) == LEFT:
            self._put_back(members, (ended[TICK] >= 0.0) & ~known, memory, figures)
            known = ended[TICK] >= 0.0
        self._put_back(members, ~known, memory, figures)
        _put_samples(log, block, members, ended)
        return ended

    def _put_back(
        self, members: Sequence[LaneMember], lanes: NDArray[np.bool_], memory: Any, figures: Any
    ) -> None:
        for i in np.flatnonzero(lanes[: len(members)]).tolist():
            world, own = members[i].world, members[i].figures
            put_lane(memory, i, world.memory)
            if own is not None:
                put_lane(figures.table, i, own.table)


def lane_desk(nq: int, nv: int) -> Any:
    """Return work space of a group of arms of this size; nothing in it outlives a tick."""
    own = desk(nq, nv)
    placed = own.plant._replace(**{x: np.zeros(nv) for x in ("position", "cos", "sin")})
    lanes = stacked([own._replace(plant=placed)] * WIDTH)
    return lanes._replace(control=lanes.plant)


def _references(
    eight: Sequence[LaneMember], shared: dict[int, ReferenceSamples]
) -> ReferenceSamples:
    """Desired motions in lanes; one that all eight share is put into lanes once for all groups."""
    first = eight[0].reference
    if any(x.reference is not first for x in eight):
        return stacked([ReferenceSamples(*x.reference) for x in eight])  # type: ignore[no-any-return]
    if id(first) not in shared:
        shared[id(first)] = ReferenceSamples(*map(_repeated, first))
    return shared[id(first)]


def _repeated(rows: Array) -> Array:
    lanes = lane_array(*rows.shape)
    lanes[...] = rows[..., None]
    return lanes


def _eight(parts: Sequence[Any]) -> list[Any]:
    """The parts, and the first once more for each lane that is left."""
    return [*parts, *[parts[0]] * (WIDTH - len(parts))]


def _lane_log(channels: Mapping[str, Array], block: range, every: int, nv: int) -> LaneLog:
    """Room for the samples of a block."""
    columns = np.array([_COLUMNS.get(name, FLAGS) for name in channels], dtype=np.int64)
    first = -(-block.start // every)
    samples = -(-block.stop // every) - first
    return LaneLog(lane_array(samples * len(columns), nv), columns, np.array([every, first]))


def _put_samples(log: LaneLog, block: range, members: Sequence[LaneMember], ended: Array) -> None:
    """Write the samples of a block to the channels of the worlds."""
    if len(log.columns) == 0:
        return
    every, first = log.every.tolist()
    samples = log.samples.reshape(-1, len(log.columns), *log.samples.shape[1:])
    for i, member in enumerate(members):
        is_alone = ended[TICK, i] >= 0.0 and ended[JOINT, i] == ALONE
        stop = int(ended[TICK, i]) if is_alone else block.stop
        rows = slice(first, -(-stop // every))
        for c, (name, channel) in enumerate(member.channels.items()):
            values = samples[: rows.stop - rows.start, c, :, i]
            if channel.dtype == np.bool_:
                values = values.astype(np.int64) & BIT_OF.get(name, 0) != 0
            channel[rows] = values
