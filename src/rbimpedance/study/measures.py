"""Measures of a run: deviation of the arm from the desired behaviour, and torque variation."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from .._common.arrays import Array
from ..simulation.result import SimulationResult
from ..simulation.sampling import sample
from ..trajectories import Trajectory
from ..trajectories.reference import difference_each, integrate_each
from .definition import Task

Figures: TypeAlias = dict[str, Any]
"""Columns of the table by name."""


def measure(result: SimulationResult, task: Task, trajectory: Trajectory, after: float) -> Figures:
    """Return the figures of one run, from the true motion of the arm.

    `e1_*`: error to the controller's own reference q_r, from the true q. `deviation_*`: distance of the true motion
    from `target_motion`, which no controller has a part in. `e_im_*`: impedance error as the controller logs it, with
    the errors that it sees. `max` is over joints and time, `rms` over both, `e1_end` the largest at the last tick.

    Args:
        result: The run.
        task: What its controller was made for.
        trajectory: Desired motion.
        after: Leave out the samples before this time [s].

    Raises:
        ParameterError: Fewer than two samples remain.
    """
    kept = result.samples_after(after)
    e1 = difference_each(task.arm, result.q, result.q_r)[kept]
    deviation = difference_each(task.arm, result.q, target_motion(result, task, trajectory))[kept]
    e_im, tau = result.e_im[kept], result.tau[kept]
    span = result.t[kept][-1] - result.t[kept][0]
    worst = int(np.argmax(np.abs(deviation).max(axis=0)))
    return {
        "e1_max": _largest(e1),
        "e1_rms": _rms(e1),
        "e1_end": _largest(e1[-1]),
        "e_im_max": _largest(e_im),
        "e_im_rms": _rms(e_im),
        "deviation_max": _largest(deviation),
        "deviation_rms": _rms(deviation),
        "worst_joint": result.joint_names[worst],
        "tau_variation": float(np.abs(np.diff(tau, axis=0)).sum() / span),
        "tau_peak": _largest(tau),
        "tau_rms": _rms(tau),
        "saturated": float(result.saturated[kept].any(axis=1).mean()),
    }


def target_motion(result: SimulationResult, task: Task, trajectory: Trajectory) -> Array:
    """Return the motion of the target impedance under the true torque of the environment, shape (N, nq).

    q* = q_d (+) q_e with M_d a_e + D_d v_e + K_d q_e = tau_ext from rest, and the logged tau_ext
    held from tick to tick.

    Args:
        result: The run.
        task: What its controller was made for.
        trajectory: Desired motion.
    """
    arm = task.arm
    target = task.impedance.filter(arm.nv, result.provenance["dt"])
    q_e, v_e = np.zeros(arm.nv), np.zeros(arm.nv)
    deflection = np.empty_like(result.tau_ext)
    for k, tau_ext in enumerate(result.tau_ext):
        deflection[k] = q_e
        q_e, v_e = target.advance(q_e, v_e, tau_ext)
    q_d = np.broadcast_to(sample(arm, trajectory, result.t).q, result.q.shape)
    return integrate_each(arm, q_d, deflection)


def _largest(values: Array) -> float:
    return float(np.abs(values).max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
