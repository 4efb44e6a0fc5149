"""The closed loop around Pinocchio: RNEA and ABA are its own, what lies between them is compiled."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..exceptions import UnsupportedJointError
from ..trajectories import Reference
from .checkpoint import Checkpoint
from .closed_loop import ClosedLoop, OnTick, empty_channels
from .result import SimulationResult
from .rollout import blocks_to_do, check_inputs, new_world, reason_against
from .sampling import sample, tick_times

if TYPE_CHECKING:
    from .compiled.pinocchio_loop import Between
    from .compiled.world import World


def run_fused(
    loop: ClosedLoop, on_tick: OnTick | None, checkpoint: Checkpoint | None = None
) -> SimulationResult | None:
    """Run a closed loop with kernels between Pinocchio's algorithms; None where it has no such form.

    Raises:
        DivergenceError: A joint left every sensible range.
        InputError: The reference or the environment is not what a controller takes.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    controller: Any = loop.controller
    if getattr(controller, "_tick", None) is None or reason_against(loop) is not None:
        return None
    if loop.integrator != "semi-implicit" or loop.friction_is_stiff():
        return None
    from ..robot.compiled.tables import arm_tables  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.world import controlled  # noqa: PLC0415

    loop = replace(loop, plant=loop.plant.copy())
    try:
        known = controlled(controller, arm_tables(controller.arm))
        world = new_world(loop, known, arm_tables(loop.plant))
    except UnsupportedJointError:
        return None
    return _FusedRun(loop, world).run(on_tick, checkpoint)


class _FusedRun:
    """One run."""

    def __init__(self, loop: ClosedLoop, world: World) -> None:
        from .compiled.log import journal  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled.world import desk  # noqa: PLC0415

        self.loop, self.world = loop, world
        nq, nv = loop.plant.nq, loop.plant.nv
        self.channels, self.desk = empty_channels(loop.ticks + 1, nq, nv), desk(nq, nv)
        self.journal = journal(self.channels)
        controller: Any = loop.controller
        self.tick, self.own = controller._tick.ticker(world.memory.motion.tau)

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
        from .._numba.table_arguments import hold  # noqa: PLC0415
        from .compiled.pinocchio_loop import GOES_ON, kernels  # noqa: PLC0415

        begin, act, move = kernels(between)
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
