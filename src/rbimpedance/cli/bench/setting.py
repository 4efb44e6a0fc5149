"""What every table is measured with."""

from __future__ import annotations

from typing import NamedTuple

from ...robot.arm_model import ArmModel
from .plan import Plan
from .timing import Progress


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
