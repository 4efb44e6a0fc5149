"""Percentiles of durations, and their ratios to those of a yardstick."""

from __future__ import annotations

import numpy as np

from rbimpedance._common.arrays import Array

from .report import RATIO

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


def percentiles(durations: Array) -> dict[str, float]:
    """Return p50, p99, p99.9 and max [µs]."""
    return {
        f"{name} [µs]": float(np.percentile(durations, share))
        for name, share in PERCENTILES.items()
    }


def ratios(durations: Array, yardstick: Array, name: str = "rnea") -> dict[str, float]:
    """Return p50, p99 and p99.9 as shares of the same percentile of the yardstick."""
    return {
        f"{RATIO} {name} {point}": float(
            np.percentile(durations, share) / np.percentile(yardstick, share)
        )
        for point, share in PERCENTILES.items()
        if point != "max"
    }


def median(durations: Array) -> float:
    """Return the median [µs]."""
    return float(np.median(durations))
