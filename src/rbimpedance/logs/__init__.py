"""Logs of real and simulated arms: read, check, and write them.

`Log.read` takes MCAP and rosbag2, CSV, Parquet, npz and LeRobot data sets; what is wrong in a file is an error or a
named finding, never a guess. May use: `robot` and what it uses.
"""

from __future__ import annotations

from .arm_log import ArmLog as ArmLog
from .findings import LogFinding as LogFinding
from .log import Log as Log
