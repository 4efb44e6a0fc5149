"""Errors far beyond the stated range: a start 2 rad off with gains proposed for 0.2 rad, and a bounded surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import ARMS, DT, Array, load
from benchmarks.pages import markdown, power
from rbimpedance.trajectories import cosine
from rbimpedance.tuning import Uncertainty
from rbimpedance.tuning.torque_demand import Exertion
from rbimpedance.tuning.worst_case import true_error

from .common import Figures, Job, Options, Part, as_rows, simulate
from .trials import propose

STATED = 0.2  # rad
START = 2.0  # rad
LENGTH = 8.0  # s


def far(name: str, seed: int) -> Figures:
    """The most strenuous plant from 2 rad off, with the proposed surface and with a bounded one."""
    arm = load(name)
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=1.1)
    usual = cosine(arm, amplitude=STATED, period=6.0)
    proposal = propose(arm, unknown, usual, DT, seed=seed)
    controller = proposal.controller()
    bounded = rbi.ImpedanceController(
        controller.arm,
        controller.impedance,
        rbi.BoundedSurface(controller.surface, STATED),
        controller.reaching,
        DT,
    )
    plant = unknown.sample(arm, 1)[0].plant
    away = cosine(
        arm, center=arm.integrate(arm.neutral, np.full(arm.nv, START)), amplitude=STATED, period=6.0
    )
    limited = rbi.ImpedanceController(
        controller.arm,
        controller.impedance,
        bounded.surface,
        controller.reaching,
        DT,
        limits=arm.effort_limit,
    )
    there = Exertion(unknown.extremes(arm), away, LENGTH).demand(rbi.Limits(arm.effort_limit))
    return {
        "arm": name,
        "share": float(there.share.max()),
        "stated speed": float(np.max(bounded.surface.speed(np.full(arm.nv, STATED)))),
        "unbounded": _approach(controller, plant, away),
        "bounded": _approach(bounded, plant, away),
        "limited": _approach(limited, plant, away),
    }


def _approach(controller: rbi.ImpedanceController, plant: rbi.ArmModel, trajectory: Any) -> Figures:
    """How fast the arm comes, and where it is in the end."""
    try:
        result = simulate(controller, plant, trajectory, q0=plant.neutral, duration=LENGTH)
    except rbi.DivergenceError as error:
        return {"diverged": error.joint, "at": error.time}
    e1: Array = np.abs(true_error(plant, result)).max(axis=1)
    beyond = np.flatnonzero(e1 > STATED)
    return {
        "diverged": None,
        "speed": float(np.abs(result.e2).max()),
        "torque": float(np.abs(result.tau).max()),
        "arrives": float(result.t[beyond[-1]]) if len(beyond) else 0.0,
        "error": float(e1[-1]),
    }


def jobs(options: Options) -> list[Job]:
    """All arms."""
    return [Job(far, (name, options.seed)) for name in options.arms]


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Unbounded, bounded, and bounded within the effort limits."""
    forms = ("unbounded", "bounded", "limited")
    rows = [
        (
            row["arm"],
            f"{row['stated speed']:.2f}",
            *(_cell(row[form]) for form in forms),
            f"{row['share']:.0%}",
        )
        for row in data["rows"]
    ]
    figures = "largest abs(e2) [rad/s], torque [N·m]; within 0.2 rad after [s]; error at 8 s [rad]"
    header = (
        *("arm", "speed of the surface at 0.2 rad [rad/s]", f"unbounded: {figures}"),
        *("bounded", "bounded, within the effort limits of the description"),
        "of which the motion there needs",
    )
    return {"far": markdown(header, rows)}


def _cell(one: Mapping[str, Any]) -> str:
    if one["diverged"]:
        return f"diverges at {one['at']:.2g} s"
    figures = f"{one['speed']:.1f}, {one['torque']:.0f}; {one['arrives']:.1f}"
    return f"{figures}; {power(one['error'])}"


PARTS = {"far": Part(jobs, as_rows, tables)}
