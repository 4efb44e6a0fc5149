"""What a run of a `CartesianController` logs of the tool, beside the channels of every run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .._common.arrays import Array, BoolArray
from ..control.cartesian_telemetry import CartesianOutput

PREFIX = "tool_"
"""Begin of the channels' names in files."""

UNITS = {
    "position": "m",
    "rotation": "1",
    "position_r": "m",
    "rotation_r": "1",
    "e1": "m, rad",
    "e2": "m/s, rad/s",
    "s": "m/s, rad/s",
    "wrench": "N, N·m",
    "sigma": "1",
    "lost": "1",
    "premise_holds": "bool",
    "joint_limited": "bool",
}
"""Unit of every channel, by its name in `ToolLog`."""

_SHAPES: Mapping[str, tuple[int, ...]] = {
    **dict.fromkeys(("position", "position_r"), (3,)),
    **dict.fromkeys(("rotation", "rotation_r"), (3, 3)),
    "sigma": (),
}

_OWN = [name for name in UNITS if not name.startswith(("position", "rotation"))]
"""Channels that an output has by the same name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ToolLog:
    """Log of the tool in world axes; the first axis of every array is time.

    Attributes:
        position: Origin of the frame, shape (N, 3) [m].
        rotation: Its axes as columns, shape (N, 3, 3).
        position_r: Origin of the impedance reference x_r, shape (N, 3) [m].
        rotation_r: Its axes, shape (N, 3, 3).
        e1: Pose error (p_r - p, log(R_r Rᵀ)), shape (N, 6) [m, rad].
        e2: Its rate, shape (N, 6) [m/s, rad/s].
        s: Sliding variable, shape (N, 6).
        wrench: Wrench that the controller was given, shape (N, 6) [N, N·m].
        sigma: Smallest singular value of the Jacobian, linear rows divided by the controller's length, shape (N,).
        lost: Share of each axis that damping takes near a singularity, shape (N, 6).
        premise_holds: Whether the axis' reaching law acts in full, shape (N, 6), bool.
        joint_limited: Whether a joint is at its velocity or position limit, shape (N, nv), bool.
    """

    position: Array
    rotation: Array
    position_r: Array
    rotation_r: Array
    e1: Array
    e2: Array
    s: Array
    wrench: Array
    sigma: Array
    lost: Array
    premise_holds: BoolArray
    joint_limited: BoolArray

    def channels(self) -> dict[str, Any]:
        """Return the arrays by the names that they have in files."""
        return {PREFIX + field.name: getattr(self, field.name) for field in fields(self)}


def empty_tool_channels(samples: int, nv: int) -> dict[str, Any]:
    """Return arrays for the channels of a `ToolLog`, by their names in files."""
    shapes = {name: _SHAPES.get(name, (6,)) for name in UNITS} | {"joint_limited": (nv,)}
    return {
        PREFIX + name: np.zeros((samples, *shape), dtype=bool if UNITS[name] == "bool" else float)
        for name, shape in shapes.items()
    }


def tool_log(channels: Mapping[str, Any]) -> ToolLog | None:
    """Return the log of the tool in some channels; None where there is none.

    Raises:
        KeyError: Some of its channels are missing.
    """
    if PREFIX + "e1" not in channels:
        return None
    return ToolLog(**{name: channels[PREFIX + name] for name in UNITS})


def write_tool(channels: Mapping[str, Any], k: int, output: CartesianOutput) -> None:
    """Write the row of tick k."""
    row = {name: getattr(output, name) for name in _OWN}
    for name, pose in (("", output.pose), ("_r", output.reference.pose)):
        row |= {f"position{name}": pose.translation, f"rotation{name}": pose.rotation}
    for name, value in row.items():
        channels[PREFIX + name][k] = value
