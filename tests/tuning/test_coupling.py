"""Diagonal stability: what it proves of coupled joints, against closed forms and exact arithmetic."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.tuning.coupling import common_weights, coupling_of
from rbimpedance.tuning.worst_case import usual_impedance

from .strongly_coupled import task_of

Array = NDArray[np.float64]


def is_positive_definite(matrix: list[list[Fraction]]) -> bool:
    """By elimination in exact arithmetic (all pivots positive)."""
    rows = [list(row) for row in matrix]
    for k in range(len(rows)):
        if rows[k][k] <= 0:
            return False
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return True


def holds_exactly(weights: Array, gain: Array) -> bool:
    d, G = [Fraction(x) for x in weights], [[Fraction(x) for x in row] for row in gain.tolist()]
    n = len(d)
    return is_positive_definite(
        [[d[i] * G[i][j] + d[j] * G[j][i] for j in range(n)] for i in range(n)]
    )


def of_two(arm: rbi.ArmModel, other: rbi.ArmModel, q: Array) -> Array:
    """G of two arms at a posture."""
    return np.asarray(np.linalg.solve(arm.mass_matrix(q), other.mass_matrix(q)), dtype=np.float64)


def test_one_matrix_of_two_joints_has_weights_exactly_where_its_minors_are_positive(
    rng: np.random.Generator,
) -> None:
    """The classical result for n = 2."""
    seen = set()
    for _ in range(300):
        G = rng.normal(size=(2, 2)) + 0.7 * np.eye(2)
        has_positive_minors = bool((np.diag(G) > 0.0).all() and np.linalg.det(G) > 0.0)
        if abs(np.linalg.det(G)) < 0.02 or np.abs(np.diag(G)).min() < 0.02:
            continue
        assert (common_weights(G[None]) is not None) == has_positive_minors
        seen.add(has_positive_minors)
    assert seen == {True, False}


@pytest.mark.parametrize("name", ["ur5", "kinova"])
def test_weights_hold_in_exact_arithmetic(name: str, rng: np.random.Generator) -> None:
    arm = rbi.load_robot(name, armature=0.1)
    plants = [arm, arm.with_payload(2.0), arm.with_payload(1.0).with_scaled_inertia(1.2)]
    postures = [arm.integrate(arm.neutral, rng.uniform(-1.5, 1.5, arm.nv)) for _ in range(4)]
    gains = np.array(
        [of_two(plant, arm.with_payload(0.8), q) for plant in plants for q in postures]
    )
    coupling = coupling_of(gains)
    assert coupling.weights is not None
    assert all(holds_exactly(coupling.weights, G) for G in gains)
    assert 0.0 < coupling.gain <= coupling.least


def test_weights_of_some_gains_hold_between_them(rng: np.random.Generator) -> None:
    gains = np.eye(4) + 0.2 * rng.normal(size=(20, 4, 4))
    weights = common_weights(gains)
    assert weights is not None
    for _ in range(50):
        mixed = np.tensordot(rng.dirichlet(np.ones(20)), gains, axes=1)
        assert holds_exactly(weights, mixed)


def test_rotated_joints_need_weights_that_differ() -> None:
    """G + Gᵀ is indefinite, D·G + Gᵀ·D is not: d₂/d₁ between 0.03 and 33."""
    G = np.array([[1.0, 3.0], [-0.3, 1.0]])
    weights = common_weights(G[None])
    assert np.linalg.eigvalsh(G + G.T)[0] < 0.0
    assert weights is not None
    assert holds_exactly(weights, G)


def test_gains_without_common_weights_are_not_proven_and_name_the_pair() -> None:
    """Each has weights, d₂/d₁ = 10 about and 0.1 about; no one pair suits both. The third joint is free."""
    one, other = np.eye(3), np.eye(3)
    one[0, 1], one[1, 0] = 8.0, -0.8
    other[0, 1], other[1, 0] = 0.8, -8.0
    assert all(common_weights(G[None]) is not None for G in (one, other))
    coupling = coupling_of(np.stack([one, other]))
    assert not coupling.is_proven
    assert set(coupling.pair) == {0, 1}
    assert np.isnan(coupling.gain)


def proposal_of(folder: Path, seed: int) -> rbi.GainProposal:
    """From a start 0.1 rad off the motion."""
    arm, unknown, motion = task_of(folder, seed)
    start: dict[str, Any] = {"q0": motion(0.0).q + 0.1, "duration": 2.0}
    proposal = rbi.propose_gains(arm, unknown, motion, 1e-4, remedy_time=0.0, instants=9, **start)
    assert isinstance(proposal, rbi.GainProposal)
    return proposal


def test_arm_whose_joint_answers_the_wrong_way_round_is_refused(tmp_path: Path) -> None:
    """The eigenvalues of G are between 1/3 and 3, and say nothing of it: the first joint's own gain is about -12.

    Plants around the worst simulated one are thrown by more than a radian, whatever k2 is.
    """
    refused = proposal_of(tmp_path, 34)
    assert refused.mismatch.rho < 3.0
    assert refused.coupling.least < -1.0
    assert not refused.coupling.is_proven
    assert not refused.feasible
    assert "'first' can answer its own torque the wrong way round" in refused.reason


def test_gains_that_throw_an_arm_on_its_way_are_made_firmer(tmp_path: Path) -> None:
    """It starts 0.1 rad off and settles either way; with a third of k2 it swings out to 0.5 before."""
    proposal = proposal_of(tmp_path, 4)
    assert proposal.feasible
    assert max(float(case.peak.max()) for case in proposal.worst) < 0.2
    k1, k2 = proposal.k1 / np.sqrt(3.0), proposal.k2 / 3.0
    reaching = rbi.SuperTwisting(k1, k2, "matched", proposal.margin)
    soft = rbi.ImpedanceController(
        proposal.arm, usual_impedance(), proposal.surface, reaching, proposal.dt
    )
    peaks = []
    for case in proposal.worst:
        q0, motion = case.result.q[0], proposal.trajectory
        run = rbi.simulate(soft, case.sample.plant, motion, q0=q0, duration=2.0)
        assert np.abs(run.e1[-1]).max() < 1e-3
        peaks.append(float(np.abs(run.e1).max()))
    assert max(peaks) > 0.4


@pytest.mark.slow
def test_accepted_arms_with_strongly_coupled_joints_are_not_thrown(tmp_path: Path) -> None:
    """Most are refused; accepted ones run with plants that the proposal has not seen."""
    accepted = 0
    for seed in range(100, 180):
        proposal = proposal_of(tmp_path, seed)
        if not proposal.feasible:
            continue
        accepted += 1
        law, q0 = proposal.controller(), proposal.trajectory(0.0).q + 0.1
        for sample in proposal.uncertainty.corners(proposal.nominal, 4, seed=seed + 1):
            run = rbi.simulate(law, sample.plant, proposal.trajectory, q0=q0, duration=2.0)
            assert (np.abs(run.e1).max(axis=0) <= proposal.peak).all()
    assert accepted >= 5
