"""How much is measured, and on which arm."""

from __future__ import annotations

from typing import NamedTuple

from rbimpedance.cli.timing import Progress
from rbimpedance.robot.arm_model import ArmModel

from .cases import ARMS


class Plan(NamedTuple):
    """How much is measured.

    Attributes:
        ticks: Back to back, of each kind.
        paced: Periods of the paced loop, for each state of the garbage collector.
        runs: Runs of a closed loop, or turns, of which the median is taken.
        loop_ticks: Ticks of one such run.
        batch_ticks: Ticks of a batch.
        worlds: Numbers of worlds of a batch.
        joints: Numbers of joints of the chains.
        memory: Ticks over which memory must not grow.
        imports: New processes that import the package.
        arms: Arms of the table, besides the one that everything is measured on.
    """

    ticks: int
    paced: int
    runs: int
    loop_ticks: int
    batch_ticks: int
    worlds: tuple[int, ...]
    joints: tuple[int, ...]
    memory: int
    imports: int
    arms: tuple[str, ...]


QUICK = Plan(2_000, 100, 3, 500, 100, (1, 8), (1, 3, 6), 2_000, 1, ("two_link",))
MINUTE = Plan(
    20_000, 2_000, 5, 5_000, 1_000, (1, 16, 256), (1, 2, 5, 10, 20, 35, 50), 100_000, 3, ARMS
)
FULL = Plan(
    100_000,
    100_000,
    15,
    20_000,
    5_000,
    (1, 4, 16, 64, 256, 1024, 4096),
    (1, 2, 3, 5, 7, 10, 15, 20, 25, 30, 35, 40, 45, 50),
    1_000_000,
    7,
    ARMS,
)


class Setting(NamedTuple):
    """What every section is given.

    Attributes:
        robot: Name of the arm that everything is measured on.
        arm: That arm.
        plan: How much is measured.
        on_tick: For a progress bar.
    """

    robot: str
    arm: ArmModel
    plan: Plan
    on_tick: Progress
