"""Figures of docs/hardware-limits.md: the spectrum of the torque before and after, and the error over bits and lag."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance.pictures import figures

NOISY_JOINT = 1
"""The joint of the spectrum: the shoulder's second, which carries the arm."""


def draw_map(name: str, found: Mapping[str, Any], folder: Path) -> Path:
    """Draw the error over bits and lag.

    Args:
        name: Of the arm.
        found: Its map: bits, lags in s, and errors in rad; infinite where there is no proposal.
        folder: Where to.
    """
    milli = 1e3 * np.array(found["lags"])
    labels = "bits to a turn of the joint", "lag of the torque [ms]", f"abs(e1) of {name} [mrad]"
    errors = 1e3 * np.array(found["errors"])
    picture = figures.robustness_map(found["bits"], milli, errors, labels=labels)
    return figures.save(picture, folder / "hardware_map.png")


def draw_noise(runs: Mapping[str, rbi.SimulationResult], folder: Path) -> Path:
    """Draw the spectrum of a joint's torque under several laws.

    Args:
        runs: By what the law is called.
        folder: Where to.
    """
    return figures.save(figures.chatter_spectrum(runs, NOISY_JOINT), folder / "hardware_noise.png")
