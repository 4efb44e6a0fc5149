"""How gains are checked before they are proposed: certificate, torque limits, and the worst samples in simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..law.certificate import Certificate, certify
from ..law.impedance import Impedance
from .gain_design import Design, DesignTask, Measured, design
from .scan import Scan, scan
from .stated import Stated, stated
from .torque_demand import TorqueDemand
from .torque_limits import demand_of, exertion_of, refused_for_torque, without_reserve
from .worst_case import ExtremeCase, worst_cases

SLOWER, FIRMER, ROUNDS = 1.6, 3.0, 4
"""Factors by which the margin grows where a worst sample chatters or diverges, and k2 where one keeps an error or goes
astray, and how often that is tried."""


class Checked(NamedTuple):
    """A design, and what its checks found.

    Attributes:
        design: The gains; with a joint and a reason where they are refused.
        certificate: Theorem 1 for the effective gains; None where the margin is infinite.
        worst: The simulated worst samples.
        demand: What the motion asks of the joints against their limits; None where there are none.
        stated: What is stated of the closed loop.
    """

    design: Design
    certificate: Certificate | None
    worst: tuple[ExtremeCase, ...]
    demand: TorqueDemand | None
    stated: Stated


def solve(task: DesignTask, measured: Measured, impedance: Impedance, q0: Array) -> Checked:
    """Design gains and simulate the worst samples; slower where one of them chatters, firmer where one keeps an error.

    Args:
        task: The requirements.
        measured: Bounds over the samples.
        impedance: Target impedance of the simulations.
        q0: Initial configuration, shape (nq,).
    """
    exertion = None if task.limits is None else exertion_of(task, measured.samples)
    slower, firmer, certificate = 1.0, 1.0, None
    worst: tuple[ExtremeCase, ...] = ()
    scanned: Scan | None = None
    for _ in range(ROUNDS):
        found = design(task, measured, slower=slower, firmer=firmer)
        if np.isfinite(found.margin):
            certificate = _certificate(task, found, q0)
            found = _certified(task, found, certificate)
        demand = None if exertion is None else demand_of(task, exertion, found)
        if demand is not None and not demand.feasible:
            found = refused_for_torque(task, found, demand)
        if found.joint is not None:
            so_far = f"{worst[-1].reason}, and with other gains, " if worst else ""
            found = replace(found, reason=so_far + found.reason)
            break
        scanned = scan(task, found, impedance, q0)
        more = () if scanned is None else scanned.worst
        worst = _until_failure(worst_cases(task, found, impedance, q0, demand, more))
        failed = worst[-1]
        if failed.joint is None:
            break
        found = replace(found, joint=failed.joint, reason=failed.reason)
        if demand is not None and not demand.with_reserve:
            found = without_reserve(task, found, demand)
        if failed.unstable:
            slower *= SLOWER
        elif not failed.result.saturated.any():
            firmer *= FIRMER
        else:
            break
    found = _with_coupling(task, found)
    return Checked(
        found, certificate, worst, demand, stated(task, found, certificate, worst, scanned)
    )


def _with_coupling(task: DesignTask, found: Design) -> Design:
    """The design; where it is refused, with the joint whose own input gain can be negative in its reason."""
    coupling = found.measured.coupling
    if found.joint is None or coupling is None or coupling.least > 0.0:
        return found
    words = (
        f"; joint '{task.arm.joint_names[coupling.joint]}' can answer its own torque the wrong way round: with "
        f"{coupling.least:.2g} times the acceleration that the model expects, while the other joints are free"
    )
    return replace(found, reason=found.reason + words)


def _until_failure(cases: Iterator[ExtremeCase]) -> tuple[ExtremeCase, ...]:
    """The cases up to the first one that failed, that one included."""
    seen = []
    for case in cases:
        seen.append(case)
        if case.joint is not None:
            break
    return tuple(seen)


def _certificate(task: DesignTask, found: Design, q0: Array) -> Certificate:
    """Theorem 1 for the gains that are left at the smallest input gain, from the start of the motion."""
    mismatch, start = found.measured.mismatch, task.trajectory(0.0)
    e1 = task.arm.raw_dynamics.difference(q0, start.q)
    return certify(
        mismatch.gain_low * found.k1,
        mismatch.gain_low * found.k2,
        mismatch.disturbance_rate,
        s0=found.surface.value(e1, np.asarray(start.v)),
        disturbance0=mismatch.disturbance,
        surface=found.surface,
        e0=e1,
    )


def _certified(task: DesignTask, found: Design, certificate: Certificate) -> Design:
    """The design, refused where Theorem 1 does not hold."""
    if certificate.feasible.all() or found.joint is not None:
        return found
    joint = int(np.argmin(certificate.feasible))
    reason = (
        f"joint '{task.arm.joint_names[joint]}' has no certificate: {certificate.reason[joint]}"
    )
    return replace(found, joint=joint, reason=reason)
