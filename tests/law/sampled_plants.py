"""Closed loops that are as bad as their bounds allow: joints coupled by a gain, late measurements, lost ticks."""

from __future__ import annotations

import numpy as np

from rbimpedance.law.super_twisting import SuperTwisting
from rbimpedance.law.surfaces import FastTerminalSurface

Array = np.ndarray


def adversarial_errors(
    reaching: SuperTwisting,
    surface: FastTerminalSurface,
    dt: float,
    gains: Array,
    rate: Array,
    *,
    disturbance: float = 0.0,
    e0: float = 0.0,
    delay: int = 0,
    lost: int = 0,
    loss: float = 1.0,
    ticks: int = 1500,
    seed: int = 0,
) -> tuple[Array, Array]:
    """Return e1 and s over time, shape (ticks, n).

    The plant is exact: a held acceleration A moves e2 by -h·G·(A - A*). G changes at random times among `gains`; A*
    starts at ± disturbance and moves at its largest rate, away from s, or the other way, or as it was, at random times.
    """
    rng = np.random.default_rng(seed)
    n = len(rate)
    e1, e2 = e0 * rng.choice([-1.0, 1.0], n), np.zeros(n)
    needed = disturbance * rng.choice([-1.0, 1.0], n)
    start = surface.value(e1, e2)
    state = reaching.start(start)
    seen = [(e1.copy(), e2.copy())] * (delay + 1)
    a, missed = np.zeros(n), lost
    G, way, mode = gains[0], rng.choice([-1.0, 1.0], n), 0
    e1_log, s_log = [], []
    for k in range(ticks):
        s = surface.value(e1, e2)
        e1_log.append(e1)
        s_log.append(s)
        seen = [*seen[1:], (e1, e2)]
        is_lost = k > 0 and missed < lost and rng.random() < loss
        missed = missed + 1 if is_lost else 0
        if not is_lost:
            at = surface.terms(*seen[0], dt)
            u, state = reaching.step(at[0], state, dt)
            a = (at[1] + u) / at[2]
        if rng.random() < 0.05:
            G, mode, way = (
                gains[rng.integers(len(gains))],
                int(rng.integers(3)),
                rng.choice([-1.0, 1.0], n),
            )
        way = {0: -np.sign(s) + (s == 0.0), 1: way, 2: np.sign(s) + (s == 0.0)}[mode]
        before, needed = needed, needed + dt * rate * way
        bound = max(disturbance, 1e9) if disturbance == 0.0 else 1e9
        needed = np.clip(needed, -bound, bound)
        missing = G @ (a - (before + needed) / 2.0)
        e1 = e1 + dt * e2 - dt**2 / 2.0 * missing
        e2 = e2 - dt * missing
    return np.array(e1_log), np.array(s_log)
