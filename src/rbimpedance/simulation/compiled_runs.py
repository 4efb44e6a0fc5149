"""The closed loop by compiled code, block of ticks by block: all of it, or what lies between Pinocchio's algorithms.

`closed_loop.run` specifies what both compute.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .._numba import warn_once
from ..control.backends import is_available
from ..control.controller import ImpedanceController
from ..control.errors import check_measurements
from ..control.protocol import Measured
from ..control.tick import NumpyTick
from ..exceptions import UnsupportedJointError
from ..interaction import Perfect
from ..trajectories import Reference
from .checkpoint import Checkpoint
from .closed_loop import SPEED_BOUND, ClosedLoop, OnTick, empty_channels
from .result import SimulationResult
from .sampling import sample, tick_times

if TYPE_CHECKING:
    from ..robot.compiled.tables import ArmTables
    from .compiled.loop import Between, Controlled
    from .compiled.world import World

STATES = 20
"""Random states at which a plant's compiled dynamics are compared with Pinocchio's."""


def run_compiled(
    loop: ClosedLoop, on_tick: OnTick | None, checkpoint: Checkpoint | None = None
) -> SimulationResult | None:
    """Run a closed loop by compiled code; None where it has no compiled form, which is logged, once.

    Raises:
        DivergenceError: A joint left every sensible range.
        InputError: The reference or the environment is not what a controller takes.
        ModelError: The compiled dynamics of an arm are not Pinocchio's.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    world = verified_world(loop, {}, STATES)
    if world is None:
        return None
    from .compiled.log import journal  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.world import desk  # noqa: PLC0415

    nq, nv, dt = loop.plant.nq, loop.plant.nv, loop.controller.dt
    channels, space = empty_channels(loop.ticks + 1, nq, nv), desk(nq, nv)
    book = journal(channels)
    tell = _ignore if on_tick is None else on_tick
    tell(0, loop.ticks)
    for block in blocks_to_do(loop, world, channels, checkpoint):
        times = tick_times(block, dt)
        reference = sample(loop.controller.arm, loop.trajectory, times)
        drive = world.surroundings.sampled(world.times(block))
        outcome = world.run(block, reference, drive, space, book)
        if outcome.ending == "diverged":
            raise loop.divergence(outcome.tick, outcome.joint, channels)
        if outcome.ending == "unsound":
            check_inputs(loop, world, reference, outcome.tick - block.start)
            return None
        tell(block.stop - 1, loop.ticks)
    return loop.result(channels, loop.ticks + 1)


def run_around_pinocchio(
    loop: ClosedLoop, on_tick: OnTick | None, checkpoint: Checkpoint | None = None
) -> SimulationResult | None:
    """Run a closed loop with kernels between Pinocchio's algorithms; None where it has no such form.

    Raises:
        DivergenceError: A joint left every sensible range.
        InputError: The reference or the environment is not what a controller takes.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    controller: Any = loop.controller
    if reason_against(loop) is not None or isinstance(controller._form, NumpyTick):
        return None
    if loop.integrator != "semi-implicit" or loop.friction_is_stiff():
        return None
    from ..robot.compiled.tables import (  # noqa: PLC0415 (Numba is loaded when needed)
        arm_tables,
        coordinate_tables,
    )
    from .compiled.environment import acts_at_frames  # noqa: PLC0415
    from .compiled.world import controlled  # noqa: PLC0415

    loop = replace(loop, plant=loop.plant.copy())
    known = controlled(controller, coordinate_tables(controller.arm))
    read = arm_tables if acts_at_frames(loop.environment) else coordinate_tables
    try:
        world = new_world(loop, known, read(loop.plant))
    except UnsupportedJointError:
        return None
    return _AroundPinocchio(loop, world).run(on_tick, checkpoint)


class _AroundPinocchio:
    """One run."""

    def __init__(self, loop: ClosedLoop, world: World) -> None:
        from .compiled.log import journal  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled.world import desk  # noqa: PLC0415

        self.loop, self.world = loop, world
        nq, nv = loop.plant.nq, loop.plant.nv
        self.channels, self.desk = empty_channels(loop.ticks + 1, nq, nv), desk(nq, nv)
        self.journal = journal(self.channels)
        controller: Any = loop.controller
        self.tick, self.own = controller._form.in_place(world.memory.motion.tau)

    def run(self, on_tick: OnTick | None, checkpoint: Checkpoint | None) -> SimulationResult | None:
        """Run it; None where the compiled tick refuses inputs that the readable one takes."""
        loop, world = self.loop, self.world
        for block in blocks_to_do(loop, world, self.channels, checkpoint):
            times = tick_times(block, loop.controller.dt)
            reference = sample(loop.controller.arm, loop.trajectory, times)
            drive = world.surroundings.sampled(world.times(block))
            between = world.between(block, reference, drive, self.desk, self.journal)
            refused = self._run_block(block, between, on_tick)
            if refused is not None:
                check_inputs(loop, world, reference, refused - block.start)
                return None
        return loop.result(self.channels, loop.ticks + 1)

    def _run_block(self, block: range, between: Between, on_tick: OnTick | None) -> int | None:
        """Run a block of ticks; return the one whose inputs are refused."""
        from .._numba.layouts.tables import hold  # noqa: PLC0415
        from .compiled.loop import GOES_ON, loop_kernels  # noqa: PLC0415

        begin, act, move = loop_kernels(between)
        held, desk, (q, v, _, _, tau_ext) = hold(between), between.desk, between.motion
        tick, own, memory = self.tick, self.own, between.block
        aba, torque = self.loop.plant.raw_dynamics.aba, between.torque
        reference, substeps = Reference(desk.q_d, desk.v_d, desk.a_d), range(self.loop.substeps)
        begin(held)
        for k in block:
            if not tick(own, memory, q, v, reference, tau_ext):
                return k
            act(held)
            for i in substeps:
                joint = move(held, aba(q, v, torque), k, i)
                if joint != GOES_ON:
                    raise self.loop.divergence(k, joint, self.channels)
                if k == self.loop.ticks:
                    break
            if on_tick is not None:
                on_tick(k, self.loop.ticks)
        return None


def blocks_to_do(
    loop: ClosedLoop, world: World, channels: dict[str, Any], checkpoint: Checkpoint | None
) -> Iterable[range]:
    """Return the blocks of ticks of a run, or those that its checkpoint leaves to do.

    Args:
        loop: The loop.
        world: Its compiled form.
        channels: The log.
        checkpoint: Where the run keeps what it has so far; None for nowhere.
    """
    blocks, memory = world.settings.blocks(), world.memory
    if checkpoint is None:
        return blocks
    arrays = (*memory.motion, memory.even, memory.odd)
    return checkpoint.blocks(blocks, arrays, channels, loop.fingerprint())


def _ignore(done: int, ticks: int) -> None:
    del done, ticks


def verified_world(loop: ClosedLoop, known: dict[int, Controlled], states: int) -> World | None:
    """Return a loop in compiled form; None where it has none, which is logged, once.

    Args:
        loop: The loop.
        known: Compiled controllers by the identity of the controller, to be used and added to.
        states: Number of random states at which the plant's dynamics are compared with Pinocchio's.

    Raises:
        ModelError: The compiled dynamics of an arm are not Pinocchio's.
    """
    if isinstance(loop.controller, ImpedanceController) and loop.controller.backend == "numpy":
        return None
    if not is_available("rollout"):
        return None
    from ..robot.compiled.dynamics import CompiledDynamics  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.world import controlled  # noqa: PLC0415

    reason = reason_against(loop)
    try:
        if reason is None:
            controller: Any = loop.controller
            key = id(controller)
            if key not in known:
                known[key] = controlled(controller, CompiledDynamics(controller.arm).tables)
            return new_world(loop, known[key], CompiledDynamics(loop.plant, states).tables)
    except UnsupportedJointError as error:
        reason = f"'{loop.plant.name}': {error}"
    warn_once(f"the run is left to Python and Pinocchio for {reason}")
    return None


def reason_against(loop: ClosedLoop) -> str | None:
    """Return the name of a part of a loop without a compiled form, or None; arms are checked by the tables."""
    if loop.engine is not None:
        return f"its {type(loop.engine).__name__}"
    for part, kind in ((loop.controller, ImpedanceController), (loop.sensor, Perfect)):
        if type(part) is not kind:
            return f"its {type(part).__name__}"
    from .compiled.world import reason_against_parts  # noqa: PLC0415

    return reason_against_parts(loop.controller, loop.environment)


def new_world(loop: ClosedLoop, controller: Controlled, plant: ArmTables) -> World:
    """Return a loop in compiled form.

    Args:
        loop: One that there is no `reason_against`.
        controller: Its controller, compiled.
        plant: Tables of its plant.

    Raises:
        ParameterError: The Runge-Kutta method cannot take friction as stiff as the plant's.
        InputError: The environment does not fit the arm.
        ModelError: It acts at a frame that the arm does not have.
    """
    from .compiled.world import Settings, World  # noqa: PLC0415

    loop.environment.torque(loop.plant, 0.0, loop.q, loop.v)  # refuses what does not fit the arm
    integrator: Any = "stiff" if loop.friction_is_stiff() else loop.integrator
    settings = Settings(loop.ticks, loop.substeps, integrator, SPEED_BOUND)
    q, v = loop.q.copy(), loop.v.copy()
    return World(controller, loop.plant, plant, loop.environment, q, v, settings, loop.stops)


def check_inputs(loop: ClosedLoop, world: World, reference: Reference, i: int) -> None:
    """Raise the error of the inputs that the compiled tick has refused.

    Args:
        loop: The loop.
        world: Its compiled form, at that tick.
        reference: Of the block.
        i: Which of its ticks it was.

    Raises:
        InputError: What is wrong with them, if the readable tick refuses them, too.
    """
    motion = world.memory.motion
    told = Reference(*(rows[min(i, len(rows) - 1)] for rows in reference))
    given = Measured(motion.q, motion.v, told, motion.tau_ext)
    check_measurements(loop.controller.arm, given)
