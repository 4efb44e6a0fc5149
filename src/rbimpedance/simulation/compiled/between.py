"""The parts of the closed loop that lie between Pinocchio's algorithms, which only Python can call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from ..._common.arrays import Array
from ..._numba.compile import fused, kernel
from ..._numba.layouts.tables import Held, opened
from ...robot.compiled.dynamics import VECTOR_IN
from .environment import Environment
from .log import LogArrays, MetricSums
from .loop import (
    END,
    FIRST,
    LAST,
    SUBSTEPS,
    Clock,
    Controlled,
    LoopWorkspace,
    ReferenceSamples,
    own_type,
    record,
    runaway,
    take_reference,
)
from .plant import PlantMotion, PlantTables, acting_torque, euler_step, update_tau_ext

GOES_ON = -1
"""What `move` returns; else the joint that left every range."""


class Between(NamedTuple):
    """Everything that the kernels read and write in a block of ticks.

    Attributes:
        controlled: The controller.
        plant: The simulated arm.
        environment: What pushes.
        wish: The reference.
        motion: Of the plant.
        desk: Work space, with the reference of the tick at hand.
        clock: Which ticks, and how.
        journal: Where the channels go.
        figures: Where the figures of merit go.
        block: Of the controller's tick.
        torque: What forward dynamics are to take, friction and stops in it, shape (nv,).
    """

    controlled: Controlled
    plant: PlantTables
    environment: Environment
    wish: ReferenceSamples
    motion: PlantMotion
    desk: LoopWorkspace
    clock: Clock
    journal: LogArrays
    figures: MetricSums
    block: Array
    torque: Array


class LoopKernels(NamedTuple):
    """Compiled entry points, each called with what `hold` makes of a `Between`.

    Attributes:
        begin: Writes what the first tick of a block is to see.
        act: Writes the sum of the torques after a tick.
        move: With the acceleration, tick and physics step: logs, takes the step, and writes what comes next.
    """

    begin: Callable[..., Any]
    act: Callable[..., Any]
    move: Callable[..., Any]


_LOOP_KERNELS: list[LoopKernels] = []


def loop_kernels(between: Between) -> LoopKernels:
    """Compile the entry points, or load them from the disk.

    Args:
        between: An example of what they take.
    """
    if not _LOOP_KERNELS:
        held = Held(own_type(between))
        _LOOP_KERNELS.append(
            LoopKernels(
                kernel(_begin, (held,)),
                kernel(_act, (held,)),
                kernel(_move, (held, VECTOR_IN, types.int64, types.int64)),
            )
        )
    return _LOOP_KERNELS[0]


def _begin(held: Any) -> int:
    _look(opened(held), 0, 0)
    return 0


def _act(held: Any) -> int:
    _sum_torques(opened(held))
    return 0


def _move(held: Any, a: Array, k: int, i: int) -> int:
    loop = opened(held)
    motion, ticks = loop.motion, loop.clock.ticks
    for j in range(len(a)):
        motion.a[j] = a[j]
    if i == 0:
        record(loop.controlled, loop.desk, motion, k, loop.block, loop.journal, loop.figures)
    if k == ticks[LAST]:
        return GOES_ON
    euler_step(loop.plant, motion, loop.clock.step[0])
    joint = runaway(motion.v, loop.clock.step[1])
    if joint >= 0:
        return joint
    if i + 1 < ticks[SUBSTEPS]:
        _look(loop, k - ticks[FIRST], i + 1)
        _sum_torques(loop)
    elif k + 1 < ticks[END]:
        _look(loop, k + 1 - ticks[FIRST], 0)
    return GOES_ON


@fused
def _look(loop: Between, k: int, i: int) -> None:
    """Write what pushes at a physics step, and the reference if it is the first of a tick."""
    row = k * loop.clock.ticks[SUBSTEPS] + i
    update_tau_ext(loop.plant, loop.desk.plant, loop.environment, row, loop.motion.q, loop.motion)
    if i == 0:
        take_reference(loop.wish, k, loop.desk)


@fused
def _sum_torques(loop: Between) -> None:
    for j in range(len(loop.torque)):
        loop.torque[j] = acting_torque(loop.plant, loop.motion, j)
