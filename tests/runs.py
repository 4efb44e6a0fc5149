"""Results for tests of what is done with them: by hand, with nothing simulated, and of an arm that is pushed."""

from __future__ import annotations

from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance import ArmModel, SimulationResult
from rbimpedance._common.arrays import Array
from rbimpedance.control.provenance import provenance
from rbimpedance.control.telemetry import FLAGS
from rbimpedance.interaction import Push
from rbimpedance.trajectories import cosine

PUSH = Push([5.0, -3.0, 8.0, 0.5, 0.2, -0.3], 0.2, 0.6)


class _NoController:
    dt = 0.01


def swung(
    arm: ArmModel, *, duration: float = 1.0, lead: float = 0.3, force: Array | None = None
) -> SimulationResult:
    """Return a run in which every joint swings by 0.2 rad or m and the reference leads by `lead`.

    Args:
        arm: The arm.
        duration: Length [s].
        lead: q_r (-) q of every joint [rad or m].
        force: Constant force at the tool [N], shape (3,).
    """
    t = np.arange(round(100.0 * duration) + 1) / 100.0
    ones = np.ones(arm.nv)
    swing = [np.sin(2.0 * np.pi * time / max(duration, 1e-9)) / 5.0 for time in t]
    q = np.array([arm.integrate(arm.neutral, x * ones) for x in swing])
    wrench = np.zeros(6) if force is None else np.append(force, np.zeros(3))
    zeros = np.zeros((len(t), arm.nv))
    flags: Any = {name: zeros.astype(np.bool_) for name in FLAGS}
    return SimulationResult(
        t=t,
        q=q,
        v=zeros,
        q_r=np.array([arm.integrate(x, lead * ones) for x in q]),
        e1=zeros + lead,
        e2=zeros,
        e_im=zeros,
        s=zeros,
        tau=zeros,
        tau_ext=np.array([arm.external_torque(x, wrench) for x in q]),
        provenance=provenance(_NoController(), arm),
        plant=arm,
        **flags,
    )


def pushed_swing(
    arm: ArmModel, dt: float, plant: ArmModel | None = None, **settings: Any
) -> SimulationResult:
    """A second of a swing under PD+ that `PUSH`, or another environment, disturbs."""
    swing = cosine(arm, amplitude=0.3, period=2.0)
    usual: dict[str, Any] = {"environment": PUSH, "substeps": 2, "integrator": "rk4"}
    return rbi.simulate(
        rbi.baselines.PDPlus(arm, rbi.Impedance(1.0, 20.0, 100.0), dt),
        arm if plant is None else plant,
        swing,
        q0=swing(0.0).q,
        duration=1.0,
        **(usual | settings),
    )
