"""One physics step of the plant on its configuration manifold, under a held motor torque."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from ..._common.arrays import Array
from ...robot.pinocchio_dynamics import PinocchioDynamics

Integrator: TypeAlias = Literal["semi-implicit", "rk4"]
"""How the plant is integrated."""

Acceleration: TypeAlias = Callable[[float, Array, Array], Array]
"""a(t, q, v) of the plant, shape (nv,)."""

State: TypeAlias = tuple[Array, Array]


def semi_implicit_euler(
    dynamics: PinocchioDynamics, acceleration: Acceleration, t: float, q: Array, v: Array, h: float
) -> State:
    """Return q and v after h by semi-implicit Euler: v⁺ = v + h·a, q⁺ = q (+) h·v⁺. First order."""
    v = v + h * acceleration(t, q, v)
    return dynamics.integrate(q, h * v), v


def runge_kutta_4(
    dynamics: PinocchioDynamics, acceleration: Acceleration, t: float, q: Array, v: Array, h: float
) -> State:
    """Return q and v after h by the classical Runge-Kutta method in the tangent space at q. Fourth order.

    Joints with one degree of freedom are commutative groups, so no correction terms are due on the manifold.
    """
    v1, a1 = v, acceleration(t, q, v)
    v2 = v + h / 2.0 * a1
    a2 = acceleration(t + h / 2.0, dynamics.integrate(q, h / 2.0 * v1), v2)
    v3 = v + h / 2.0 * a2
    a3 = acceleration(t + h / 2.0, dynamics.integrate(q, h / 2.0 * v2), v3)
    v4 = v + h * a3
    a4 = acceleration(t + h, dynamics.integrate(q, h * v3), v4)
    q_next = dynamics.integrate(q, h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4))
    return q_next, v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


INTEGRATORS = {"semi-implicit": semi_implicit_euler, "rk4": runge_kutta_4}
"""The integrators by name."""
