"""The command `rbimpedance inspect`."""

from __future__ import annotations

import numpy as np

from .option_groups import with_options
from .options import Json, Quiet, Robot, RobotOptions
from .terminal import explain, number, print_json, print_table, table, tell

LEGEND = (
    "lower, upper: position limits in rad (m where a joint slides); speed: its limit in rad/s (m/s); effort: largest "
    "torque in N·m (N); viscous, Coulomb: friction in N·m·s/rad and N·m (N·s/m and N); armature: rotor inertia at the "
    "joint, M(neutral): all inertia at the joint in the neutral posture, both in kg·m^2 (kg); –: not given, or no limit"
)
"""What the columns of the table mean."""

_INSPECTED = (
    *("name", "nq", "nv", "joint_names", "tool_frame", "frame_names"),
    *("neutral", "ready", "lower", "upper"),
    *("effort_limit", "velocity_limit", "viscous", "coulomb", "armature", "notes"),
)


@with_options
def inspect(
    robot: Robot,
    reading: RobotOptions,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show what a robot's description says: joints, limits, friction, frames, and what is odd about it."""
    arm = reading.load(robot)
    if as_json:
        print_json({name: getattr(arm, name) for name in _INSPECTED})
        return
    if not quiet:
        limits = (*arm.joint_limits(), arm.velocity_limit, arm.effort_limit)
        inertia = np.diag(arm.mass_matrix(arm.neutral))
        columns = (*limits, arm.viscous, arm.coulomb, arm.armature, inertia)
        rows = [
            [name, *(number(float(column[i])) for column in columns)]
            for i, name in enumerate(arm.joint_names)
        ]
        header = ("joint", "lower", "upper", "speed", "effort", "viscous", "Coulomb", "armature")
        title = f"{arm.name}: nq = {arm.nq}, nv = {arm.nv}, tool frame '{arm.tool_frame}'"
        print_table(table(title, (*header, "M(neutral)"), rows))
        explain(LEGEND)
    for note in arm.notes:
        tell(f"note: {note}")
