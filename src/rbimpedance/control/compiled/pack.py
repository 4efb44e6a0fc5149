"""A controller's parts as the tables that the compiled law reads."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._common.arrays import Array
from ...law.bounded_surface import BoundedSurface
from ...law.impedance import ImpedanceFilter, TargetFilter
from ...law.super_twisting import SuperTwisting
from ...law.surfaces import FastTerminalSurface, NonsingularTerminalSurface, PowerSurface, Surface
from ..tick import ControlLaw
from . import law as at
from .block import COLUMNS
from .law import LawTables, Scratch

_SURFACES: dict[type, tuple[int, dict[int, str]]] = {
    PowerSurface: (at.POWER, {at.GAMMA: "gamma", at.EXPONENT: "exponent"}),
    FastTerminalSurface: (
        at.FAST_TERMINAL,
        {
            at.RATE: "rate",
            at.GAMMA: "gamma",
            at.EXPONENT: "exponent",
            at.SMOOTHING: "smoothing",
        },
    ),
    NonsingularTerminalSurface: (
        at.NONSINGULAR_TERMINAL,
        {at.BETA: "beta", at.EXPONENT: "exponent"},
    ),
}
_SCHEMES = {"explicit": at.EXPLICIT, "matched": at.MATCHED, "implicit": at.IMPLICIT}


def can_pack(surface: Surface, reaching: Any) -> bool:
    """Whether the compiled law knows this surface and this reaching law; others stay with their own NumPy form."""
    return type(_within_bound(surface)) in _SURFACES and type(reaching) is SuperTwisting


def pack_law(law: ControlLaw) -> LawTables:
    """Return the tables of a law.

    Args:
        law: One whose surface and reaching law `can_pack` knows.
    """
    nv, surface, reaching, limits = law.arm.nv, law.surface, law.reaching, law.limits
    gains = np.zeros((nv, at.GAINS))
    gains[:, [at.EFFORT, at.TORQUE_STEP, at.SEEN]] = np.inf
    if isinstance(surface, BoundedSurface):
        gains[:, at.SEEN] = surface.max_error
    surface = _within_bound(surface)
    kind, names = _SURFACES[type(surface)]
    for column, name in names.items():
        gains[:, column] = getattr(surface, name)
    if kind == at.FAST_TERMINAL:
        alpha, eps = gains[:, at.EXPONENT], gains[:, at.SMOOTHING]
        gains[:, at.INNER_SLOPE] = (2.0 - alpha) * eps ** (alpha - 1.0)
        gains[:, at.INNER_CURVE] = (alpha - 1.0) * eps ** (alpha - 2.0)
    gains[:, at.DT] = law.dt
    gains[:, at.K1], gains[:, at.K2] = reaching.k1, reaching.k2
    gains[:, at.MARGIN] = reaching.margin
    if limits is not None:
        gains[:, at.EFFORT], gains[:, at.TORQUE_STEP] = limits.effort, limits.rate * law.dt
    form, table = _pack_filter(law.filter, nv)
    knows = at.FULL if law.model == "full" else at.MASS_ONLY
    choices = np.array([[kind, _SCHEMES[reaching.scheme], form, knows]])
    return LawTables(gains, table, choices)


def scratch(nv: int) -> Scratch:
    """Return what a tick of nv joints writes besides its output."""
    command, torque, zoh_gain, wanted, acceleration_deficit, held = np.zeros((6, nv))
    mass, factor = np.zeros((2, nv, nv))
    block, filtered = np.zeros((nv, COLUMNS)), np.zeros(3 * nv)
    vectors = command, torque, zoh_gain, wanted, acceleration_deficit, held
    return Scratch(*vectors, mass, factor, block, filtered)


def _within_bound(surface: Surface) -> Surface:
    return surface.surface if type(surface) is BoundedSurface else surface


def _pack_filter(impedance_filter: TargetFilter, nv: int) -> tuple[int, Array]:
    if type(impedance_filter) is not ImpedanceFilter:
        return at.GIVEN, np.zeros((0, 0))
    maps = impedance_filter.maps().reshape(3, nv, 3, nv)
    diagonal = np.einsum("ijkj->jik", maps)
    if np.count_nonzero(maps) == np.count_nonzero(diagonal):
        return at.DECOUPLED, np.ascontiguousarray(diagonal.reshape(nv, 9))
    return at.COUPLED, np.ascontiguousarray(maps.reshape(3 * nv, 3 * nv).T)
