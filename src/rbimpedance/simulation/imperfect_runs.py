"""Runs of an `ImperfectController` around an `ImpedanceController` by compiled code; see `closed_loop.run`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..control.controller import ImpedanceController
from ..control.imperfect import ImperfectController
from ..exceptions import DivergenceError
from .closed_loop import ClosedLoop, OnTick
from .compiled_runs import reason_against, run_by_blocks, verified_world
from .result import SimulationResult

if TYPE_CHECKING:
    from .compiled.imperfect import Imperfections
    from .compiled.loop import Controlled
    from .compiled.world import Block, Outcome


def has_imperfect_form(loop: ClosedLoop) -> bool:
    """Return whether imperfections are all that keeps a loop from a compiled form.

    Args:
        loop: The loop.
    """
    if type(loop.controller) is not ImperfectController:
        return False
    inner = loop.controller.controller
    if type(inner) is not ImpedanceController or inner.backend == "numpy":
        return False
    return reason_against(replace(loop, controller=inner)) is None


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
        from .compiled.imperfect import measurements  # noqa: PLC0415 (Numba is loaded when needed)

        assert isinstance(loop.controller, ImperfectController)
        self.loop, self.imperfect = loop, loop.controller
        self.world = verified_world(
            replace(loop, controller=self.imperfect.controller), known, states
        )
        self.seen = measurements(self.imperfect.delay, loop.plant.nq, loop.plant.nv)

    def result(self, on_tick: OnTick | None = None) -> SimulationResult | None:
        """Do all ticks, and return what they leave behind; None where there is no compiled form, or a tick is refused.

        Args:
            on_tick: Called with (ticks done, ticks in all) after every block.

        Raises:
            DivergenceError: A joint left every sensible range.
            InputError: The reference or the environment is not what a controller takes.
        """
        if self.world is None:
            return None

        def run_block(block: Block) -> Outcome:
            outcome = self._run(block)
            if on_tick is not None and outcome.ending == "finished":
                on_tick(block.ticks.stop - 1, self.loop.ticks)
            return outcome

        try:
            result = run_by_blocks(self.loop, self.world, run_block, None)
        except DivergenceError as error:
            self._scale(error.result)
            raise
        if result is not None:
            self._scale(result)
        return result

    def _scale(self, result: SimulationResult) -> None:
        """Turn the logged torque that was demanded into the true one."""
        tau = result.tau
        np.multiply(tau, self.imperfect.torque_constant, out=tau)

    def _run(self, block: Block) -> Outcome:
        from .compiled.imperfect import imperfect_rollout  # noqa: PLC0415 (Numba is loaded when needed)

        assert self.world is not None
        return self.world.run(block, imperfect_rollout, self._imperfections(block.ticks), self.seen)

    def _imperfections(self, ticks: range) -> Imperfections:
        from .compiled.imperfect import Imperfections  # noqa: PLC0415 (Numba is loaded when needed)

        law = self.imperfect
        rows = ticks if law.is_noisy else ticks[:0]
        noise = np.array([law.noise(k) for k in rows] or np.zeros((1, 2, law.arm.nv)))
        on_q, on_v = (np.ascontiguousarray(noise[:, i]) for i in range(2))
        constant = np.broadcast_to(law.torque_constant, law.arm.nv).copy()
        return Imperfections(on_q, on_v, constant, np.array([law.delay]))


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
