"""The laws that a user has today, for one joint: what the model is to produce, the torque beside it, and s and u.

Each takes the quantities of a tick that its parameters before dt name, see `INPUTS`, and its gains after dt. It gives
the velocity w and the acceleration a that the model's torque is for, a torque that is added, the sliding variable s,
the acceleration u added to a_r, and the next integral. `control.baselines` says which torque of the model.
"""

# ruff: noqa: ARG001 (every formula takes dt)

from __future__ import annotations

import inspect
from typing import TypeAlias

from .formulas import Formula, clip, select, sign

INPUTS = ("e1", "e2", "integral", "v_d", "a_d", "v_r", "a_r", "restoring", "yielding")
"""Quantities of a tick: errors, integral, desired motion, impedance reference, the torque of the target's spring and
damper towards the desired motion, and the target's acceleration away from it."""

RESULTS = 6
"""How many numbers a formula gives."""

Results: TypeAlias = tuple[float, float, float, float, float, float]


def input_names(formula: Formula) -> tuple[str, ...]:
    """Return the names of the quantities that a formula takes, in its order."""
    names = list(inspect.signature(formula).parameters)
    return tuple(names[: names.index("dt")])


def computed_torque(a_d: float, a_r: float, yielding: float, dt: float) -> Results:
    """Accelerate as the target impedance does where the arm is."""
    a = a_d + yielding
    return 0.0, a, 0.0, 0.0, a - a_r, 0.0


def pd_gravity(restoring: float, dt: float) -> Results:
    """Spring and damper."""
    return 0.0, 0.0, restoring, 0.0, 0.0, 0.0


def pd_plus(v_d: float, a_d: float, restoring: float, dt: float) -> Results:
    """Spring and damper about the desired motion, whose torque is fed forward."""
    return v_d, a_d, restoring, 0.0, 0.0, 0.0


def switch(
    e1: float, e2: float, a_r: float, dt: float, surface_rate: float, gain: float
) -> Results:
    """First-order sliding mode with the sign of s = e2 + λ·e1."""
    s = e2 + surface_rate * e1
    u = gain * sign(s)
    return 0.0, a_r + surface_rate * e2 + u, 0.0, s, u, 0.0


def boundary_layer(
    e1: float,
    e2: float,
    a_r: float,
    dt: float,
    surface_rate: float,
    gain: float,
    width: float,
) -> Results:
    """The same with s/width, cut off at ±1."""
    s = e2 + surface_rate * e1
    u = gain * clip(s / width, -1.0, 1.0)
    return 0.0, a_r + surface_rate * e2 + u, 0.0, s, u, 0.0


def dead_zone(
    e1: float,
    e2: float,
    a_r: float,
    dt: float,
    surface_rate: float,
    gain: float,
    width: float,
) -> Results:
    """The same with nothing where abs(s) ≤ width."""
    s = e2 + surface_rate * e1
    u = gain * select(abs(s) > width, sign(s), 0.0)
    return 0.0, a_r + surface_rate * e2 + u, 0.0, s, u, 0.0


def slotine_li(
    e1: float,
    e2: float,
    v_r: float,
    a_r: float,
    dt: float,
    surface_rate: float,
    gain: float,
) -> Results:
    """Feed the reference forward that sliding follows, and add K_s·s."""
    s = e2 + surface_rate * e1
    return v_r + surface_rate * e1, a_r + surface_rate * e2, gain * s, s, 0.0, 0.0


def pid(
    e1: float,
    e2: float,
    integral: float,
    a_r: float,
    dt: float,
    k_p: float,
    k_d: float,
    k_i: float,
) -> Results:
    """A PID around the impedance reference."""
    u = k_p * e1 + k_d * e2 + k_i * integral
    return 0.0, a_r + u, 0.0, 0.0, u, integral + dt * e1
