"""Robots: one small protocol for all of them, one loop that drives them, and adapters of makers' clients.

`run` drives a `SimulatedRobot`, a `franka.Franka`, a `ur.UniversalRobot`, or a robot of yours. The adapters load
their clients when they are used. The room uses `simulation` and what lies below it.
"""

from __future__ import annotations

from . import franka as franka
from . import ur as ur
from .checks import check_controller as check_controller
from .checks import check_start as check_start
from .limiter import CommandLimiter as CommandLimiter
from .loop import Driver as Driver
from .loop import run as run
from .protocol import Conventions as Conventions
from .protocol import Robot as Robot
from .protocol import RobotState as RobotState
from .report import RobotRun as RobotRun
from .report import RunReport as RunReport
from .simulated import SimulatedRobot as SimulatedRobot
