"""Proposals, and what becomes of them on plants that they have not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT
from rbimpedance.trajectories import Trajectory
from rbimpedance.tuning import GainProposal, PlantSample, Uncertainty, propose_gains
from rbimpedance.tuning.gain_design import DesignTask, design, measure_task
from rbimpedance.tuning.worst_case import controller_for, needed_variation, true_error

from .common import DURATION, LATE, SIMULATION, Figures, simulate


def run(proposal: GainProposal, sample: PlantSample, **limits: Any) -> Figures:
    """Put a proposal to the test on one plant."""
    figures: Figures = {"payload": sample.payload, "inertia_scale": sample.inertia_scale}
    try:
        result = simulate(
            sample.wrap(proposal.controller(**limits)),
            sample.plant,
            proposal.trajectory,
            q0=proposal.nominal.neutral,
            duration=DURATION,
        )
    except rbi.DivergenceError as error:
        infinite = dict.fromkeys(("error", "late", "last", "variation", "needed"), np.inf)
        return figures | infinite | {"diverged": error.joint, "saturated": 1.0}
    e1 = np.abs(true_error(sample.plant, result)).max(axis=1)
    late = result.t >= LATE
    needed = needed_variation(sample.plant, proposal.trajectory, result.t[late][::10])
    return figures | {
        "diverged": None,
        "error": float(e1[-1]),
        "late": float(e1[late].max()),
        "last": float(e1[result.t >= DURATION - 1.0].max()),
        "variation": float(result.metrics(after=LATE)["tau_variation"].sum()),
        "needed": float(needed.sum()),
        "saturated": float(result.saturated.any(axis=1).mean()),
    }


def propose(
    arm: rbi.ArmModel, unknown: Uncertainty, trajectory: Trajectory, dt: float = DT, **more: Any
) -> GainProposal:
    """The library's proposal, with the backend of this run."""
    proposal: GainProposal = propose_gains(arm, unknown, trajectory, dt, **SIMULATION, **more)
    return proposal


def knowing(plant: rbi.ArmModel, trajectory: Trajectory) -> dict[str, float]:
    """The same law with a controller that knows the plant: error and variation of the torque."""
    task = DesignTask(
        arm=plant,
        uncertainty=Uncertainty(),
        trajectory=trajectory,
        dt=DT,
        duration=DURATION,
        samples=1,
    )
    gains = design(task, measure_task(task))
    controller = controller_for(gains, DT, rbi.Impedance(1.0, 10.0, 20.0), None)
    result = simulate(controller, plant, trajectory, q0=plant.neutral, duration=DURATION)
    return {
        "error": float(np.abs(true_error(plant, result)[-1]).max()),
        "variation": float(result.metrics(after=LATE)["tau_variation"].sum()),
    }


def said(proposal: GainProposal) -> Figures:
    """What a proposal says, in figures."""
    mismatch = proposal.mismatch
    return {
        "arm": proposal.nominal.name,
        "feasible": proposal.feasible,
        "joint": proposal.joint,
        "reason": proposal.reason,
        "carried": proposal.payload,
        "rho": mismatch.rho,
        "gain": [mismatch.gain_low, mismatch.gain_high],
        "margin": float(proposal.margin[0]),
        "smoothing": float(getattr(proposal.surface, "smoothing", np.nan)),
        "predicted": float(proposal.error.max()),
    }


def summary(tests: Sequence[Mapping[str, Any]]) -> Figures:
    """The worst of several plants."""
    sound = [test for test in tests if test["diverged"] is None]
    return {
        "plants": len(tests),
        "diverged": len(tests) - len(sound),
        "error": max(test["error"] for test in tests),
        "median": float(np.median([test["error"] for test in tests])),
        "late": max(test["late"] for test in tests),
        "ratio": max((test["variation"] / test["needed"] for test in sound), default=np.inf),
    }
