"""The parts of the script: python -m benchmarks.tuning.robustness."""

from __future__ import annotations

from . import (
    achieved,
    bodies,
    common,
    contact,
    delay,
    estimators,
    far,
    gains,
    limits,
    variable,
)

_MODULES = (gains, limits, bodies, far, achieved, contact, delay, estimators, variable)

PARTS: dict[str, common.Part] = {name: part for m in _MODULES for name, part in m.PARTS.items()}
"""By the name that selects them."""
