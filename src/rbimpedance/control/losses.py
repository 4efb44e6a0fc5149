"""Ticks that get lost between robot and controller: when, as a pure function of a seed, and a loop that has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from .._common.arrays import choice, whole_number
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..exceptions import ParameterError
from .protocol import Measured
from .telemetry import ControllerOutput, Situation
from .tool_view import AnyController, in_joints
from .wrapper import ControllerWrapper

Meanwhile: TypeAlias = Literal["held", "zero"]
"""What the motors give while a tick is lost: the torque of the last one, or nothing."""


@brief_repr()
@dataclass(frozen=True)
class Losses:
    """Which ticks are lost: bursts of 1 to `burst` ticks, as UDP loses packets.

    Attributes:
        share: Of all ticks, in the long run.
        burst: Longest burst; all lengths up to it are as likely.
        seed: Of the bursts.

    Raises:
        ParameterError: A share outside [0, 1) or larger than such bursts can reach, a burst or a seed that is no whole
            number.
    """

    share: float = 0.0
    burst: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        whole_number("burst", self.burst, 1, "ticks")
        whole_number("seed", self.seed)
        mean = (1.0 + self.burst) / 2.0
        most = mean / (mean + 1.0)
        if not 0.0 <= self.share <= most:
            words = f"from 0 to {most:g}: there is a tick between two bursts"
            raise ParameterError("share", self.share, words)

    def remaining(self, before: int, tick: int) -> int:
        """Return how many ticks of a burst are left at a tick, itself included; 0 where it is not lost.

        Args:
            before: The same at the tick before.
            tick: Number of the tick.
        """
        if before > 0:
            return before - 1
        if self.share == 0.0:
            return 0
        rng = np.random.default_rng((self.seed, tick))
        mean = (1.0 + self.burst) / 2.0
        begins = rng.random() < self.share / ((1.0 - self.share) * mean)
        return int(rng.integers(1, self.burst + 1)) if begins else 0


class LossyState(NamedTuple):
    """Memory of a loop that loses ticks.

    Attributes:
        ticks: Number of ticks so far; with the seed it fixes which are lost.
        remaining: Ticks of a burst that were left at the tick before.
        since: Ticks since the last one that arrived.
        output: Output of that tick, None before the first.
        inner: State of the controller.
    """

    ticks: int
    remaining: int
    since: int
    output: ControllerOutput | None
    inner: Any


@dataclass(frozen=True, eq=False, init=False)
class LossyController(ControllerWrapper[LossyState, ControllerOutput]):
    """A controller whose ticks get lost in bursts between it and the robot.

    It is a controller itself: `simulate` takes it like any other, and `ImperfectController` inside adds a delay. At a
    lost tick the controller does not run; at the next one it is given the time that has passed, as `Loop` measures it.
    The first tick is not lost. The losses are a function of the seed and the tick, so runs are reproducible.

    Attributes:
        controller: What is at the other end; one at the tool finds its wrench from the joint torque.
        losses: Which ticks are lost.
        meanwhile: What the motors give then: "held", the last torque, or "zero".

    Raises:
        ParameterError: Another word.
    """

    losses: Losses
    meanwhile: Meanwhile

    def __init__(
        self, controller: AnyController, losses: Losses, *, meanwhile: Meanwhile = "held"
    ) -> None:
        set_fields(
            self,
            controller=in_joints(controller),
            losses=losses,
            meanwhile=choice("meanwhile", meanwhile, get_args(Meanwhile)),
        )

    def init(self) -> LossyState:
        """Return the state before the first tick."""
        return LossyState(0, 0, 0, None, self.controller.init())

    def _step(self, state: LossyState, given: Measured) -> tuple[ControllerOutput, LossyState]:
        tick, last = state.ticks, state.output
        remaining = self.losses.remaining(state.remaining, tick) if tick else 0
        state = state._replace(ticks=tick + 1, remaining=remaining, since=state.since + 1)
        if remaining > 0 and last is not None:
            tau = last.tau if self.meanwhile == "held" else np.zeros_like(last.tau)
            return last._replace(tau=tau), state
        inner = state.inner
        if state.since > 1:
            inner = self.controller.elapsed(inner, state.since * self.dt)
        output, inner = self.controller.step(inner, *given)
        return output, state._replace(since=0, output=output, inner=inner)

    def handover(self, state: LossyState, now: Situation) -> LossyState:
        """Return the state with which the arm is taken over as it is now; nothing is late then.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        return state._replace(since=0, inner=self.controller.handover(state.inner, now))
