"""What disturbs the loop of each joint while all joints move together: from physical bounds to those of `sampled_sets`.

Each G maps the demanded to the true acceleration of the joints. A joint is disturbed by the others through G, by its
surface's feed-forward where its own gain is not 1, by the rate of the acceleration that it has to hold, by late
measurements and by lost ticks (docs/theory.md, 9.1, where the terms have the numbers of the comments).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from .intervals import enclosed
from .sampled_sets import INFLATION, Bounds, Reach, Sets, tick
from .surfaces import FastTerminalSurface

_CELLS = np.linspace(0.0, 1.0, 9) ** 2


class Plants(NamedTuple):
    """Gains of groups of plants, with the largest entry of each group.

    Attributes:
        low: Smallest own gain, shape (groups, n).
        high: Largest own gain, shape (groups, n).
        cross: Largest abs(Gᵢⱼ)/Gᵢᵢ, zero for i = j, shape (groups, n, n).
        size: Largest abs(Gᵢⱼ), shape (groups, n, n).
    """

    low: Array
    high: Array
    cross: Array
    size: Array


class Loop(NamedTuple):
    """The controller and its surroundings; arrays have shape (n,).

    Attributes:
        k1: Gain of the root.
        k2: Gain of the integral.
        margin: Of the matched scheme.
        dt: Control period [s].
        surface: The sliding surface.
        plants: Their gains.
        rate: Bound on the rate of the acceleration that the integral has to hold [rad/s³].
        disturbance: Bound on that acceleration [rad/s²].
        delay: Ticks from a measurement to its torque.
        lost: Largest number of ticks in a row that are lost; the torque is held.
    """

    k1: Array
    k2: Array
    margin: Array
    dt: float
    surface: FastTerminalSurface
    plants: Plants
    rate: Array
    disturbance: Array
    delay: int
    lost: int

    @property
    def s_unit(self) -> Array:
        """H²·k2 with H = margin·h [rad/s]."""
        unit: Array = (self.margin * self.dt) ** 2 * self.k2
        return unit

    @property
    def a_unit(self) -> Array:
        """H·k2 [rad/s²]."""
        unit: Array = self.margin * self.dt * self.k2
        return unit

    @property
    def window(self) -> int:
        """Ticks whose bounds count at a tick."""
        return self.delay + self.lost + 1


class State(NamedTuple):
    """What is known at a tick; arrays beside the sets have shape (groups, n).

    Attributes:
        sets: Of (s, ζ), one for each joint of each group.
        s: Largest abs(s) [rad/s].
        e1: Largest abs(e1) [rad].
        a: Largest acceleration missing to the one needed, abs(A - A*) [rad/s²].
        speed: Largest abs(s⁺ - s)/h, [rad/s²].
    """

    sets: Sets
    s: Array
    e1: Array
    a: Array
    speed: Array


class Slope(NamedTuple):
    """The surface s = e2 + σ(e1) for abs(e1) ≤ E, arrays of the shape of E.

    Attributes:
        sigma: Largest abs(σ).
        low: Smallest slope c = σ'.
        high: Largest slope.
        product: Largest c·abs(σ).
        bend: Largest abs(dc/de1).
    """

    sigma: Array
    low: Array
    high: Array
    product: Array
    bend: Array


def slope_of(surface: FastTerminalSurface, e1: Array) -> Slope:
    """Return what the surface does for errors up to e1; its slope falls with abs(e1)."""
    cells = _CELLS.reshape(-1, *[1] * e1.ndim) * e1
    sigma, low = _sigma(surface, e1), _slope(surface, e1)
    product = (_slope(surface, cells[:-1]) * _sigma(surface, cells[1:])).max(axis=0)
    high = np.broadcast_to(surface.rate + surface.gamma * surface.inner_slope, e1.shape)
    bend = np.broadcast_to(2.0 * surface.gamma * np.abs(surface.inner_curve), e1.shape)
    return Slope(sigma, low, high, product, bend)


def _slope(surface: FastTerminalSurface, e1: Array) -> Array:
    return surface.terms(e1, np.ones_like(e1), 0.0)[1]


def _sigma(surface: FastTerminalSurface, e1: Array) -> Array:
    return surface.terms(e1, np.zeros_like(e1), 0.0)[0]


class Around(NamedTuple):
    """Bounds of a tick that follow from the state; arrays have shape (groups, n).

    Attributes:
        bounds: For the sets, flattened to one row a joint.
        missing: Largest acceleration Σⱼ Gᵢⱼ·(A - A*)ⱼ of e2.
        drift: What e1 gains from the change of A* within a period [rad].
        held: Part of A - A* beside y + ζ + c·s.
    """

    bounds: Bounds
    missing: Array
    drift: Array
    held: Array


def around(loop: Loop, state: State) -> Around:
    """Return what disturbs each joint in a state."""
    h, wait, plants = loop.dt, (loop.delay + loop.lost) * loop.dt, loop.plants
    slope = slope_of(loop.surface, state.e1)
    e2 = state.s + slope.sigma
    missing = _times(plants.size, state.a)
    drift = h**3 / 8.0 * (plants.size @ loop.rate)
    bent = np.minimum(slope.high - slope.low, slope.bend * (wait + h) * e2)  # (6)
    zoh = 1.0 + slope.high * h / 2.0
    unheld = (slope.high - slope.low) * h / 2.0 * loop.disturbance  # (5)
    waited = loop.lost * h * loop.rate * zoh
    push = _times(plants.cross, zoh * state.a) + unheld + waited / 2.0  # (3), (5)
    noise = bent * e2 + plants.high * slope.high * wait * missing + slope.high * drift / h  # (6)
    rows = {
        "low": plants.low * (1.0 - bent * h / 2.0) / INFLATION,  # (4)
        "high": plants.high * (1.0 + bent * h / 2.0) * INFLATION,
        "slope_low": slope.low * loop.margin * h,
        "slope_high": slope.high * loop.margin * h * INFLATION,
        "push": INFLATION * push / loop.a_unit,
        "error": INFLATION * (slope.product + bent * slope.sigma) / loop.a_unit,  # (2)
        "noise": INFLATION * noise / loop.a_unit,
        "rate": INFLATION * zoh * loop.rate / loop.k2,  # (7)
        "late": INFLATION * loop.delay * h * state.speed / loop.s_unit,  # (8)
        "kappa": loop.k1 / np.sqrt(loop.k2),
        "margin": loop.margin,
    }
    shape = state.s.shape
    flat = {name: np.broadcast_to(row, shape).ravel() for name, row in rows.items()}
    late = loop.delay * h * state.speed * slope.high
    held = slope.product + late + unheld + waited
    return Around(Bounds(**flat, lost=loop.lost), missing, drift, held)


def advance(loop: Loop, state: State, before: State, scale: Array | None = None) -> State:
    """Return what is known a tick later.

    Args:
        loop: The controller and its surroundings.
        state: What is known now.
        before: The largest bounds over the ticks that count now, in `s`, `e1`, `a` and `speed`.
        scale: Of the sets that are returned; what suits them by default.
    """
    given = around(loop, before)
    sets, reach = tick(state.sets, given.bounds, scale)
    sets = Sets(INFLATION * sets.support, sets.scale)
    reached = _seen(loop, sets, reach, _next_e1(loop, state.e1, before.s, given), given)
    return State(sets, *(INFLATION * bound for bound in reached[1:]))


def is_verified(loop: Loop, state: State, before: State, after: State) -> bool:
    """Whether a tick leads from one state into another, in interval arithmetic.

    Args:
        loop: The controller and its surroundings.
        state: What is known before the tick.
        before: The largest bounds over the ticks that count then.
        after: What is stated after it.
    """
    given = around(loop, before)
    rows = {name: enclosed(row) for name, row in given.bounds._asdict().items() if name != "lost"}
    sets, reach = tick(state.sets, Bounds(**rows, lost=loop.lost), after.sets.scale)
    reached = _seen(loop, sets, reach, _next_e1(loop, state.e1, before.s, given), given)
    return is_within(reached, after)


def is_within(reached: State, stated: State) -> bool:
    """Whether a state is part of another one, whose sets have the same scale."""
    pairs = [
        (reached.sets.support, stated.sets.support),
        *zip(reached[1:], stated[1:], strict=True),
    ]
    return all(bool((one <= other).all()) for one, other in pairs)


def _seen(loop: Loop, sets: Sets, reach: Reach, e1: Array, given: Around) -> State:
    shape = e1.shape
    demand, speed = reach.demand.reshape(shape), reach.speed.reshape(shape)
    a = demand * loop.a_unit + given.held
    return State(sets, sets.s.reshape(shape) * loop.s_unit, e1, a, speed * loop.a_unit)


def _next_e1(loop: Loop, e1: Array, s: Array, given: Around) -> Array:
    """abs(e1) after 1 to 1 + lost periods: e1⁺ = e1 - h·σ(e1) + h·s - h²/2·missing + drift, growing in e1 (9)."""
    h, after = loop.dt, []
    for _ in range(1 + loop.lost):
        gained = h * s + h**2 / 2.0 * given.missing + given.drift
        e1 = e1 - h * _sigma(loop.surface, e1) + gained
        after.append(e1)
    return np.maximum(after[0], after[-1])


def _times(matrix: Array, vector: Array) -> Array:
    """Matrices of groups times their vectors."""
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product
