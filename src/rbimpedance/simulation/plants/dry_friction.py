"""Coulomb's friction with Stribeck's rise towards standstill, as impulses over a step."""

from __future__ import annotations

import numpy as np

from ..._common.arrays import Array

STRIBECK_SPEED = 0.05
"""Speed at which the rise has fallen to 37 % [rad/s or m/s]."""

ROUNDS = 6
"""Passes over the joints in a step; one would do if the joints were not coupled."""


AT_REST = 1e-6
"""Speed up to which a joint counts as resting [rad/s or m/s]."""


def sliding_friction(dry: Array, viscous: Array, v: Array) -> Array:
    """Return the friction of joints that slide; none where they rest.

    Args:
        dry: Coulomb friction.
        viscous: Viscous friction.
        v: Velocity.
    """
    return dry * np.sign(v) * (np.abs(v) > AT_REST) + viscous * v


def rub(
    v: Array, A: Array, dry: Array, viscous: Array, p: Array, stribeck: float, rounds: int
) -> int:
    """Let friction act over a step: change v by A·p, with p the impulses of friction (projected Gauss-Seidel).

    Of every joint either sticks, v = 0 with abs(p) ≤ dry, or slides, p = -(dry + viscous·abs(v))·sgn(v).

    Args:
        v: Velocity without friction, shape (nv,); becomes that with friction.
        A: M⁻¹, shape (nv, nv).
        dry: Largest impulse of Coulomb friction, h·tau_c, shape (nv,).
        viscous: h·d, shape (nv,).
        p: Work space, shape (nv,).
        stribeck: Rise of dry friction towards standstill.
        rounds: Passes over the joints.
    """
    n = len(v)
    for i in range(n):
        p[i] = 0.0
    for _ in range(rounds):
        for i in range(n):
            free = v[i] - A[i, i] * p[i]
            rise = 1.0 + stribeck * np.exp(-((v[i] / STRIBECK_SPEED) ** 2))
            slows = A[i, i] * dry[i] * rise
            left = max(abs(free) - slows, 0.0) / (1.0 + A[i, i] * viscous[i])
            v_next = left if free > 0.0 else -left
            change = (v_next - free) / A[i, i] - p[i]
            p[i] += change
            for j in range(n):
                v[j] += A[j, i] * change
    return 0
