"""What produced a result or a snapshot, as plain JSON data."""

from __future__ import annotations

import dataclasses
import functools
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np


def provenance(controller: Any, plant: Any, **settings: object) -> dict[str, Any]:
    """Return what produced a result, as plain JSON data.

    Args:
        controller: The controller of the run.
        plant: The simulated arm.
        **settings: Further settings of the run.
    """
    return {
        "versions": {
            name: installed_version(name) for name in ("rbimpedance", "pin", "numpy", "scipy")
        }
        | {"python": platform.python_version()},
        "controller": _plain(controller),
        "plant": _plain(plant),
        "dt": controller.dt,
    } | {name: _plain(value) for name, value in settings.items()}


@functools.cache
def installed_version(distribution: str) -> str:
    """Return the version of a distribution, "unknown" where it is not installed."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"


def _plain_arm(arm: Any) -> dict[str, Any]:
    """Name and digest of an arm, and how `load_robot` finds its links again (None: it cannot)."""
    recipe = arm.description.recipe if arm.description is not None else None
    return {
        "name": arm.name,
        "digest": arm.digest,
        "joint_names": list(arm.joint_names),
        "recipe": None if recipe is None else {**recipe, "tool_frame": arm.tool_frame},
    }


def _plain(value: object) -> Any:
    """Turn arms, gains and dataclasses of them into JSON data."""
    if hasattr(value, "digest") and hasattr(value, "joint_names"):
        return _plain_arm(value)
    if dataclasses.is_dataclass(value):
        public = [f.name for f in dataclasses.fields(value) if not f.name.startswith("_")]
        return {"type": type(value).__name__} | {
            name: _plain(getattr(value, name)) for name in public
        }
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, str | int | float | bool | None):
        return value
    return repr(value)
