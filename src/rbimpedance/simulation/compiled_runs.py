"""The closed loop by compiled code, block of ticks by block: all of it, or what lies between Pinocchio's algorithms.

`closed_loop.run` specifies what both compute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from .._numba import warn_once
from ..control.backends import is_available
from ..control.baseline_law import FormulaBaseline
from ..control.controller import ImpedanceController
from ..control.encoders import QuantizedEncoders
from ..control.errors import check_measurements
from ..control.imperfect import ImperfectController
from ..control.protocol import Measured
from ..control.tick import NumpyTick
from ..control.tool_view import ToolView
from ..exceptions import UnsupportedJointError
from ..interaction import Perfect
from ..interaction.estimators import MomentumObserver
from ..trajectories import Reference
from .checkpoint import Checkpoint
from .closed_loop import SPEED_BOUND, ClosedLoop, OnTick, empty_channels
from .plants import DrivenPlant
from .plants.rigid import RigidPlant
from .result import SimulationResult
from .sampling import sample, tick_times

if TYPE_CHECKING:
    from ..robot.compiled.tables import ArmTables
    from .compiled.loop import Controlled
    from .compiled.world import Block, Outcome, World

RunBlock: TypeAlias = "Callable[[Block], Outcome]"
"""Runs a block of ticks."""

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
    world = None if checkpoint and has_parts(loop) else verified_world(loop, {}, STATES)
    if world is None:
        return None
    if on_tick is not None:
        on_tick(0, loop.ticks)

    def run_block(block: Block) -> Outcome:
        outcome = world.run(block)
        if on_tick is not None and outcome.ending == "finished":
            on_tick(block.ticks.stop - 1, loop.ticks)
        return outcome

    return run_by_blocks(loop, world, run_block, checkpoint)


def run_around_pinocchio(
    loop: ClosedLoop, on_tick: OnTick | None, checkpoint: Checkpoint | None = None
) -> SimulationResult | None:
    """Run a closed loop with kernels between Pinocchio's algorithms; None where it has no such form.

    Its errors are those of `run_compiled`, but for the compiled dynamics.
    """
    controller: Any = loop.controller
    if has_parts(loop) or reason_against(loop) is not None:
        return None
    if isinstance(controller._form, NumpyTick):
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
    return run_by_blocks(loop, world, _around_pinocchio(loop, world, on_tick), checkpoint)


def _around_pinocchio(loop: ClosedLoop, world: World, on_tick: OnTick | None) -> RunBlock:
    """Return the function that runs a block of ticks by kernels between Pinocchio's algorithms."""
    from .._numba.layouts.tables import hold  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.between import GOES_ON, loop_kernels  # noqa: PLC0415
    from .compiled.world import Outcome  # noqa: PLC0415

    controller: Any = loop.controller
    tick, own = controller._form.in_place(world.memory.motion.tau)
    aba, substeps = loop.plant.raw_dynamics.aba, range(loop.substeps)

    def run_block(block: Block) -> Outcome:
        between = world.between(block)
        begin, act, move = loop_kernels(between)
        held, desk, (q, v, _, _, tau_ext) = hold(between), between.desk, between.motion
        memory, torque = between.block, between.torque
        reference = Reference(desk.q_d, desk.v_d, desk.a_d)
        begin(held)
        for k in block.ticks:
            if not tick(own, memory, q, v, reference, tau_ext):
                return Outcome("unsound", k, 0)
            act(held)
            for i in substeps:
                joint = move(held, aba(q, v, torque), k, i)
                if joint != GOES_ON:
                    return Outcome("diverged", k, joint)
                if k == loop.ticks:
                    break
            if on_tick is not None:
                on_tick(k, loop.ticks)
        return Outcome("finished", 0, 0)

    return run_block


def run_by_blocks(
    loop: ClosedLoop, world: World, run_block: RunBlock, checkpoint: Checkpoint | None
) -> SimulationResult | None:
    """Run a loop block of ticks by block; None where the compiled tick refuses inputs that the readable one takes."""
    from .compiled.log import journal  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.world import Block, desk  # noqa: PLC0415

    nq, nv = loop.plant.nq, loop.plant.nv
    channels, space = empty_channels(loop.ticks + 1, nq, nv), desk(nq, nv)
    book = journal(channels)
    blocks: Iterable[range] = world.settings.blocks()
    if checkpoint is not None:
        arrays = (*world.memory.motion, world.memory.even, world.memory.odd)
        blocks = checkpoint.blocks(blocks, arrays, channels, loop.fingerprint())
    for ticks in blocks:
        reference = sample(
            loop.controller.arm, loop.trajectory, tick_times(ticks, loop.controller.dt)
        )
        drive = world.surroundings.sampled(world.times(ticks))
        outcome = run_block(Block(ticks, reference, drive, space, book))
        if outcome.ending == "diverged":
            raise loop.divergence(outcome.tick, outcome.joint, channels)
        if outcome.ending == "unsound":
            check_inputs(loop, world, reference, outcome.tick - ticks.start)
            return None
    return loop.result(channels, loop.ticks + 1)


def verified_world(loop: ClosedLoop, known: dict[int, Controlled], states: int) -> World | None:
    """Return a loop in compiled form; None where it has none, which is logged, once, except for a law at the tool.

    Args:
        loop: The loop.
        known: Compiled controllers by the identity of the controller, to be used and added to.
        states: Number of random states at which the plant's dynamics are compared with Pinocchio's.

    Raises:
        ModelError: The compiled dynamics of an arm are not Pinocchio's.
    """
    if isinstance(loop.controller, ToolView):
        return None
    law: Any = law_of(loop)
    if isinstance(law, ImpedanceController) and law.backend == "numpy":
        return None
    if not is_available("rollout"):
        return None
    from ..robot.compiled.dynamics import CompiledDynamics  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.world import controlled  # noqa: PLC0415

    reason = reason_against(loop)
    try:
        if reason is None:
            if id(law) not in known:
                known[id(law)] = controlled(law, CompiledDynamics(law.arm).tables)
            return new_world(loop, known[id(law)], CompiledDynamics(loop.plant, states).tables)
    except UnsupportedJointError as error:
        reason = f"'{loop.plant.name}': {error}"
    warn_once(f"the run is left to Python and Pinocchio for {reason}")
    return None


def reason_against(loop: ClosedLoop) -> str | None:
    """Return the name of a part of a loop without a compiled form, or None; arms are checked by the tables."""
    controller, law, engine = loop.controller, law_of(loop), loop.engine
    if engine is not None and not _has_plain_drives(loop):
        return f"its {type(engine).__name__}"
    if not (
        type(law) is ImpedanceController
        or (isinstance(law, FormulaBaseline) and law.has_compiled_form)
    ):
        inside = controller.controller if isinstance(controller, ToolView) else controller
        return f"its {type(inside).__name__}"
    if law is not controller and not _has_unit_gain(controller):
        return f"its {type(controller).__name__} with torque constants"
    if type(loop.sensor) not in (Perfect, MomentumObserver):
        return f"its {type(loop.sensor).__name__}"
    if not is_available("rollout"):
        return "want of compiled code"
    from .compiled.world import reason_against_parts  # noqa: PLC0415

    return reason_against_parts(law, loop.environment)


def law_of(loop: ClosedLoop) -> Any:
    """Return the controller of a loop, or the one behind its encoders, or behind noise and delay."""
    controller: Any = loop.controller
    is_behind = type(controller) in (QuantizedEncoders, ImperfectController)
    return controller.controller if is_behind else controller


def has_parts(loop: ClosedLoop) -> bool:
    """Return whether a loop has instruments, drives, or a baseline: what Pinocchio's loop does not know."""
    is_plain = loop.engine is None and type(loop.sensor) is Perfect
    return not (is_plain and isinstance(loop.controller, ImpedanceController))


def _has_unit_gain(controller: Any) -> bool:
    return type(controller) is QuantizedEncoders or bool((controller.torque_constant == 1.0).all())


def _has_plain_drives(loop: ClosedLoop) -> bool:
    """Whether the engine is a `DrivenPlant` whose form is known: rigid links, no torque loop, no friction of rotors."""
    engine: Any = loop.engine
    if type(engine) is not DrivenPlant or type(engine.links) is not RigidPlant:
        return False
    plain = engine.torque_loop is None and engine.gear_friction is None
    return plain and engine.links.integrator == "semi-implicit" == loop.integrator


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
    from ..control.compiled.baseline_tick import restoring_table  # noqa: PLC0415
    from .compiled.measuring import Measuring  # noqa: PLC0415
    from .compiled.world import Settings, World  # noqa: PLC0415

    law, drives = law_of(loop), loop.engine
    is_baseline = isinstance(law, FormulaBaseline)
    at_rotors = isinstance(drives, DrivenPlant) and (
        drives.encoders != "link" and bool(drives.elastic.any())
    )
    is_measured = at_rotors or law is not loop.controller or type(loop.sensor) is not Perfect
    loop.environment.torque(loop.plant, 0.0, loop.q, loop.v)  # refuses what does not fit the arm
    is_stiff = loop.friction_is_stiff()
    if isinstance(drives, DrivenPlant):
        links: Any = drives.links
        is_stiff = links.friction_at_end
    integrator: Any = "stiff" if is_stiff else loop.integrator
    settings = Settings(loop.ticks, loop.substeps, integrator, SPEED_BOUND)
    q, v = loop.q.copy(), loop.v.copy()
    return World(
        *(controller, loop.plant, plant, loop.environment, q, v, settings, loop.stops),
        restoring_table(law) if is_baseline else None,
        Measuring(loop.controller, loop.sensor, at_rotors) if is_measured else None,
        drives,
    )


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
