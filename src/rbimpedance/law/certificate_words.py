"""Messages of a certificate: why a guarantee is missing, and the remedy."""

from __future__ import annotations

import math

import numpy as np

from .lyapunov import Law, admissible_rate
from .surfaces import FastTerminalSurface, PowerSurface, Surface

ASSUMPTIONS = (
    "This holds in continuous time, with s measured exactly, for a controller that applies the "
    "torque it computes (no limit reached), and as long as each joint's disturbance changes no "
    "faster than its d_max; it may not jump. With a wrong mass matrix the disturbance contains the "
    "controller's own output, whose rate has no bound where s crosses zero, and no d_max holds. A "
    "sampled controller keeps s in a band around zero that shrinks with its period. All times are "
    "upper bounds."
)


def settled(surface: Surface | None) -> str:
    """Say what the surface calls settled."""
    if surface is None:
        return "unknown without a surface"
    if isinstance(surface, FastTerminalSurface):
        radius = ", ".join(f"{value:.4g}" for value in np.unique(surface.smoothing))
        return f"abs(e1) is within the smoothing radius ({radius}), and shrinks exponentially there"
    if isinstance(surface, PowerSurface):
        return "never in finite time, e1 decays like t^(-1/(p-1))"
    return f"as {type(surface).__name__}.sliding_time defines it"


def why_theorem_fails(surface: Surface | None) -> str:
    """Say why the reaching law has no bound on this surface."""
    return (
        f"on {type(surface).__name__} s is not of the form φ(e1) + e2, so the reaching law acts on "
        "s with a gain that depends on the state and Theorem 1 gives no reaching time; it does "
        "with FastTerminalSurface"
    )


def why_infeasible(law: Law) -> str:
    """Report what the gains tolerate and which gains would tolerate the disturbance."""
    k1, k2, d_max = law.k1, law.k2, law.d_max
    limit = float(admissible_rate(np.array(k1), np.array(k2)))
    fact = f"k1 = {k1:.4g} and k2 = {k2:.4g} tolerate any disturbance rate below {limit:.4g}"
    if k2 <= d_max:
        remedy = f"raise k2 above {d_max:.4g}, and k1 to at least 2·√k2"
    else:
        needed = 2.0 * math.sqrt(k2 * (1.0 - math.sqrt(1.0 - law.rho**2)))
        remedy = f"raise k1 above {needed:.4g}"
    return f"{fact}, and d_max is {d_max:.4g}; {remedy}"


def why_unsettled(surface: Surface | None) -> str:
    """Say why e1 has no finite time although s has one."""
    name = type(surface).__name__
    if isinstance(surface, PowerSurface):
        name += ", where it decays like t^(-1/(p-1))"
    return (
        f"only s reaches zero in finite time, e1 does not on {name}; FastTerminalSurface brings "
        "it to its smoothing radius in finite time"
    )
