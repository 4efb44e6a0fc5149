"""The exponential map of SO(3): against its own power series in extended precision, SciPy, and finite differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rbimpedance.law.rotations import SMALL, RotationVector, coefficients, cross, hat

Array = NDArray[np.float64]
PI = float(np.pi)
ANGLES = (0.0, 1e-12, 1e-6, 1e-3, 0.05, 0.3, SMALL, 2.0, PI - 1e-9, PI, PI + 0.1, 5.0, 6.2)
AXIS = np.array([0.36, -0.48, 0.8])


def power_series(phi: Array, first: int) -> Array:
    """Σ [φ]^k/(k + first)!: exp(φ) with first = 0, J_l(φ) with first = 1."""
    P: Any = hat(phi).astype(np.longdouble)
    term: Any = np.eye(3, dtype=np.longdouble)
    for i in range(1, first + 1):
        term = term / i
    total = term.copy()
    for k in range(1, 80):
        term = term @ P / (k + first)
        total = total + term
    result: Array = total.astype(np.float64)
    return result


def central(function: object, x: Array, rate: Array, h: float = 1e-6) -> Array:
    difference: Array = (function(x + h * rate) - function(x - h * rate)) / (2.0 * h)  # type: ignore[operator]
    return difference


@pytest.mark.parametrize("angle", ANGLES)
def test_rotation_and_left_jacobian_are_their_power_series(angle: float) -> None:
    phi = RotationVector(angle * AXIS)
    assert_allclose(phi.matrix, power_series(phi.phi, 0), atol=4e-15)
    assert_allclose(phi.left, power_series(phi.phi, 1), atol=4e-15)
    assert_allclose(phi.right, power_series(-phi.phi, 1), atol=4e-15)
    assert_allclose(phi.matrix, Rotation.from_rotvec(phi.phi).as_matrix(), atol=4e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_inverse_jacobians_are_inverses(angle: float) -> None:
    phi = RotationVector(angle * AXIS)
    size = np.abs(phi.left_inverse).max()
    assert_allclose(phi.left_inverse @ phi.left, np.eye(3), atol=2e-15 * size * 3.0)
    assert_allclose(phi.right_inverse @ phi.right, np.eye(3), atol=2e-15 * size * 3.0)


@pytest.mark.parametrize("angle", [a for a in ANGLES if a > 1e-3])
def test_rates_are_those_of_finite_differences(angle: float) -> None:
    x, rate = angle * AXIS, np.array([0.7, 0.2, -0.4])
    phi = RotationVector(x)
    left = central(lambda y: RotationVector(y).left, x, rate)
    inverse = central(lambda y: RotationVector(y).left_inverse, x, rate)
    assert_allclose(phi.left_rate(rate), left, atol=1e-9)
    assert_allclose(phi.left_inverse_rate(rate), inverse, rtol=1e-6, atol=1e-9)


def test_rates_at_zero_are_half_the_cross_product() -> None:
    rate, phi = np.array([0.7, 0.2, -0.4]), RotationVector(np.zeros(3))
    assert_allclose(phi.left_rate(rate), hat(rate) / 2.0, atol=1e-15)
    assert_allclose(phi.left_inverse_rate(rate), -hat(rate) / 2.0, atol=1e-15)


def test_series_and_closed_forms_meet() -> None:
    below = coefficients(np.nextafter(SMALL, 0.0))
    assert_allclose(below, coefficients(SMALL), rtol=2e-14)


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_angular_velocity_is_the_left_jacobian_times_the_rate(numbers: list[float]) -> None:
    x, rate = np.array(numbers[:3]), np.array(numbers[3:])
    turned = central(lambda y: RotationVector(y).matrix, x, rate) @ RotationVector(x).matrix.T
    assert_allclose(hat(RotationVector(x).left @ rate), turned, atol=2e-8)


def test_hat_is_the_cross_product(rng: np.random.Generator) -> None:
    x, y = rng.normal(size=(2, 3))
    assert_allclose(hat(x) @ y, np.cross(x, y), atol=1e-15)
    assert_allclose(cross(x, y), np.cross(x, y), atol=1e-15)
