"""How a result finds its robot again: arguments of `load_robot` as plain JSON data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pinocchio as pin

from ..description import Description
from .full_robot import FLOATING_BASE, FullRobot

RECIPE = {
    *("source", "lock", "locked_configuration", "package_dirs", "repair"),
    *("tool_frame", "massless", "armature"),
}
"""What a result's recipe for its robot may hold: arguments of `load_robot`."""


def with_recipe(
    robot: FullRobot,
    source: object,
    folders: Sequence[Path],
    repairs: tuple[str, ...],
) -> Description | None:
    """Return the description with the way to load it again, where the source has a name or a path.

    Args:
        robot: The robot.
        source: What `load_robot` was given.
        folders: Folders in which packages are looked up.
        repairs: Names of the requested repairs.
    """
    description = robot.description
    if description is None or description.folder is None:
        return description
    recipe = {
        "source": str(source) if robot.is_named else str(Path(str(source)).absolute()),
        "lock": sorted(robot.locked) + ([FLOATING_BASE] if robot.floats else []),
        "locked_configuration": {name: float(value) for name, value in robot.values.items()},
        "package_dirs": [str(folder.absolute()) for folder in folders],
    }
    if repairs:
        recipe["repair"] = list(repairs)
    return replace(description, recipe=recipe)


def accepting_no_mass(description: Description | None, model: pin.Model) -> Description | None:
    """Return the description whose recipe accepts links without mass.

    Args:
        description: The description.
        model: The model, with its armature.
    """
    if description is None or description.recipe is None:
        return description
    recipe = {**description.recipe, "massless": True, "armature": model.armature.tolist()}
    return replace(description, recipe=recipe)
