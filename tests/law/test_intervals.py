"""Intervals enclose what exact arithmetic gives."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from rbimpedance.law.intervals import Interval, enclosed, larger, root, size, smaller


def _exact(x: float) -> Fraction:
    return Fraction(float(x))


@pytest.mark.parametrize("operation", ["__add__", "__sub__", "__mul__", "__truediv__"])
def test_an_operation_encloses_the_rational_result(operation: str) -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=300) * 10.0 ** rng.integers(-9, 9, 300), rng.normal(size=300)
    result = getattr(enclosed(a), operation)(enclosed(b))
    for x, y, low, high in zip(a, b, result.low, result.high, strict=True):
        true = getattr(_exact(x), operation)(_exact(y))
        assert _exact(low) < true < _exact(high)


def test_a_root_encloses_the_true_one() -> None:
    x = np.random.default_rng(0).uniform(0.0, 1e3, 300)
    result = root(enclosed(x))
    for number, low, high in zip(x, result.low, result.high, strict=True):
        assert _exact(low) ** 2 < _exact(number) < _exact(high) ** 2


def test_wide_intervals_hold_every_combination() -> None:
    a, b = Interval(np.array([-1.0]), np.array([2.0])), Interval(np.array([3.0]), np.array([4.0]))
    product, quotient, magnitude = a * b, a / b, size(a)
    assert product.low[0] <= -4.0
    assert product.high[0] >= 8.0
    assert quotient.low[0] <= -1.0 / 3.0
    assert quotient.high[0] >= 2.0 / 3.0
    assert (magnitude.low[0], magnitude.high[0]) == (0.0, 2.0)
    assert smaller(a, b).high[0] == 2.0
    assert larger(a, b).low[0] == 3.0


def test_an_array_on_the_left_gives_an_interval() -> None:
    assert isinstance(np.ones(2) * enclosed(np.ones(2)), Interval)
    assert isinstance(1.0 - enclosed(np.ones(2)), Interval)
