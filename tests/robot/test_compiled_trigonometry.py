"""Cosines and sines against extended precision."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rbimpedance._numba.compile import kernel
from rbimpedance.robot.compiled.dynamics import OWN_VECTOR
from rbimpedance.robot.compiled.spatial import LARGEST_ANGLE, cosines_and_sines

Array = NDArray[np.float64]
UNIT = 2.0**-53


@functools.cache
def compiled() -> Callable[..., Any]:
    return kernel(_write, (OWN_VECTOR, OWN_VECTOR, OWN_VECTOR))


def _write(angles: Array, cosines: Array, sines: Array) -> int:
    cosines_and_sines(angles, cosines, sines)
    return 0


def both(angles: Array) -> tuple[Array, Array]:
    cosines, sines = np.empty_like(angles), np.empty_like(angles)
    compiled()(angles, cosines, sines)
    return cosines, sines


RANGES: dict[str, Callable[[np.random.Generator], Array]] = {
    "within a turn": lambda rng: rng.uniform(-np.pi, np.pi, 8000),
    "many turns": lambda rng: rng.uniform(-LARGEST_ANGLE, LARGEST_ANGLE, 8000),
    "tiny": lambda rng: rng.uniform(-1e-9, 1e-9, 800),
    "beside multiples of a quarter turn": lambda rng: (
        np.arange(-400, 400) * np.pi / 2.0 + rng.uniform(-1e-6, 1e-6, 800)
    ),
}


@pytest.mark.parametrize("name", RANGES)
def test_error_is_below_two_units(name: str, rng: np.random.Generator) -> None:
    angles = RANGES[name](rng)
    cosines, sines = both(angles)
    exact = angles.astype(np.longdouble)
    if exact.dtype.itemsize == angles.dtype.itemsize:
        pytest.skip("this machine has no extended precision")
    assert np.abs(cosines - np.cos(exact)).max() < 2.0 * UNIT
    assert np.abs(sines - np.sin(exact)).max() < 2.0 * UNIT


def test_zero_is_exact() -> None:
    cosines, sines = both(np.zeros(8))
    assert (cosines == 1.0).all()
    assert (sines == 0.0).all()


def test_angles_out_of_range_are_left_to_the_library() -> None:
    angles = np.array([2.0 * LARGEST_ANGLE, 1e12, 0.3, -1e9])
    cosines, sines = both(angles)
    assert cosines.tolist() == [float(np.cos(x)) for x in angles]
    assert sines.tolist() == [float(np.sin(x)) for x in angles]


def test_infinity_and_nan_give_nan() -> None:
    for bad in (np.inf, -np.inf, np.nan):
        angles = np.full(8, 0.5)
        angles[3] = bad
        cosines, sines = both(angles)
        assert np.isnan([cosines[3], sines[3]]).all()
        assert cosines[0] == pytest.approx(np.cos(0.5), rel=1e-15)
