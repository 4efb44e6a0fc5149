"""The sampled loop about s = 0 when the plant answers with a wrong gain: how much of that a margin tolerates.

About s = 0 the matched scheme is linear: with H = margin·h it gives u = (2/H)·s + W, W⁺ = W + (h/H²)·s. The plant
answers an acceleration A with G·A, G = M_true⁻¹·M_model, which has real positive eigenvalues. With one margin for all
joints the loop decouples along the eigenvectors of G, for any k1 and k2 of each joint, and each part is the
loop of this module with one eigenvalue g for a gain. Away from s = 0 the scheme's gain u/s only falls.
"""

from __future__ import annotations

import numpy as np

from .._common.arrays import Array

LARGEST_MARGIN = 100.0
"""Margins beyond it are not looked for: the loop would be a hundred periods slow."""

_GAINS = 7
_BISECTIONS = 30


def loop_matrix(g: float, margin: float, delay: int, slope_step: float) -> Array:
    """Return the transition matrix of one period for the state (e1/h, e2, h·W) and its delayed copies.

    Args:
        g: Input gain.
        margin: Of the matched scheme.
        delay: Ticks from a measurement to its torque.
        slope_step: Slope c of the surface at e1 = 0 times the period.

    Returns:
        The matrix, shape (3 + 2·delay, 3 + 2·delay).
    """
    size = 3 + 2 * delay
    late = slice(size - 2, size) if delay else slice(0, 2)  # (e1/h, e2) as the controller sees them
    law = np.zeros(size)  # h times the demanded acceleration
    law[late] = [2.0 / margin * slope_step, slope_step + 2.0 / margin]
    law[2] = 1.0
    law /= 1.0 + slope_step / 2.0
    step = np.zeros((size, size))
    step[0] = -g / 2.0 * law
    step[0, :2] += 1.0
    step[1] = -g * law
    step[1, 1] += 1.0
    step[2, 2] = 1.0
    step[2, late] += np.array([slope_step, 1.0]) / margin**2
    for i in range(delay):
        source = 0 if i == 0 else 1 + 2 * i
        step[3 + 2 * i, source], step[4 + 2 * i, source + 1] = 1.0, 1.0
    return step


def is_stable(g: float, margin: float, delay: int, slope_step: float) -> bool:
    """Whether the loop with this input gain is stable; see `loop_matrix`."""
    return _are_stable(loop_matrix(g, margin, delay, slope_step)[None], slope_step)


def tolerates(margin: float, low: float, high: float, delay: int, slope_step: float) -> bool:
    """Whether a margin keeps the loop stable for every input gain in [low, high]; see `needed_margin`."""
    gains = np.exp(np.linspace(np.log(low), np.log(high), _GAINS)).tolist()
    loops = np.stack([loop_matrix(g, margin, delay, slope_step) for g in gains])
    return _are_stable(loops, slope_step)


def _are_stable(loops: Array, slope_step: float) -> bool:
    """Whether all loops are stable, from their matrices, shape (N, n, n)."""
    values = np.linalg.eigvals(loops)
    sizes = np.abs(values)
    if (
        slope_step == 0.0
    ):  # where the surface is flat e1 is a mere integral, which nothing depends on
        rows = np.arange(len(loops))
        sizes[rows, np.abs(values - 1.0).argmin(axis=1)] = 0.0
    return bool(sizes.max() < 1.0)


def needed_margin(low: float, high: float, delay: int, slope_step: float) -> float:
    """Return the smallest margin with which every input gain in [low, high] is stable; infinite if there is none.

    Args:
        low: Smallest gain, positive.
        high: Largest gain.
        delay: Ticks from a measurement to its torque.
        slope_step: Slope of the surface at e1 = 0 times the period.
    """

    def enough(margin: float) -> bool:
        return tolerates(margin, low, high, delay, slope_step)

    if enough(1.0):
        return 1.0
    if not enough(LARGEST_MARGIN):
        return np.inf
    below, above = 0.0, np.log(LARGEST_MARGIN)
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2.0
        below, above = (below, middle) if enough(float(np.exp(middle))) else (middle, above)
    return float(np.exp(above))


def gain_limit(low: float, margin: float, delay: int, slope_step: float) -> float:
    """Return the largest input gain that a margin tolerates; without delay and slope 4·margin²/(4·margin - 1).

    Args:
        low: A gain that it tolerates.
        margin: Of the matched scheme.
        delay: Ticks from a measurement to its torque.
        slope_step: Slope of the surface at e1 = 0 times the period.
    """
    below, above = np.log(low), np.log(1e4)
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2.0
        stable = is_stable(float(np.exp(middle)), margin, delay, slope_step)
        below, above = (middle, above) if stable else (below, middle)
    return float(np.exp(below))
