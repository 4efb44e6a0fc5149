"""Where one tick of the matched scheme takes a set of states (s, ζ) of a joint, whatever disturbs it within bounds.

Units: with H = margin·h, s is in H²·k2, ζ and all accelerations in H·k2; y(s) is the law without its integral, p(s)
what it adds to the integral (docs/theory.md, 9.1):

    s⁺ = s - (n/m)·[g·(y(s') + ζ - v) - (1 - g)·c·s + w],    ζ⁺ = ζ + p(s')/m - (n/m)·λ,    abs(s' - s) ≤ late

g, c in intervals; abs(v), abs(w), abs(λ) bounded; n = 1 to 1 + lost periods. A set is convex and equal to its mirror
image, and held as a polygon around it. Every function takes intervals in place of numbers (`intervals`), which is how
results are verified.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from .intervals import joined, larger, largest, picked, root, size, smaller, upper

DIRECTIONS = 16
"""Normals of a polygon over half a turn."""

_ANGLES = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
_D1, _D2 = np.cos(_ANGLES), np.sin(_ANGLES)
_D1_NEXT, _D2_NEXT = np.append(_D1[1:], -1.0), np.append(_D2[1:], 0.0)

_SLICES = np.append(0.0, np.geomspace(1e-4, 1.0, 16))
"""Values of abs(s) over its largest one, between which y and p are held as straight lines with an error."""

_ROUNDING = 1e-9  # of y and p, for a vertex that rounding has put on the wrong side of a slice
INFLATION = 1.0 + 1e-9
"""Of what is computed in floating point: far more than rounding, far less than anything of interest."""


class Sets(NamedTuple):
    """One polygon for each of n joints: abs(cos(θ)·s/S + sin(θ)·ζ/Z) ≤ support, for `DIRECTIONS` angles θ.

    Attributes:
        support: Shape (n, DIRECTIONS); the first is that of s, at 0 rad.
        scale: S and Z, shape (n, 2).
    """

    support: Array
    scale: Array

    @property
    def s(self) -> Array:
        """Largest abs(s), shape (n,)."""
        return self.support[:, 0] * self.scale[:, 0]


class Bounds(NamedTuple):
    """What disturbs the loops of n joints, each of shape (n,), but `lost`.

    Attributes:
        kappa: k1/√k2.
        margin: m, of the scheme.
        low: Smallest own gain g.
        high: Largest own gain g.
        slope_low: Smallest slope c of the surface.
        slope_high: Largest slope c of the surface.
        push: Largest abs(v).
        error: Largest acceleration by which 1 - g counts, beside c·s.
        noise: Largest acceleration that does not count with g; with (1 - g)·error it is w.
        rate: Largest λ.
        late: Largest abs(s' - s).
        lost: Largest number of ticks in a row that are lost.
    """

    kappa: Any
    margin: Any
    low: Any
    high: Any
    slope_low: Any
    slope_high: Any
    push: Any
    error: Any
    noise: Any
    rate: Any
    late: Any
    lost: int


class Reach(NamedTuple):
    """What joints do over a tick from their sets, each of shape (n,).

    Attributes:
        root: Largest abs(y + ζ).
        demand: Largest abs(y + ζ + c·s).
        speed: Largest abs(s⁺ - s) over a period, as an acceleration.
    """

    root: Array
    demand: Array
    speed: Array


class _Line(NamedTuple):
    """slope·s + middle ± error around y or p, over every slice or at points of a set."""

    slope: Any
    middle: Any
    error: Any

    def at(self, slices: Any, s: Any) -> tuple[Any, Any]:
        """Value at points and its error, from the index of their slices."""
        slope, middle_, error = (picked(part, slices) for part in self)
        return slope * s + middle_, error


def law(s: Any, kappa: Any) -> tuple[Any, Any]:
    """Return y and p of s ≥ 0: eq. (S2) without its integral term, and the integral's step."""
    r = root(s)
    share = s / (s + kappa * r + 1.0)
    return (kappa * r + 2.0) * share, share


def slopes(s: Any, kappa: Any) -> tuple[Any, Any]:
    """Return dy/ds and dp/ds at s ≥ 0; both fall with s (docs/theory.md, lemma 1)."""
    r = root(s)
    d = s + kappa * r + 1.0
    q = (kappa * r + 2.0) / d
    return 0.5 * (kappa * r / d + q * q), 0.5 * q / d


def tick(sets: Sets, bounds: Bounds, scale: Array | None = None) -> tuple[Sets, Reach]:
    """Return sets that hold every state one tick later, and what happens over the tick.

    Args:
        sets: The states now.
        bounds: What disturbs them; as intervals, the supports that are returned are upper bounds for real numbers.
        scale: Scale of the sets that are returned; what suits them by default.
    """
    s, z, slices, breaks = _points(sets)
    y_line, p_line = _lines(breaks, bounds)
    y, y_error = y_line.at(slices, s)
    p, p_error = p_line.at(slices, s)
    column = {name: part[:, None] for name, part in bounds._asdict().items() if name != "lost"}
    ends = [_drive(g, s, y + z, y_error, column) for g in (column["low"], column["high"])]
    moved = [
        (s - n / column["margin"] * drive, n / column["margin"] * error, n)
        for drive, error in ends
        for n in sorted({1, 1 + bounds.lost})
    ]
    z_next = z + p / column["margin"]
    s_next = joined(*(one[0] for one in moved))
    s_error = joined(*(one[1] for one in moved))
    z_error = joined(*((p_error + one[2] * column["rate"]) / column["margin"] for one in moved))
    after = _around(s_next, s_error, joined(*[z_next] * len(moved)), z_error, scale)
    level, slope = y + z, (column["slope_low"], column["slope_high"])
    demand = larger(*(size(level + c * s) for c in slope)) + y_error
    speed = larger(*(largest(size(drive) + error) for drive, error in ends))
    reach = largest(size(level) + y_error), largest(demand), speed
    return after, Reach(*(upper(one) for one in reach))


def _drive(g: Any, s: Any, level: Any, y_error: Any, column: Any) -> tuple[Any, Any]:
    """The bracket of s⁺ at points, and its error, for one own gain."""
    c = (column["slope_high"] + column["slope_low"]) / 2.0
    c_error = (column["slope_high"] - column["slope_low"]) / 2.0
    error = g * (y_error + column["push"]) + column["noise"]
    error = error + size(1.0 - g) * (c_error * size(s) + column["error"])
    return g * level - (1.0 - g) * c * s, error


def _points(sets: Sets) -> tuple[Any, Any, Any, Array]:
    """Points with s ≥ 0 whose hull, slice by slice, is the set's half: s, ζ, their slices, and where slices end.

    They are the polygon's vertices, where adjacent edges meet, and the ends of its cuts at constant s. The polygon is
    inflated by far more than rounding moves them, so that they enclose the one that was given.
    """
    h, (S, Z) = INFLATION * sets.support, (sets.scale[:, :1], sets.scale[:, 1:])
    h_next = np.concatenate([h[:, 1:], h[:, :1]], axis=1)
    det = _D1 * _D2_NEXT - _D2 * _D1_NEXT
    s, z = (h * _D2_NEXT - h_next * _D2) / det, (_D1 * h_next - _D1_NEXT * h) / det
    flip = np.where(s < 0.0, -1.0, 1.0)
    cuts = h[:, :1] * _SLICES
    step = cuts[:, :, None] * _D1[1:]
    top = ((h[:, None, 1:] - step) / _D2[1:]).min(axis=2)
    bottom = -((h[:, None, 1:] + step) / _D2[1:]).min(axis=2)
    count = len(_SLICES) - 1
    inside = np.clip(np.searchsorted(_SLICES, flip * s / h[:, :1], side="right") - 1, 0, count - 1)
    of_cuts = np.broadcast_to(np.tile(np.arange(count), 4), (len(h), 4 * count))
    at = [cuts[:, :-1], cuts[:, :-1], cuts[:, 1:], cuts[:, 1:]]
    ends = [top[:, :-1], bottom[:, :-1], top[:, 1:], bottom[:, 1:]]
    s_all = S * np.concatenate([flip * s, *at], axis=1)
    z_all = Z * np.concatenate([flip * z, *ends], axis=1)
    return s_all, z_all, np.concatenate([inside, of_cuts], axis=1), S * cuts


def _lines(breaks: Array, bounds: Bounds) -> tuple[_Line, _Line]:
    """Lines around y and p over every slice, from concavity; with what lateness adds (lemma 2)."""
    kappa, late = bounds.kappa[:, None], bounds.late[:, None]
    start, end = breaks[:, :-1], breaks[:, 1:]
    near = larger(start - late, 0.0 * start)
    at_start, at_end, at_half = law(start, kappa), law(end, kappa), law(late / 2.0, kappa)
    steep, flat, steepest = slopes(start, kappa), slopes(end, kappa), slopes(near, kappa)
    lines = []
    for i in range(2):
        rise, width = at_end[i] - at_start[i], end - start
        slope = rise / width
        error = smaller(width * (steep[i] - flat[i]) / 4.0, rise) / 2.0
        shift = smaller(late * steepest[i], 2.0 * at_half[i])
        line = at_start[i] - slope * start + error
        lines.append(_Line(slope, line, error + shift + _ROUNDING * at_end[i]))
    return lines[0], lines[1]


def _around(s: Any, s_error: Any, z: Any, z_error: Any, scale: Array | None) -> Sets:
    """The polygon around boxes about points."""
    if scale is None:
        widest = largest(size(s) + s_error), largest(size(z) + z_error)
        scale = np.column_stack([upper(one) for one in widest])
    s, s_error = s / scale[:, :1], s_error / scale[:, :1]
    z, z_error = z / scale[:, 1:], z_error / scale[:, 1:]
    support = np.empty((len(scale), DIRECTIONS))
    for i, (d1, d2) in enumerate(zip(_D1, _D2, strict=True)):
        reach = size(d1 * s + d2 * z) + abs(d1) * s_error + d2 * z_error
        support[:, i] = upper(largest(reach))
    return Sets(support, scale)


def boxes(s: Array, z: Array) -> Sets:
    """Return sets with abs(s) and abs(ζ) bounded, each of shape (n,)."""
    support = np.abs(_D1) + np.abs(_D2)
    return Sets(np.tile(support, (len(s), 1)), np.column_stack([s, z]))
