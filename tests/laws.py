"""The controller that most tests run: plain gains, and any part another where a test is about it."""

from __future__ import annotations

from typing import Any

import rbimpedance as rbi

STIFF = rbi.Impedance(mass=1.0, damping=20.0, stiffness=100.0)


def controller(
    arm: rbi.ArmModel, k1: float = 8.0, k2: float = 10.0, dt: float = 1e-3, **changes: Any
) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        "surface": rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6),
        "reaching": rbi.SuperTwisting(k1, k2),
    }
    return rbi.ImpedanceController(arm, **(parts | changes), dt=dt)


def with_law(old: Any, reaching: rbi.SuperTwisting, **changes: Any) -> rbi.ImpedanceController:
    """The controller of a scenario with another reaching law."""
    assert isinstance(old, rbi.ImpedanceController)
    changes = {"model": old.model} | changes
    return rbi.ImpedanceController(old.arm, old.impedance, old.surface, reaching, old.dt, **changes)


def smooth(arm: rbi.ArmModel, dt: float = 1e-3, **changes: Any) -> rbi.ImpedanceController:
    """The same without the kink of its surface."""
    surface = rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6, smoothing=1e-3)
    return controller(arm, dt=dt, **({"surface": surface} | changes))
