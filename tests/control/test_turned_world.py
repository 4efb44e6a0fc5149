"""The law at the tool in a world that is turned by any angle, with the base of the arm and gravity.

The target, the feedforward and everything that is linear turn with it. The surfaces do not: they act per axis of the
world, so the transient from a large error is another one, unless the axes become axes again (test_cartesian.py).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.robot.tool_kinematics import ToolKinematics

from .test_cartesian import DT, MASS, STIFFNESS, TURNED, Array, Setting, setting, turned_world

ANGLE = st.floats(-3.1, 3.1)


def in_turned_worlds(test: Callable[[str, tuple[float, float, float]], None]) -> Any:
    """Run a property of two arms in worlds that are turned at random."""
    turned = given(turn=st.tuples(ANGLE, ANGLE, ANGLE))(test)
    limited = settings(max_examples=5, deadline=None)(turned)
    return pytest.mark.parametrize("name", ["panda", "ur5"])(limited)


@functools.cache
def case(name: str) -> Setting:
    return setting(name, "turned")


class Turned(NamedTuple):
    """A law in a turned world, and the two turns that take vectors and pairs of them there."""

    controller: rbi.CartesianController
    Q: Array
    both: Array


def in_turned_world(controller: rbi.CartesianController, turn: Array) -> Turned:
    """The same law for the same arm, with base, gravity and compliance axes turned."""
    Q = Rotation.from_rotvec(turn).as_matrix()
    other = rbi.CartesianController(
        turned_world(controller.arm, Q),
        rbi.CartesianImpedance(MASS, STIFFNESS, axes=Q @ TURNED),
        controller.surface,
        controller.reaching,
        DT,
        posture=controller.posture,
        joint_limits=False,
    )
    return Turned(other, np.asarray(Q, float), np.kron(np.eye(2), Q).astype(float))


def first_torques(name: str, turn: Array, away: Array, wrench: Array) -> tuple[Array, Array, Array]:
    """Torque of the first tick with the tool `away` from its reference: as it is, turned, and without the error."""
    arm, q, controller, _ = case(name)
    other, v = in_turned_world(controller, turn), np.full(arm.nv, 0.2)
    now, a_d = ToolKinematics(arm).motion(q, v), np.array([0.5, -1.0, 2.0, 1.0, 0.3, -2.0])
    taus = []
    for law, Q, both, e in (
        (controller, np.eye(3), np.eye(6), away),
        (*other, away),
        (controller, np.eye(3), np.eye(6), 0.0 * away),
    ):
        R = Rotation.from_rotvec(e[3:]).as_matrix() @ now.rotation
        pose = rbi.Pose(Q @ R, Q @ (now.translation + e[:3]))
        there = rbi.CartesianReference(pose, both @ now.v, both @ a_d)
        output, _ = law.step(law.init(), q, v, there, both @ wrench)
        taus.append(output.tau)
    return taus[0], taus[1], taus[2]


@in_turned_worlds
def test_without_an_error_the_torque_is_the_same_in_any_world(
    name: str, turn: tuple[float, float, float]
) -> None:
    wrench = np.array([12.0, 3.0, -16.0, 0.5, -0.8, 0.6])
    as_it_is, turned, _ = first_torques(name, np.array(turn), np.zeros(6), wrench)
    assert_allclose(turned, as_it_is, atol=1e-9)


@in_turned_worlds
def test_what_a_small_error_adds_to_the_torque_is_the_same_in_any_world(
    name: str, turn: tuple[float, float, float]
) -> None:
    """In the limit of small errors the law is linear, with one gain for translations and one for rotations.

    The difference falls with the root of the error, by the root in the reaching law.
    """
    away = 1e-10 * np.array([1.0, -2.0, 3.0, 2.0, 1.0, -1.0])
    as_it_is, turned, without = first_torques(name, np.array(turn), away, np.zeros(6))
    added = np.abs(as_it_is - without).max()
    assert added > 1e-6
    assert_allclose(turned, as_it_is, atol=1e-2 * added)


def test_what_a_large_error_adds_depends_on_the_axes_of_the_world() -> None:
    """The limit of the two properties above: docs/tool.md states it."""
    away, turn = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, np.pi / 4.0])
    as_it_is, turned, without = first_torques("ur5", turn, away, np.zeros(6))
    apart = np.abs(turned - as_it_is).max()
    assert 0.01 < apart / np.abs(as_it_is - without).max() < 0.5
