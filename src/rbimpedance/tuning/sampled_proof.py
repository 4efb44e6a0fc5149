"""A proof for proposed gains: the certificate of the sampled loop over the plants and motions of the proposal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from .._common.arrays import Array
from ..law.sampled_certificate import SampledCertificate, certify_sampled
from ..law.surfaces import Surface
from ..robot.arm_model import ArmModel
from ..robot.pinocchio_dynamics import COULOMB_SMOOTHING
from ..trajectories import Reference, Trajectory
from .mismatch import measure_with_gains
from .motions import Motion, MotionMargin, sample_motions
from .plant_sample import PlantSample
from .uncertainty import Uncertainty

SAMPLES, INSTANTS = 12, 13
"""Plants, as many corners of the ranges on top, and instants of the motion."""

GROUPS = 3
"""Groups of plants with similar gains: the fewer plants a group has, the less its gains vary."""


class ProposedGains(Protocol):
    """What a proof needs of a proposal; see `GainProposal`."""

    nominal: ArmModel
    arm: ArmModel
    uncertainty: Uncertainty
    trajectory: Trajectory
    dt: float
    duration: float
    surface: Surface
    k1: Array
    k2: Array
    margin: Array


def prove(
    proposal: Any, *, lost: int = 0, spread: MotionMargin | None = None, seed: int = 0
) -> SampledCertificate:
    """Certify proposed gains for sampled plants, on the motion and with an integral that holds what it needs.

    Args:
        proposal: See `ProposedGains`.
        lost: Ticks in a row that may be lost.
        spread: How far motions leave the trajectory.
        seed: Of plants and motions.

    Raises:
        ParameterError: The surface is not a `FastTerminalSurface`.
    """
    given: ProposedGains = proposal
    arm, dt, spread = given.nominal, given.dt, MotionMargin() if spread is None else spread
    motions = sample_motions(arm, given.trajectory, given.duration, dt, INSTANTS, seed, spread)
    samples = given.uncertainty.sample(arm, SAMPLES, seed=seed)
    samples += given.uncertainty.corners(arm, SAMPLES, seed=seed)
    gains = [measure_with_gains(given.arm, [sample], motions, dt)[1] for sample in samples]
    rate = np.max([_needed_rate(given.arm, sample, motions, dt) for sample in samples], axis=0)
    loop: dict[str, Any] = {
        "surface": given.surface,
        "dt": dt,
        "margin": given.margin,
        "lost": lost,
    }
    delay = given.uncertainty.delay
    return certify_sampled(given.k1, given.k2, _grouped(gains), rate, delay=delay, **loop)


def _grouped(gains: Sequence[Array]) -> list[Array]:
    """Groups of plants whose own gains are similar, by their sum."""
    own = [float(np.trace(G, axis1=1, axis2=2).mean()) for G in gains]
    order = np.array_split(np.argsort(own), min(GROUPS, len(gains)))
    return [np.concatenate([gains[i] for i in part]) for part in order]


def _needed_rate(
    model: ArmModel, sample: PlantSample, motions: Sequence[Motion], dt: float
) -> Array:
    """Largest rate of A* = (κ·M_model)⁻¹·(torque that the model misses), reversals of dry friction included.

    Smoothed dry friction reverses at the rate coulomb·abs(a)/smoothing at most, at an instant that need not be sampled.
    """
    unknown = np.abs(sample.plant.coulomb - sample.torque_constant * model.coulomb)
    largest = np.zeros(model.nv)
    for now, then in motions:
        M = sample.torque_constant[:, None] * model.raw_dynamics.mass_matrix(now.q)
        before, after = (_missed(model, sample, motion) for motion in (now, then))
        inverse = np.linalg.inv(M)
        reversal = np.abs(inverse) @ (unknown * np.abs(now.a) / COULOMB_SMOOTHING)
        largest = np.maximum(largest, np.abs(inverse @ (after - before)) / dt + reversal)
    return largest


def _missed(model: ArmModel, sample: PlantSample, motion: Reference) -> Array:
    asked = sample.torque_constant * model.raw_dynamics.inverse_dynamics(*motion)
    missed: Array = sample.plant.raw_dynamics.inverse_dynamics(*motion) - asked
    return missed
