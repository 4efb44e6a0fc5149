"""Eight numbers at once in compiled code: every lane is what the same code gives for one float."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import types
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
import rbimpedance._numba.power
from rbimpedance._numba.compile import fused, inline, kernel
from rbimpedance._numba.lanes import WIDTH, any_of, first_lane, select
from rbimpedance._numba.layouts.lane_arrays import LANE_MATRIX, LANE_VECTOR, lane_array
from rbimpedance.robot.compiled import rigid_body
from rbimpedance.robot.compiled.dynamics import ARM, OWN_INTEGERS, OWN_VECTOR, SPACE
from rbimpedance.robot.compiled.rigid_body import place_joints
from rbimpedance.robot.compiled.tables import ArmTables, Workspace, arm_tables, workspace

from .. import arms

Array = NDArray[np.float64]

SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 1e-310])


@fused
def arithmetic(a: float, b: float) -> float:
    return (a * b + 2.0) / (abs(b) + 1.0) - max(a, 1) * min(b, -a)


@fused
def roots_and_signs(a: float, b: float) -> float:
    return math.sqrt(abs(a)) + math.copysign(math.floor(b), a)


@fused
def conditions(a: float, b: float) -> float:
    chosen: float = select((a > b) | (b == 0.0), -a, select((a <= 1.0) & (b != 2.0), b, 0.5))
    return chosen


@inline
def library(a: float, b: float) -> float:
    return math.cos(a) + math.sin(b) * math.tanh(a) - math.atan2(a, b)


FUNCTIONS = (arithmetic, roots_and_signs, conditions, library)


def on_vectors(function: Any, kind: types.Type) -> Callable[..., Any]:
    def loop(a: Array, b: Array, result: Array) -> int:
        for i in range(len(a)):
            result[i] = function(a[i], b[i])
        return 0

    return kernel(loop, (kind,) * 3)


def numbers(rng: np.random.Generator) -> tuple[Array, Array]:
    """Numbers of many sizes, and all pairs of special ones."""
    a, b = (lane_array(24) for _ in range(2))
    for x in (a, b):
        x[...] = rng.normal(size=x.shape) * 10.0 ** rng.uniform(-6.0, 3.0, x.shape)
    a[:8], b[:8] = SPECIAL[:, None], SPECIAL
    return a, b


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.py_func.__name__)
def test_each_lane_is_what_one_float_gives(function: Any, rng: np.random.Generator) -> None:
    a, b = numbers(rng)
    lanes, floats = lane_array(len(a)), np.empty(a.size)
    on_vectors(function, LANE_VECTOR)(a, b, lanes)
    on_vectors(function, OWN_VECTOR)(np.array(a).ravel(), np.array(b).ravel(), floats)
    assert_array_equal(np.array(lanes).ravel(), floats)


def test_powers_are_right_to_two_units_in_the_last_place(rng: np.random.Generator) -> None:
    def loop(x: Array, p: Array, result: Array) -> int:
        for i in range(len(x)):
            result[i] = x[i] ** p[i]
        return 0

    x, p, result = (lane_array(500) for _ in range(3))
    x[...] = 10.0 ** rng.uniform(-12.0, 3.0, x.shape)
    p[...] = rng.uniform(-1.0, 2.0, p.shape)
    x[0], x[1, :6] = 0.0, [np.nan, np.inf, 5e-324, 1e-310, 1.0, 1e308]
    kernel(loop, (LANE_VECTOR,) * 3)(x, p, result)
    with np.errstate(all="ignore"):
        expected = [
            [float(np.float64(a) ** b) for a, b in zip(*row, strict=True)]
            for row in zip(x, p, strict=True)
        ]
    assert_allclose(result, expected, rtol=4.5e-16, atol=0.0)


def test_any_of_sees_one_lane_and_first_lane_is_the_first() -> None:
    def loop(x: Array, result: Array) -> int:
        for i in range(len(x)):
            result[i] = first_lane(x[i]) if any_of(x[i] > 5.0) else -1.0
        return 0

    x, result = lane_array(WIDTH + 1), lane_array(WIDTH + 1)
    for i in range(WIDTH):
        x[i, 0], x[i, i] = 1.0, 6.0
    kernel(loop, (LANE_VECTOR,) * 2)(x, result)
    assert_array_equal(result[:, 3], [6.0, *[1.0] * (WIDTH - 1), -1.0])


def _inverse(arm: ArmTables, space: Workspace, q: Array, v: Array, a: Array, out: Array) -> int:
    place_joints(arm, space, q)
    rigid_body.inverse_dynamics(arm, space, v, a, out)
    return 0


def _forward(arm: ArmTables, space: Workspace, q: Array, v: Array, tau: Array, out: Array) -> int:
    place_joints(arm, space, q)
    rigid_body.forward_dynamics(arm, space, v, tau, out)
    return 0


LANE_ARM = types.NamedTuple((LANE_MATRIX, OWN_INTEGERS, OWN_VECTOR), ArmTables)
LANE_SPACE = types.NamedTuple((LANE_VECTOR,) * 3 + (LANE_MATRIX,), Workspace)


@pytest.mark.slow
@pytest.mark.parametrize("recursion", [_inverse, _forward], ids=["RNEA", "ABA"])
def test_recursions_in_lanes_are_bit_identical_to_those_of_one_arm(
    recursion: Any, rng: np.random.Generator
) -> None:
    in_lanes = kernel(recursion, (LANE_ARM, LANE_SPACE, *(LANE_VECTOR,) * 4))
    alone = kernel(recursion, (ARM, SPACE, *(OWN_VECTOR,) * 4))
    for base in (arms.manipulator(), arms.spinner(), rbi.load_robot("ur5")):
        tables = [arm_tables(base.with_payload(0.1 * i)) for i in range(WIDTH)]
        nv, nq = base.nv, base.nq
        joints, q, given, out = (
            lane_array(*shape) for shape in (tables[0].joints.shape, (nq,), (2, nv), (nv,))
        )
        position, cos, sin = (lane_array(nv) for _ in range(3))
        space = Workspace(position, cos, sin, lane_array(*workspace(nv).rows.shape))
        given[...] = rng.normal(size=given.shape)
        for i, table in enumerate(tables):
            joints[..., i], q[:, i] = table.joints, base.random_configuration(rng)
        in_lanes(ArmTables(joints, *tables[0][1:]), space, q, given[0], given[1], out)
        for i, table in enumerate(tables):
            own, expected = workspace(nv), np.empty(nv)
            rows = [np.ascontiguousarray(x[..., i]) for x in (q, given[0], given[1])]
            alone(table, own, *rows, expected)
            assert_array_equal(out[:, i], expected)
