"""Units on the axes: of joints that turn, of joints that slide, or of both."""

from __future__ import annotations

from ...simulation.result import SimulationResult
from ...simulation.violations import unit_of

_FORCES = {"rad": r"N$\cdot$m", "m": "N"}


def position_unit(result: SimulationResult, joint: int | None = None) -> str:
    """Unit of positions and their errors, of one joint or of all."""
    return " or ".join(_units(result, joint))


def rate_unit(result: SimulationResult, joint: int | None = None) -> str:
    """Unit of their rates."""
    return " or ".join(f"{unit}/s" for unit in _units(result, joint))


def force_unit(result: SimulationResult, joint: int | None = None) -> str:
    """Unit of torques and forces."""
    return " or ".join(_FORCES[unit] for unit in _units(result, joint))


def _units(result: SimulationResult, joint: int | None) -> list[str]:
    joints = range(len(result.joint_names)) if joint is None else (joint,)
    found = {unit_of(result, i) for i in joints}
    return [unit for unit in _FORCES if unit in found]
