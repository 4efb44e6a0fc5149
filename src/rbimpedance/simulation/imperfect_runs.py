"""Runs of motors whose torque is not what the law demands, by compiled code; see `closed_loop.run`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..control.controller import ImpedanceController
from ..control.imperfect import ImperfectController
from ..exceptions import DivergenceError
from ..interaction import Perfect
from .closed_loop import ClosedLoop, OnTick
from .compiled_runs import reason_against, run_by_blocks, verified_world
from .result import SimulationResult

if TYPE_CHECKING:
    from .compiled.loop import Controlled
    from .compiled.world import Block, Outcome


def has_imperfect_form(loop: ClosedLoop) -> bool:
    """Return whether torque constants are all that keeps a loop from a compiled form.

    Args:
        loop: The loop.
    """
    if type(loop.controller) is not ImperfectController or type(loop.sensor) is not Perfect:
        return False
    inner = loop.controller.controller
    if type(inner) is not ImpedanceController or inner.backend == "numpy":
        return False
    constants_are_one = bool((loop.controller.torque_constant == 1.0).all())
    return not constants_are_one and reason_against(_with_exact_motors(loop)) is None


def _with_exact_motors(loop: ClosedLoop) -> ClosedLoop:
    law: Any = loop.controller
    noise = {name: getattr(law, name) for name in ("position_noise", "velocity_noise", "delay")}
    return replace(loop, controller=ImperfectController(law.controller, seed=law.seed, **noise))


class ImperfectRun:
    """One run in compiled form.

    Args:
        loop: One that `has_imperfect_form`.
        known: Compiled controllers by the identity of the controller, to be used and added to.
        states: Number of random states at which the plant's dynamics are compared with Pinocchio's.

    Raises:
        ModelError: The compiled dynamics of an arm are not Pinocchio's.
    """

    def __init__(self, loop: ClosedLoop, known: dict[int, Controlled], states: int) -> None:
        assert isinstance(loop.controller, ImperfectController)
        self.loop, self.torque_constant = loop, loop.controller.torque_constant
        self.world = verified_world(_with_exact_motors(loop), known, states)

    def result(self, on_tick: OnTick | None = None) -> SimulationResult | None:
        """Do all ticks, and return what they leave behind; None where there is no compiled form, or a tick is refused.

        Args:
            on_tick: Called with (ticks done, ticks in all) after every block.

        Raises:
            DivergenceError: A joint left every sensible range.
            InputError: The reference or the environment is not what a controller takes.
        """
        world = self.world
        if world is None:
            return None

        def run_block(block: Block) -> Outcome:
            block.desk.torque_constant[:] = self.torque_constant
            outcome = world.run(block)
            if on_tick is not None and outcome.ending == "finished":
                on_tick(block.ticks.stop - 1, self.loop.ticks)
            return outcome

        try:
            result = run_by_blocks(self.loop, world, run_block, None)
        except DivergenceError as error:
            self._scale(error.result)
            raise
        if result is not None:
            self._scale(result)
        return result

    def _scale(self, result: SimulationResult) -> None:
        """Turn the logged torque that was demanded into the true one."""
        tau = result.tau
        np.multiply(tau, self.torque_constant, out=tau)


def run_imperfect(loop: ClosedLoop, on_tick: OnTick | None = None) -> SimulationResult | None:
    """Run a loop by compiled code; None where it has no such form.

    Raises:
        DivergenceError: A joint left every sensible range.
        InputError: The reference or the environment is not what a controller takes.
        ModelError: The compiled dynamics of an arm are not Pinocchio's.
    """
    if not has_imperfect_form(loop):
        return None
    return ImperfectRun(loop, {}, 20).result(on_tick)
