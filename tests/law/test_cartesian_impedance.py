"""The target at the tool: rates by finite differences, power, compliance, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.linalg import eigvals, expm
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.law.cartesian_impedance import CartesianFilter, Displacement
from rbimpedance.law.rotations import RotationVector, hat

Array = NDArray[np.float64]
TURNED = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
AXES: dict[str, Any] = {"world": "world", "reference": "reference", "turned": TURNED}
WRENCH = np.array([6.0, -3.0, 9.0, 0.5, -0.8, 0.4])


def six_by_six(rng: np.random.Generator) -> Array:
    root = rng.normal(size=(6, 6))
    matrix: Array = root @ root.T + 2.0 * np.eye(6)
    return matrix


def desired(t: float) -> rbi.CartesianReference:
    """A motion with rotation about a moving axis; rates in closed form."""
    first, second = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.6, 0.8])
    f, df, ddf = np.sin(t), np.cos(t), -np.sin(t)
    g, dg, ddg = 0.7 * t + 0.2 * t * t, 0.7 + 0.4 * t, 0.4
    R1, R2 = Rotation.from_rotvec(f * first), Rotation.from_rotvec(g * second)
    turned = R1.apply(second)
    omega = df * first + dg * turned
    alpha = ddf * first + ddg * turned + np.cross(df * first, dg * turned)
    p, v = np.array([np.sin(t), t * t, 0.3]), np.array([np.cos(t), 2.0 * t, 0.0])
    a = np.array([-np.sin(t), 2.0, 0.0])
    pose = rbi.Pose((R1 * R2).as_matrix(), p)
    return rbi.CartesianReference(pose, np.r_[v, omega], np.r_[a, alpha])


def in_continuous_time(
    target: rbi.CartesianImpedance, pulled: Array, start: Displacement, t: float
) -> Displacement:
    """The displacement after t under a constant ŵ, by the matrix exponential."""
    M, D, K = target.linear.matrices(6)
    A = np.zeros((18, 18))
    A[:6, 6:12], M_inverse = np.eye(6), np.linalg.inv(M)
    A[6:12] = M_inverse @ np.hstack([-K, -D, np.eye(6)])
    y = expm(A * t) @ np.concatenate([*start, pulled])
    return Displacement(y[:6], y[6:12])


@pytest.mark.parametrize("axes", AXES)
def test_velocity_and_acceleration_of_the_reference_are_its_derivatives(
    axes: str, rng: np.random.Generator
) -> None:
    target = rbi.CartesianImpedance(
        six_by_six(rng), 10.0 * six_by_six(rng), six_by_six(rng), axes=AXES[axes]
    )
    flt, h, t = target.filter(1e-3), 1e-4, 0.4
    start = Displacement(
        np.array([0.1, -0.2, 0.05, 0.9, -0.6, 0.4]), np.array([0.3, 0.1, -0.2, 1.0, -0.5, 0.7])
    )
    pulled = flt.pulled_back(start, desired(t), WRENCH)

    def at(dt: float) -> rbi.CartesianReference:
        return flt.reference(in_continuous_time(target, pulled, start, dt), desired(t + dt), pulled)

    before, now, after = at(-h), at(0.0), at(h)
    linear = (after.pose.translation - before.pose.translation) / (2.0 * h)
    spin = (after.pose.rotation - before.pose.rotation) / (2.0 * h) @ now.pose.rotation.T
    assert_allclose(now.v[:3], linear, atol=1e-6)
    assert_allclose(hat(now.v[3:]), spin, atol=1e-6)
    assert_allclose(now.a, (after.v - before.v) / (2.0 * h), rtol=1e-6, atol=3e-6)


@pytest.mark.parametrize("axes", AXES)
def test_power_of_the_pulled_back_wrench_is_that_of_force_and_moment_at_any_angle(
    axes: str, rng: np.random.Generator
) -> None:
    flt = rbi.CartesianImpedance((2.0, 0.1), (100.0, 5.0), axes=AXES[axes]).filter(1e-3)
    still = rbi.CartesianReference(desired(0.7).pose, np.zeros(6), np.zeros(6))
    for angle in (0.0, 0.5, 3.0, 6.2):
        axis = rng.normal(size=3)
        xi = np.r_[rng.normal(size=3), angle * axis / np.linalg.norm(axis)]
        now = Displacement(xi, rng.normal(size=6))
        pulled = flt.pulled_back(now, still, WRENCH)
        motion = flt.reference(now, still, pulled)
        assert_allclose(pulled @ now.rate, WRENCH @ motion.v, rtol=1e-12)


def test_a_moment_that_turns_the_reference_by_more_than_half_a_turn_puts_no_energy_out() -> None:
    """A moment turns round with the reference; the work that it does never comes back as more."""
    target = rbi.CartesianImpedance((2.0, 0.1), (100.0, 1.0), (10.0, 0.05))
    flt, still = target.filter(2e-4), desired(0.0)._replace(v=np.zeros(6), a=np.zeros(6))
    M, _, K = target.linear.matrices(6)
    now, work, farthest = Displacement(np.zeros(6), np.zeros(6)), 0.0, 0.0
    for k in range(10000):
        wrench = np.r_[0.0, 0.0, 0.0, 2.0, 0.5, -1.0] * np.sin(4.0 * k * 2e-4)
        pulled = flt.pulled_back(now, still, wrench)
        following = flt.advance(now, pulled)
        mean = Displacement((now.xi + following.xi) / 2.0, (now.rate + following.rate) / 2.0)
        work += 2e-4 * float(flt.pulled_back(mean, still, wrench) @ mean.rate)
        now = following
        stored = (now.rate @ M @ now.rate + now.xi @ K @ now.xi) / 2.0
        farthest = max(farthest, float(np.linalg.norm(now.xi[3:])))
        assert stored < work + 1e-3
    assert np.pi < farthest < 2.0 * np.pi


@pytest.mark.parametrize("axes", AXES)
def test_a_constant_force_displaces_by_the_compliance_in_its_axes(axes: str) -> None:
    stiffness = np.array([1000.0, 800.0, 200.0, 30.0, 20.0, 10.0])
    target = rbi.CartesianImpedance((3.0, 0.15), stiffness, axes=AXES[axes])
    still = desired(0.9)._replace(v=np.zeros(6), a=np.zeros(6))
    flt, now, force = target.filter(1e-2), Displacement(np.zeros(6), np.zeros(6)), WRENCH.copy()
    force[3:] = 0.0
    for _ in range(2000):
        now = flt.advance(now, flt.pulled_back(now, still, force))
    moved = flt.reference(now, still, flt.pulled_back(now, still, force)).pose.translation
    R_c = {"world": np.eye(3), "reference": still.pose.rotation, "turned": TURNED}[axes]
    wanted = R_c @ ((R_c.T @ force[:3]) / stiffness[:3])
    assert_allclose(moved - still.pose.translation, wanted, atol=1e-12)


@pytest.mark.parametrize("axes", ["reference", "turned"])
def test_reference_turns_with_the_world(axes: str) -> None:
    """Everything given in a turned world, compliance axes included, gives the reference of that world."""
    Q = Rotation.from_rotvec([1.1, 0.4, -0.9]).as_matrix()
    both = np.asarray(np.kron(np.eye(2), Q), dtype=np.float64)
    now = Displacement(np.array([0.1, -0.2, 0.05, 0.9, -0.6, 0.4]), np.linspace(-1.0, 1.0, 6))
    stiffness = [900.0, 500.0, 100.0, 20.0, 30.0, 10.0]

    def reference(turn: Array, pair: Array) -> rbi.CartesianReference:
        given: Any = "reference" if axes == "reference" else turn @ TURNED
        flt = rbi.CartesianImpedance((3.0, 0.2), stiffness, axes=given).filter(1e-3)
        (R, p), v, a = desired(0.6)
        there = rbi.CartesianReference(rbi.Pose(turn @ R, turn @ p), pair @ v, pair @ a)
        return flt.reference(now, there, flt.pulled_back(now, there, pair @ WRENCH))

    here, turned = reference(np.eye(3), np.eye(6)), reference(Q, both)
    assert_allclose(turned.pose.rotation, Q @ here.pose.rotation, atol=1e-13)
    assert_allclose(turned.pose.translation, Q @ here.pose.translation, atol=1e-13)
    assert_allclose(turned.v, both @ here.v, atol=1e-12)
    assert_allclose(turned.a, both @ here.a, atol=1e-11)


def test_a_pair_means_translation_and_rotation() -> None:
    pair = rbi.CartesianImpedance((3.0, 0.15), (1000.0, 30.0))
    six = rbi.CartesianImpedance(np.repeat([3.0, 0.15], 3), np.diag(np.repeat([1000.0, 30.0], 3)))
    for a, b in zip(pair.linear.matrices(6), six.linear.matrices(6), strict=True):
        assert_allclose(a, b, rtol=1e-12)


def test_damping_ratio_is_that_of_every_mode(rng: np.random.Generator) -> None:
    target = rbi.CartesianImpedance(six_by_six(rng), six_by_six(rng), damping_ratio=0.7)
    M, D, K = target.linear.matrices(6)
    A = np.block([[np.zeros((6, 6)), np.eye(6)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    poles = np.asarray(eigvals(A), dtype=np.complex128)
    assert_allclose(-poles.real / np.abs(poles), 0.7, rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"mass": 3.0}, rbi.DimensionError, "a pair"),
        ({"mass": (3.0, -0.1)}, rbi.ParameterError, "positive"),
        ({"stiffness": np.ones(3)}, rbi.DimensionError, "six numbers"),
        ({"stiffness": -np.eye(6)}, rbi.ParameterError, "positive definite"),
        ({"damping": (1.0, 1.0), "damping_ratio": 1.0}, rbi.ParameterError, "one damping"),
        ({"axes": "tool"}, rbi.ParameterError, "reference"),
        ({"axes": 2.0 * np.eye(3)}, rbi.DimensionError, "rotation matrix"),
        ({"axes": np.diag([1.0, 1.0, -1.0])}, rbi.DimensionError, "right-handed"),
    ],
)
def test_refusals_say_what_would_be_right(given: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        rbi.CartesianImpedance(**({"mass": (3.0, 0.1), "stiffness": (100.0, 5.0)} | given))


def test_a_longer_step_is_two_steps() -> None:
    flt: CartesianFilter = rbi.CartesianImpedance((3.0, 0.15), (900.0, 30.0)).filter(1e-3)
    now, pulled = Displacement(np.linspace(0.0, 0.5, 6), np.ones(6)), np.arange(6.0)
    twice, once = flt.advance(flt.advance(now, pulled), pulled), flt.advance(now, pulled, 2e-3)
    assert_allclose(once.xi, twice.xi, rtol=1e-12)
    assert_allclose(once.rate, twice.rate, rtol=1e-12)


def test_error_of_the_target_is_its_residual() -> None:
    flt = rbi.CartesianImpedance((3.0, 0.15), (900.0, 30.0), (40.0, 2.0)).filter(1e-3)
    e1, e2, e3 = np.eye(6)[0], np.eye(6)[1], np.eye(6)[5]
    assert_allclose(flt.error(e1, e2, e3), [900.0, 40.0, 0.0, 0.0, 0.0, 0.15])


def test_displacement_of_half_a_turn_is_that_rotation() -> None:
    flt = rbi.CartesianImpedance((3.0, 0.15), (900.0, 30.0)).filter(1e-3)
    xi = np.r_[np.zeros(3), 0.0, np.pi, 0.0]
    still = rbi.CartesianReference(rbi.Pose(np.eye(3), np.zeros(3)), np.zeros(6), np.zeros(6))
    pose = flt.reference(Displacement(xi, np.zeros(6)), still, np.zeros(6)).pose
    assert_allclose(pose.rotation, np.diag([-1.0, 1.0, -1.0]), atol=1e-15)
    assert_allclose(RotationVector(xi[3:]).matrix, pose.rotation, atol=1e-15)
