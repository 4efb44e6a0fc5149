"""What a tool feels like over a range of frequencies, and that its null space does not drift."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.law.rotations import RotationVector
from rbimpedance.robot.tool_kinematics import ToolKinematics
from rbimpedance.trajectories import cartesian

from .test_tool_runs import Array, heavier, panda, pose_of, ur5

MASS, STIFFNESS = [3.0, 3.0, 3.0, 0.15, 0.15, 0.15], [1000.0, 1000.0, 400.0, 30.0, 30.0, 20.0]
SIZE = np.array([8.0, 8.0, 5.0, 0.3, 0.3, 0.3])
SWEEP, SETTLE, LOWEST, HIGHEST = 6.0, 0.6, 0.3, 3.0
Q_PANDA, Q_UR5 = [0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8], [0.0, -1.2, 1.6, -1.9, -1.57, 0.3]


def chirps(t: float) -> Array:
    """Six sweeps in compliance axes from 0.3 to 3 Hz and back, each begun at another frequency, shape (6,)."""
    way = 2.0 * (t - SETTLE) / SWEEP + np.arange(6) / 3.0  # 1 for every sweep up or down
    rounds, x = np.divmod(way, 2.0)
    turns = rounds + np.where(x <= 1.0, x**2 / 2.0, 1.0 - (2.0 - x) ** 2 / 2.0)
    phase = 2.0 * np.pi * SWEEP / 2.0 * (LOWEST * way + (HIGHEST - LOWEST) * turns)
    pushes: Array = SIZE * np.sin(phase) * float(t >= SETTLE)
    return pushes


@pytest.mark.slow
@pytest.mark.parametrize("axes", ["world", "reference", "turned"])
def test_chirp_finds_mass_damping_and_stiffness_of_the_tool(axes: str) -> None:
    """M_d within 5 %, D_d and K_d within 2 %, on all six axes, with payload and 10 % of the links unknown."""
    arm, q = ur5(), np.array(Q_UR5)
    start = pose_of(arm, q)
    turned = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    R_c = {"world": np.eye(3), "reference": start.rotation, "turned": turned}[axes]
    given: Any = turned if axes == "turned" else axes
    both = np.kron(np.eye(2), R_c)
    result = rbi.simulate(
        rbi.CartesianController(arm, rbi.CartesianImpedance(MASS, STIFFNESS, axes=given)),
        heavier(arm),
        cartesian.hold(start),
        environment=lambda t: both @ chirps(t),
        q0=q,
        duration=SETTLE + SWEEP,
        substeps=2,
    )
    assert result.tool is not None
    kinematics, xi, rate, pulled = ToolKinematics(arm), [], [], []
    for k, (now, v) in enumerate(zip(result.q, result.v, strict=True)):
        motion = kinematics.motion(now, v)
        turn = Rotation.from_matrix(R_c.T @ motion.rotation @ start.rotation.T @ R_c).as_rotvec()
        phi = RotationVector(turn)
        xi.append(np.r_[R_c.T @ (motion.translation - start.translation), turn])
        rate.append(np.r_[R_c.T @ motion.v[:3], phi.left_inverse @ R_c.T @ motion.v[3:]])
        f = chirps(float(result.t[k]))
        pulled.append(np.r_[f[:3], phi.left.T @ f[3:]])
    a = np.gradient(np.array(rate), result.t, axis=0)
    late = slice(round((SETTLE + 0.2) / 1e-3), -2)
    damping = 2.0 * np.sqrt(np.array(MASS) * STIFFNESS)
    for i in range(6):
        regressors = np.column_stack([a[:, i], np.array(rate)[:, i], np.array(xi)[:, i]])[late]
        w = np.array(pulled)[late, i]
        m, d, k = np.linalg.lstsq(regressors, w, rcond=None)[0]
        assert_allclose(m, MASS[i], rtol=0.05)
        assert_allclose(d, damping[i], rtol=0.02)
        assert_allclose(k, STIFFNESS[i], rtol=0.02)


@pytest.mark.slow
def test_null_space_does_not_drift_over_a_hundred_circles() -> None:
    """The inverse of the Jacobian alone would let the elbow wander; the posture brings it to the same place again."""
    arm, q, dt = panda(), np.array(Q_PANDA), 4e-3
    circle = cartesian.circle(
        pose_of(arm, q), 0.03, 1.0, normal=(1.0, 0.0, 0.0), towards=(0.0, 0.0, -1.0)
    )
    result = rbi.simulate(
        rbi.CartesianController(arm, rbi.CartesianImpedance((3.0, 0.15), (1000.0, 30.0)), dt=dt),
        heavier(arm),
        circle,
        q0=q,
        duration=102.0,
        substeps=2,
    )
    assert result.tool is not None
    cycles = result.q[:: round(1.0 / dt)]
    assert np.abs(cycles[10:] - cycles[-1]).max() < 1e-9
    assert np.abs(cycles[10] - cycles[0]).max() > 1e-5  # it did move to that place
    assert np.abs(result.tool.e1[round(10.0 / dt) :]).max() < 1e-3


@pytest.mark.slow
def test_a_spring_at_the_tool_yields_without_a_force_sensor() -> None:
    """What is pushed is the spring itself: a force of 8 N on 400 N/m, with no sensor of any kind."""
    arm, q = ur5(), np.array(Q_UR5)
    target = rbi.CartesianImpedance((3.0, 0.15), (400.0, 30.0))
    f = np.array([0.0, 0.0, -8.0, 0.0, 0.0, 0.0])
    result = rbi.simulate(
        rbi.baselines.CartesianPD(arm, target),
        arm,
        cartesian.hold(pose_of(arm, q)),
        environment=f,
        sensor=_Deaf(arm.nv),
        q0=q,
        duration=2.0,
        substeps=1,
    )
    assert result.tool is not None
    assert not result.tool.wrench.any()
    moved = result.tool.position[-1] - result.tool.position[0]
    assert_allclose(moved, [0.0, 0.0, -0.02], atol=2e-4)


class _Deaf:
    """A sensor that measures nothing, whatever pushes."""

    def __init__(self, nv: int) -> None:
        self._nothing = np.zeros(nv)

    def init(self) -> None:
        return None

    def step(
        self, state: None, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, None]:
        del state, q, v, tau, tau_ext
        return self._nothing, None
