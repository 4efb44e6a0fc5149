"""Plants within stated ranges, chosen to break a proposal: corners, designs of experiments, a search from the worst."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

import rbimpedance as rbi
from benchmarks.arms import Array
from rbimpedance.tuning import PlantSample, Uncertainty

JOINT_CORNERS, SPREAD = 6, 4
_TILT = np.sqrt(0.5)  # from the middle of both tilts' ranges to the largest angle


class Plants:
    """Plants of one uncertainty, each a point of its ranges.

    Args:
        unknown: The ranges.
        arm: The arm as it is modelled.
        seed: Of everything random.
    """

    def __init__(self, unknown: Uncertainty, arm: rbi.ArmModel, seed: int) -> None:
        self.unknown, self.arm, self.seed = unknown, arm, seed
        self.rng = np.random.default_rng(seed)
        self.size, nv = unknown.dimension(arm), arm.nv
        self.constants = slice(3 + 3 * nv, 3 + 4 * nv)

    def sample(self, share: Array) -> PlantSample:
        """The plant at a point."""
        return self.unknown.at(self.arm, share, seed=self.seed)

    def first(self) -> list[Array]:
        """All ends high, all low, alternating torque constants, worst tilts, random corners, points in between."""
        high, low = np.ones(self.size), np.zeros(self.size)
        points = [high, low, self._turned(high, 0.0), self._turned(low, 0.0)]
        for sign in (0, 1):  # torque constants and frictions alternate from joint to joint
            point = (high if sign else low).copy()
            alternating = (np.arange(self.arm.nv) + sign) % 2
            point[self.constants] = alternating
            points.append(point)
        for angle in np.arange(0.25, 4.0, 1.0) * np.pi / 2.0:
            points.append(self._turned(self._corner(), angle))
        points += [self._corner() for _ in range(JOINT_CORNERS)]
        return [*points, *qmc.LatinHypercube(self.size, rng=self.rng).random(SPREAD)]

    def near(self, worst: Array, count: int) -> list[Array]:
        """Points that differ from a bad one in some of its ends."""
        found = []
        for _ in range(count):
            flips = self.rng.uniform(size=self.size) < max(2.0 / self.size, 0.12)
            found.append(np.where(flips, self.rng.integers(2, size=self.size), worst))
        return found

    def _corner(self) -> Array:
        return self.rng.integers(2, size=self.size).astype(np.float64)

    def _turned(self, share: Array, angle: float) -> Array:
        """The same with the largest tilt, about an axis at this angle."""
        point = share.copy()
        point[-2:] = 0.5 + _TILT * np.array([np.cos(angle), np.sin(angle)])
        return point
