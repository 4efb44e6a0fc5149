"""Options of a law at the tool: the frame, its motion and the axes of its impedance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal

import numpy as np

from .._common.arrays import Array, positive_number
from ..control.cartesian_defaults import MASS, STIFFNESS
from ..exceptions import ParameterError
from ..law.cartesian_impedance import CartesianImpedance
from ..law.poses import Pose
from ..robot.arm_model import ArmModel
from ..trajectories import cartesian
from ..trajectories.cartesian import CartesianTrajectory
from .options import RobotOptions, numbers, option

_tool = partial(option, "Tool")


@dataclass(frozen=True, kw_only=True)
class ToolOptions:
    """The frame that is controlled instead of the joints, and what it does."""

    frame: Annotated[
        str | None,
        _tool(
            "Control this frame instead of the joints: motion, mass, damping, stiffness, payload and wrench are its "
            "own. Default: the joints.",
            "NAME",
        ),
    ] = None
    line: Annotated[
        str | None,
        _tool(
            "Way of the frame in m, and its turn about x, y, z in rad: ..,RX,RY,RZ; in half a --period. Without "
            "--line and --circle it stays where it is.",
            "X,Y,Z",
        ),
    ] = None
    circle: Annotated[
        float | None,
        _tool("Radius in m of a level circle towards the base, a turn in a --period.", "R"),
    ] = None
    axes: Annotated[
        Literal["world", "reference"],
        _tool("Of the impedance: world, or reference, which turns with the motion.", "NAME"),
    ] = "world"

    def load(self, reading: RobotOptions, robot: str) -> ArmModel:
        """Load a robot, with the frame as its tool frame where there is one.

        Raises:
            ParameterError: A second tool frame, or an option that only a frame has.
            ModelError: No such frame; the message names near ones, or those that there are.
        """
        if self.frame is None:
            self._check_nothing_given()
            return reading.load(robot)
        if reading.tool_frame is not None:
            words = "left out with --frame, which is the tool frame of the run"
            raise ParameterError("--tool-frame", reading.tool_frame, words)
        return replace(reading, tool_frame=self.frame).load(robot)

    def trajectory(self, arm: ArmModel, q: Array, period: float) -> CartesianTrajectory:
        """Return the motion of the frame.

        Args:
            arm: The arm.
            q: Configuration at its beginning, shape (nq,).
            period: Time of a circle's turn; a line takes half of it [s].

        Raises:
            ParameterError: Both motions, or numbers that cannot be.
        """
        start = Pose(*arm.frame_placement(q, self.frame))
        period = positive_number("period", period, "time in seconds")
        if self.line is not None and self.circle is not None:
            raise ParameterError("--line and --circle", "both", "one of them, or neither")
        if self.circle is not None:
            radius = positive_number("--circle", self.circle, "radius in m")
            x, y, _ = start.translation
            return cartesian.circle(
                start, radius, period, towards=(-x, -y, 0.0) if x or y else (1.0, 0.0, 0.0)
            )
        if self.line is None:
            return cartesian.hold(start)
        way = np.append(numbers("--line", self.line, 3, 6), np.zeros(3))
        if np.linalg.norm(way[3:6]) >= np.pi:
            raise ParameterError("--line", self.line, "a turn shorter than π")
        return cartesian.line(start, way[:3], period / 2.0, rotation=way[3:6])

    def impedance(
        self, mass: str | None, damping: str | None, stiffness: str | None
    ) -> CartesianImpedance:
        """Return the target; critically damped where no damping is given."""
        return CartesianImpedance(
            MASS if mass is None else numbers("--mass", mass, 2, 6),
            STIFFNESS if stiffness is None else numbers("--stiffness", stiffness, 2, 6),
            None if damping is None else numbers("--damping", damping, 2, 6),
            axes=self.axes,
        )

    def _check_nothing_given(self) -> None:
        for name in ("line", "circle"):
            if getattr(self, name) is not None:
                raise ParameterError(f"--{name}", getattr(self, name), "given with --frame NAME")
        if self.axes != "world":
            raise ParameterError("--axes", self.axes, "given with --frame NAME")
