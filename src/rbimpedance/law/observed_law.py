"""The law of a controller that observes the disturbance: surface and reaching term, without an integral of its own."""

from __future__ import annotations

import numpy as np

from .._common.arrays import Array

K1_OVER_ROOT_K2 = 2.2
"""As in the proposals for the whole law: k1² ≥ 4·k2, with room."""


def reaching_term(s: Array, bandwidth: Array, k2: Array) -> Array:
    """Return u of the super-twisting law, matched, with its integral left to the observer's disturbance.

    With H = 1/bandwidth and k1 = 2.2·√k2,

        u = (k1·abs(s)^½ + H·k2)·s/(abs(s) + H·k1·abs(s)^½ + H²·k2),

    which is bandwidth·s for small s, and grows like the root for large ones.

    Args:
        s: Sliding variable.
        bandwidth: Of the loop [rad/s].
        k2: Acceleration that the linear zone reaches to [rad/s² or m/s²].
    """
    H, size = 1.0 / bandwidth, np.abs(s)
    k1_root = K1_OVER_ROOT_K2 * np.sqrt(k2 * size)
    return (k1_root + H * k2) * s / (size + H * k1_root + H * H * k2)


def commanded(
    e1: Array, e2: Array, a_r: Array, bandwidth: Array, k2: Array, h: float
) -> tuple[Array, Array, Array]:
    """Return s, u and the commanded acceleration: s = e2 + ω·e1, a = a_r + (ω·e2 + u)/(1 + ω·h/2).

    Args:
        e1: Position error.
        e2: Velocity error.
        a_r: Acceleration of the impedance reference.
        bandwidth: ω [rad/s].
        k2: As for `reaching_term`.
        h: Period [s].
    """
    s = e2 + bandwidth * e1
    u = reaching_term(s, bandwidth, k2)
    return s, u, a_r + (bandwidth * e2 + u) / (1.0 + bandwidth * h / 2.0)
