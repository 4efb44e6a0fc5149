"""A controller's parts as the tables that the compiled law reads."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from ..._common.arrays import Array
from ..._numba import warn_once
from ...law.bounded_surface import BoundedSurface
from ...law.formulas import Formula, FormulaPart
from ...law.impedance import ImpedanceFilter, TargetFilter
from ...law.super_twisting import SuperTwisting
from ...law.surfaces import Surface, has_formula
from ..tick import ControlLaw
from . import law as at
from .block import COLUMNS
from .formulas import is_formula, reaching_address, surface_address
from .law import LawTables, Scratch


def can_pack(surface: Surface, reaching: Any) -> bool:
    """Whether there are compiled formulas of surface and reaching law; otherwise their own methods compute them."""
    inner = _within_bound(surface)
    if not (has_formula(inner) and is_formula(reaching)):
        return False
    try:
        surface_address(inner.formula)
        reaching_address(reaching.formula)
    except Exception as error:  # Numba has many
        reason = str(error).splitlines()[0]
        names = f"{inner.formula.__name__} and {reaching.formula.__name__}"
        warn_once(f"one of the formulas {names} cannot be compiled: {reason}")
        return False
    return True


def lane_addresses(surface: Surface, reaching: Any) -> tuple[int, int] | None:
    """Return the loops in lanes of a surface and a reaching law that `can_pack`.

    Returns:
        Their addresses; None where a formula has conditions that are not written with `select` and `any_of`.
    """
    return _lane_addresses(_within_bound(surface).formula, reaching.formula)


@functools.cache
def _lane_addresses(surface: Formula, reaching: Formula) -> tuple[int, int] | None:
    try:
        return surface_address(surface, in_lanes=True), reaching_address(reaching, in_lanes=True)
    except NumbaError:
        return None


def pack_law(law: ControlLaw) -> LawTables:
    """Return the tables of a law.

    Args:
        law: One whose surface and reaching law `can_pack` knows.
    """
    nv, limits = law.arm.nv, law.limits
    sliding = pack_sliding(law.surface, law.reaching, nv, law.dt)
    gains, choices = sliding.gains, sliding.choices
    if limits is not None:
        gains[:, at.EFFORT], gains[:, at.TORQUE_STEP] = limits.effort, limits.rate * law.dt
    choices[0, at.FILTER], table = pack_filter(law.filter, nv)
    choices[0, at.KNOWLEDGE] = at.FULL if law.model == "full" else at.MASS_ONLY
    return sliding._replace(filter=table)


def pack_sliding(surface: Surface, reaching: Any, size: int, dt: float) -> LawTables:
    """Return the tables of a surface with its reaching law for some coordinates, without filter and limits.

    Args:
        surface: The surface.
        reaching: The reaching law; `can_pack` knows both.
        size: Number of coordinates.
        dt: Control period [s].
    """
    inner = _within_bound(surface)
    gains = np.zeros((size, at.GAINS))
    gains[:, [at.EFFORT, at.TORQUE_STEP, at.SEEN]] = np.inf
    if isinstance(surface, BoundedSurface):
        gains[:, at.SEEN] = surface.max_error
    gains[:, at.DT] = dt
    choices = np.zeros((1, at.CHOICES), dtype=np.int64)
    choices[0, at.SURFACE] = surface_address(inner.formula)
    choices[0, at.REACHING] = reaching_address(reaching.formula)
    if isinstance(reaching, SuperTwisting):
        gains[:, at.K2] = reaching.k2
        choices[0, at.PREDICTS] = reaching.scheme == "implicit"
    return LawTables(gains, _rows(inner, size), _rows(reaching, size), np.zeros((0, 0)), choices)


def _rows(part: FormulaPart, nv: int) -> Array:
    """Gains of a formula, a row for each."""
    rows = np.zeros((len(part.gains), nv))
    for row, value in zip(rows, part.gains.values(), strict=True):
        row[:] = value
    return rows


def scratch(nv: int) -> Scratch:
    """Return what a tick of nv joints writes besides its output."""
    command, torque, wanted, lower, upper, acceleration_deficit, held = np.zeros((7, nv))
    joints, mass, factor = np.zeros((at.ROWS, nv)), *np.zeros((2, nv, nv))
    block, filtered = np.zeros((nv, COLUMNS)), np.zeros(3 * nv)
    limited = wanted, lower, upper, acceleration_deficit, held, mass, factor
    return Scratch(command, torque, joints, *limited, block, filtered)


def _within_bound(surface: Surface) -> Any:
    return surface.surface if type(surface) is BoundedSurface else surface


def pack_filter(impedance_filter: TargetFilter, nv: int) -> tuple[int, Array]:
    """Return the kind and the table of a target's filter for nv joints."""
    if type(impedance_filter) is not ImpedanceFilter:
        return at.GIVEN, np.zeros((0, 0))
    maps = impedance_filter.maps().reshape(3, nv, 3, nv)
    diagonal = np.einsum("ijkj->jik", maps)
    if np.count_nonzero(maps) == np.count_nonzero(diagonal):
        return at.DECOUPLED, np.ascontiguousarray(diagonal.reshape(nv, 9))
    return at.COUPLED, np.ascontiguousarray(maps.reshape(3 * nv, 3 * nv).T)
