"""`CommandLimiter`: torque limits counted in the robot's own cycles, whichever of the last commands has arrived."""

from __future__ import annotations

import numpy as np

from .._common.arrays import Array, BoolArray
from .protocol import Conventions

MARGIN = 0.99
"""Share of the robot's limits that is used: at the limit itself rounding decides."""

_SINGLE = 1e-6  # robots report in single precision

MOST_ON_THEIR_WAY = 20
"""Commands without an answer that are remembered; a robot stops after as many."""


class CommandLimiter:
    """Keeps commands within the robot's limits of torque and torque rate, although some get lost or arrive late.

    A robot compares a command with the one that it applied before. Which one that was is known late: its state reports
    it. A command is therefore kept within one cycle's step of the reported command and of every command after it that
    has not been reported yet. Whichever of them arrive, and in whichever cycles, no two in succession differ by more.
    A cycle without a command gives no right to a larger step: the robot has held its torque meanwhile.

    Args:
        conventions: The robot's limits.
    """

    def __init__(self, conventions: Conventions) -> None:
        self._effort = MARGIN * conventions.effort
        self._step = MARGIN * conventions.torque_rate * conventions.period
        self._on_their_way: list[Array] = []
        self._reported: Array | None = None

    def limit(self, wanted: Array, reported: Array) -> tuple[Array, bool]:
        """Return the command nearest to the wanted one that is safe to send, and whether it is another one.

        Args:
            wanted: Command that the law wants, shape (nv,) [N·m or N].
            reported: Command that the robot's state of this cycle reports as applied, shape (nv,).
        """
        self._acknowledge(reported)
        known = np.stack([reported, *self._on_their_way])
        lower, upper = known.max(axis=0) - self._step, known.min(axis=0) + self._step
        crossed = (
            lower > upper
        )  # cannot be while every command came from here; then the middle is nearest to all
        middle = (lower + upper) / 2.0
        lower, upper = np.where(crossed, middle, lower), np.where(crossed, middle, upper)
        command = np.clip(np.clip(wanted, -self._effort, self._effort), lower, upper)
        self._on_their_way = [*self._on_their_way, command][-MOST_ON_THEIR_WAY:]
        return command, bool((command != wanted).any())

    @property
    def on_their_way(self) -> int:
        """Commands that the robot has not reported yet, the latest included: 1 where all is well."""
        return len(self._on_their_way)

    def _acknowledge(self, reported: Array) -> None:
        """Forget the commands up to the one that the robot reports now and did not before, and equal ones after it.

        Of equal ones elsewhere it is the first: the others may still be to come.
        """
        before, self._reported = self._reported, reported
        if not self._on_their_way:
            return
        close = _SINGLE * (1.0 + np.abs(reported))
        away = np.abs(np.stack(self._on_their_way) - reported)
        equal: BoolArray = np.all(away <= close, axis=1)
        is_news = before is None or not np.array_equal(before, reported)
        done = int(np.argmax(equal)) if is_news and equal.any() else 0
        while done < len(equal) and equal[done]:
            done += 1
        del self._on_their_way[:done]
