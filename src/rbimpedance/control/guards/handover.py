"""How a controller takes an arm over in the middle of a motion: its state, as if it had just been brought there."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..._common.arrays import Array
from ...trajectories import Reference


class Situation(Protocol):
    """What is known of the arm at a handover."""

    @property
    def q(self) -> Array:
        """Configuration, shape (nq,)."""

    @property
    def v(self) -> Array:
        """Velocity, shape (nv,)."""

    @property
    def tau(self) -> Array:
        """Motor torque of the tick before, shape (nv,)."""

    @property
    def tau_ext(self) -> Array:
        """Torque of the environment, shape (nv,)."""

    @property
    def reference(self) -> Reference:
        """Desired motion."""


def takes_period(controller: object) -> bool:
    """Tell whether a controller's `step` takes a measured period."""
    return hasattr(controller, "elapsed")


def handed_over(controller: Any, state: Any, now: Situation) -> Any:
    """Return the state with which a controller takes over without a jump of its reference.

    The impedance filter starts from where the arm is: q_e = q (-) q_d, v_e = v - v_d, so that q_r = q and v_r = v. The
    integrator keeps what it knows of the load. The state of a guard around the controller is changed inside; one that
    has no filter starts anew.

    Args:
        controller: The controller.
        state: Its last state.
        now: The arm at this tick.
    """
    if hasattr(state, "inner"):
        inner = handed_over(controller.controller, state.inner, now)
        moved = {
            name: np.zeros_like(now.v) for name in ("q_g", "v_g", "a_g") if name in state._fields
        }
        return state._replace(inner=inner, **moved)
    if not hasattr(state, "q_e"):
        return controller.init()
    q_e = controller.arm.raw_dynamics.difference(now.reference.q, now.q)
    v_e = now.v - now.reference.v
    known = {
        "q_e": q_e,
        "v_e": v_e,
        "x": np.zeros_like(v_e),  # s = 0 there
        "a": np.zeros_like(v_e),
        "tau": now.tau,
        "tau_ext": now.tau_ext,
        "q_e_before": q_e,
        "v_e_before": v_e,
    }
    if hasattr(state, "z"):
        known["z_before"] = state.z
    return state._replace(**{name: x for name, x in known.items() if name in state._fields})
