"""Joint matrices from what a frame should feel, against finite differences and the pull of a spring."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.linalg import null_space

import rbimpedance as rbi
from rbimpedance.robot.cartesian import geometric_stiffness, joint_matrix

from ..arms import ARMS, manipulator

Array = NDArray[np.float64]
STEP = 1e-6


def positive_definite(rng: np.random.Generator, size: int) -> Array:
    root = rng.normal(size=(size, size))
    matrix: Array = root @ root.T + np.eye(size)
    return matrix


def slope(arm: rbi.ArmModel, q: Array, torque: Callable[[Array], Array]) -> Array:
    """∂torque/∂q by central differences on the manifold."""
    columns = [
        (torque(arm.integrate(q, STEP * e)) - torque(arm.integrate(q, -STEP * e))) / (2.0 * STEP)
        for e in np.eye(arm.nv)
    ]
    return np.column_stack(columns)


@pytest.mark.parametrize(("name", "size"), [("manipulator", 6), ("manipulator", 3), ("spinner", 3)])
def test_frame_feels_exactly_the_matrix_that_was_asked_for(
    name: str, size: int, rng: np.random.Generator
) -> None:
    arm = ARMS[name]()
    q, wanted = arm.random_configuration(rng), positive_definite(rng, size)
    A = joint_matrix(arm, q, wanted, posture=3.0)
    J = arm.jacobian(q)[:size]
    assert_allclose(np.linalg.inv(J @ np.linalg.inv(A) @ J.T), wanted, rtol=1e-8)
    rbi.Impedance(1.0, 1.0, A)  # symmetric positive definite


def test_motions_that_leave_the_frame_feel_the_posture(rng: np.random.Generator) -> None:
    arm = manipulator()
    q = arm.random_configuration(rng)
    A = joint_matrix(arm, q, positive_definite(rng, 3), posture=3.0)
    hidden = null_space(arm.jacobian(q)[:3])
    assert hidden.shape == (6, 3)
    assert_allclose(A @ hidden, 3.0 * hidden, atol=1e-10)


def test_frame_moves_as_mass_damper_and_spring_alone(rng: np.random.Generator) -> None:
    arm = manipulator()
    q = arm.random_configuration(rng)
    M_x, D_x, K_x = (positive_definite(rng, 3) for _ in range(3))
    M, D, K = (joint_matrix(arm, q, X, posture=2.0) for X in (M_x, D_x, K_x))
    J, omega = arm.jacobian(q)[:3], 7.0j
    felt = J @ np.linalg.inv(M * omega**2 + D * omega + K) @ J.T
    assert_allclose(felt, np.linalg.inv(M_x * omega**2 + D_x * omega + K_x), rtol=1e-8)


@pytest.mark.parametrize("name", ["manipulator", "spinner"])
@pytest.mark.parametrize("frame", [None, "inner"])
def test_geometric_stiffness_is_the_slope_of_the_torque_of_a_held_wrench(
    name: str, frame: str | None, rng: np.random.Generator
) -> None:
    arm = ARMS[name]()
    frame = None if frame is None else {"manipulator": "elbow_body", "spinner": "carriage"}[name]
    q, wrench = arm.random_configuration(rng), rng.normal(size=6)
    expected = -slope(arm, q, lambda at: arm.external_torque(at, wrench, frame))
    found = geometric_stiffness(arm, q, wrench, frame)
    assert np.abs(expected).max() > 0.01
    assert_allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("name", ["manipulator", "spinner"])
def test_stretched_spring_has_both_terms(name: str, rng: np.random.Generator) -> None:
    arm = ARMS[name]()
    q, K_x = arm.random_configuration(rng), 100.0 * positive_definite(rng, 3)
    anchor = arm.frame_placement(q)[1] + [0.05, -0.03, 0.08]

    def torque(at: Array) -> Array:
        _, place = arm.frame_placement(at)
        pull: Array = arm.jacobian(at)[:3].T @ K_x @ (anchor - place)
        return pull

    J = arm.jacobian(q)[:3]
    force = K_x @ (anchor - arm.frame_placement(q)[1])
    stiffness = J.T @ K_x @ J + geometric_stiffness(arm, q, [*force, 0.0, 0.0, 0.0])
    expected = -slope(arm, q, torque)
    scale = np.abs(expected).max()
    assert_allclose(stiffness, expected, rtol=0.0, atol=1e-7 * scale)
    assert np.abs(geometric_stiffness(arm, q, [*force, 0, 0, 0])).max() > 1e-3 * scale


def test_frame_that_cannot_move_so_is_refused() -> None:
    arm = ARMS["spinner"]()
    with pytest.raises(
        rbi.ParameterError, match=r"^q must be a configuration whose Jacobian has rank 6"
    ):
        joint_matrix(arm, arm.neutral, np.eye(6), posture=1.0)
    straight = rbi.load_robot("two_link")  # moves in a plane only
    with pytest.raises(rbi.ParameterError, match="rank 3"):
        joint_matrix(straight, [0.3, 0.4], np.eye(3), posture=1.0)


def test_mimicking_joints_are_refused() -> None:
    arm = ARMS["follower"]()
    with pytest.raises(rbi.UnsupportedJointError) as caught:
        geometric_stiffness(arm, arm.neutral, np.ones(6))
    assert caught.value.joints == ("follow",)


@pytest.mark.parametrize(
    ("wanted", "posture", "error", "words"),
    [
        (np.eye(4), 1.0, rbi.DimensionError, r"^wanted must be a matrix \(3, 3\) or \(6, 6\)"),
        (-np.eye(3), 1.0, rbi.ParameterError, r"^wanted must be symmetric positive definite"),
        (np.triu(np.ones((3, 3))), 1.0, rbi.ParameterError, r"^wanted must be symmetric"),
        (np.full((3, 3), np.nan), 1.0, rbi.ParameterError, r"^wanted must be symmetric"),
        (np.eye(3), 0.0, rbi.ParameterError, r"^posture must be"),
    ],
)
def test_unusable_request_is_refused(
    wanted: Array, posture: float, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        joint_matrix(manipulator(), np.full(6, 0.3), wanted, posture=posture)
