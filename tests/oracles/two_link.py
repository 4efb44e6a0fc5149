"""The paper's two-link arm in closed form, and its closed loop, without the package under test.

Equations (20) and (21) of the paper; the arm moves in a vertical plane, q = 0 is horizontal and
positive angles lift it. The physical arm has M a + C v + G + F v = tau + tau_ext, so that
Δ = -M⁻¹(C v + G + F v): (20) is printed without that minus.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]

M1 = M2 = 1.5  # [kg]
L1 = L2 = 0.8  # [m]
LC1 = LC2 = 0.4  # [m]
I1 = I2 = 0.3  # [kg·m²], about the centre of mass
FRICTION = np.array([0.3, 0.3])  # [N·m·s]
GRAVITY = 9.8  # [m/s²]

W1 = I1 + I2 + M1 * LC1**2 + M2 * L1**2 + M2 * LC2**2
W2 = M2 * LC2**2 + I2
W3 = M2 * L1 * LC2
W4 = M1 * LC1 + M2 * L1
W5 = M2 * LC2


def mass_matrix(q: Array) -> Array:
    """M(q) of (20), shape (2, 2) [kg·m²]."""
    m12 = W3 * np.cos(q[1]) + W2
    return np.array([[W1 + 2.0 * W3 * np.cos(q[1]), m12], [m12, W2]])


def coriolis(q: Array, v: Array) -> Array:
    """C(q, v) of (20), shape (2, 2)."""
    w = W3 * np.sin(q[1])
    return np.array([[-w * v[1], -w * (v[0] + v[1])], [w * v[0], 0.0]])


def gravity(q: Array) -> Array:
    """G(q) of (20), shape (2,) [N·m]."""
    g2 = W5 * GRAVITY * np.cos(q[0] + q[1])
    return np.array([W4 * GRAVITY * np.cos(q[0]) + g2, g2])


def bias(q: Array, v: Array) -> Array:
    """C v + G + F v, shape (2,) [N·m]."""
    result: Array = coriolis(q, v) @ v + gravity(q) + FRICTION * v
    return result


def jacobian(q: Array) -> Array:
    """J(q) of (20): joint rates to the tip's velocity (horizontal, up), shape (2, 2)."""
    s1, s12 = L1 * np.sin(q[0]), L2 * np.sin(q[0] + q[1])
    c1, c12 = L1 * np.cos(q[0]), L2 * np.cos(q[0] + q[1])
    return np.array([[-s1 - s12, -s12], [c1 + c12, c12]])


def forward_dynamics(q: Array, v: Array, tau: Array) -> Array:
    """M⁻¹(tau - C v - G - F v), tau including what the environment does, shape (2,) [rad/s²]."""
    (m11, m12), (_, m22) = mass_matrix(q)
    b1, b2 = tau - bias(q, v)
    a: Array = np.array([m22 * b1 - m12 * b2, m11 * b2 - m12 * b1]) / (m11 * m22 - m12 * m12)
    return a


# Section 4

MASS, DAMPING, STIFFNESS = 1.0, 10.0, 20.0  # M_d = I, D_d = 10 I, K_d = 20 I
GAMMA, EXPONENT = 3.0, 5.0 / 3.0
K1, K2 = 8.0, 10.0


def tip_force(t: float) -> Array:
    """The environment's force on the tip, in the arm's plane (horizontal, up), shape (2,) [N]."""
    return np.array([5.0 * np.sin(0.2 * t), 5.0 * np.cos(0.2 * t)])


def desired(t: float) -> tuple[float, float, float]:
    """q_d and its first two derivatives, the same for both joints [rad, rad/s, rad/s²]."""
    w = np.pi / 3.0
    return (
        float(0.5 + 0.2 * np.cos(w * t)),
        float(-0.2 * w * np.sin(w * t)),
        float(-0.2 * w**2 * np.cos(w * t)),
    )


class Run(NamedTuple):
    """What the closed loop logged at the ticks t = 0, h, 2h, ...; first axis time."""

    t: Array
    q: Array
    v: Array
    tau: Array
    tau_ext: Array
    e1: Array
    e2: Array
    e_im: Array
    s: Array


def closed_loop(
    knowledge: Literal["inertia", "full"], duration: float, step: float, substeps: int
) -> Run:
    """Simulate section 4 under the paper's law, sampled with forward Euler.

    A tick at t = k·step reads q, v and tau_ext; the filter's state q_e, v_e is that of t (zero at
    0). It gives the torque from z before its update; then z ← z + step·sgn(s), and the filter takes
    one exact step with tau_ext held. The plant takes `substeps` steps of semi-implicit Euler under
    the held torque; the tip's force is that of each substep's own time and posture.
    """
    n = round(duration / step)
    filter_matrix, filter_input = _filter_step(step)
    q, v, z = np.zeros(2), np.zeros(2), np.zeros(2)
    x_e = np.zeros((2, 2))  # rows q_e, v_e
    log: list[tuple[Array, ...]] = []
    for k in range(n + 1):
        t = k * step
        tau_ext = jacobian(q).T @ tip_force(t)
        a_e = (tau_ext - DAMPING * x_e[1] - STIFFNESS * x_e[0]) / MASS  # (3)
        q_d, v_d, a_d = desired(t)
        e1, e2, a_r = q_d + x_e[0] - q, v_d + x_e[1] - v, a_d + a_e  # (4)
        s = GAMMA * np.sign(e1) * np.abs(e1) ** EXPONENT + e2  # (6)
        feedforward = GAMMA * EXPONENT * np.abs(e1) ** (EXPONENT - 1.0) * e2
        u = K1 * np.sqrt(np.abs(s)) * np.sign(s) + K2 * z
        tau = -tau_ext + mass_matrix(q) @ (feedforward + a_r + u)  # (8)
        if knowledge == "full":
            tau = tau + bias(q, v)
        a = forward_dynamics(q, v, tau + tau_ext)
        e_im = MASS * (a_r - a) + DAMPING * e2 + STIFFNESS * e1  # (5)
        log.append((np.asarray(t), q, v, tau, tau_ext, e1, e2, e_im, s))
        z = z + step * np.sign(s)
        x_e = filter_matrix @ x_e + np.outer(filter_input, tau_ext)
        q, v = _plant(q, v, tau, t, step / substeps, substeps)
    return Run(*(np.array(column) for column in zip(*log, strict=True)))


def _filter_step(step: float) -> tuple[Array, Array]:
    """Zero-order-hold step of M_d a_e + D_d v_e + K_d q_e = tau_ext by one matrix exponential."""
    A = np.zeros((3, 3))
    A[0, 1] = 1.0
    A[1] = np.array([-STIFFNESS, -DAMPING, 1.0]) / MASS
    E: Array = expm(step * A)
    return E[:2, :2], E[:2, 2]


def _plant(q: Array, v: Array, tau: Array, t: float, h: float, n: int) -> tuple[Array, Array]:
    """Advance the arm by n steps of semi-implicit Euler under a held torque."""
    for i in range(n):
        tau_ext = jacobian(q).T @ tip_force(t + i * h)
        v = v + h * forward_dynamics(q, v, tau + tau_ext)
        q = q + h * v
    return q, v
