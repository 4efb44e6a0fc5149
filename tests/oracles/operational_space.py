"""The law at the tool written a second time, with NumPy and Pinocchio and without the package under test.

A state machine in the order of the equations: closed forms for the rotations, SciPy's exponential for the target, the
elementwise fast terminal surface, the matched scheme, a singular value decomposition for the inverse.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

Array = NDArray[np.float64]
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Motion(NamedTuple):
    """Desired or commanded motion: rotation, position, velocity and acceleration in world axes."""

    R: Array
    p: Array
    v: Array
    a: Array


def hat(x: Array) -> Array:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def coefficients(theta: float) -> tuple[float, ...]:
    """a, b of J_l, c of its inverse; their slopes divided by θ."""
    x = theta * theta
    if theta < 0.05:
        return (
            *(0.5 - x / 24 + x * x / 720, 1 / 6 - x / 120 + x * x / 5040),
            *(1 / 12 + x / 720 + x * x / 30240, -1 / 12 + x / 180 - x * x / 6720),
            *(-1 / 60 + x / 1260 - x * x / 60480, 1 / 360 + x / 7560 + x * x / 201600),
        )
    s, c, half = math.sin(theta), math.cos(theta), theta / 2.0
    cot = math.cos(half) / math.sin(half)
    a, b, k = (1 - c) / x, (theta - s) / (x * theta), (1 - half * cot) / x
    da = (s - 2 * theta * a) / x / theta
    db = (1 - c - 3 * x * b) / (x * theta) / theta
    dk = ((-0.5 * cot + 0.25 * theta / math.sin(half) ** 2) - 2 * theta * k) / x / theta
    return a, b, k, da, db, dk


class Rotation:
    """J_l(p), its inverse and their rates; sign = -1 for J_r."""

    def __init__(self, p: Array) -> None:
        self.p, self.k, self.P = p, coefficients(float(np.linalg.norm(p))), hat(p)

    def J(self, sign: float = 1.0) -> Array:  # noqa: N802
        result: Array = np.eye(3) + sign * self.k[0] * self.P + self.k[1] * self.P @ self.P
        return result

    def J_inverse(self, sign: float = 1.0) -> Array:  # noqa: N802
        result: Array = np.eye(3) - sign * 0.5 * self.P + self.k[2] * self.P @ self.P
        return result

    def dJ(self, rate: Array) -> Array:  # noqa: N802
        D, g = hat(rate), self.p @ rate
        first: Array = self.k[3] * g * self.P + self.k[0] * D
        return first + self.k[4] * g * self.P @ self.P + self.k[1] * (D @ self.P + self.P @ D)

    def dJ_inverse(self, rate: Array, sign: float = 1.0) -> Array:  # noqa: N802
        D, g = hat(rate), self.p @ rate
        first: Array = -sign * 0.5 * D + self.k[5] * g * self.P @ self.P
        return first + self.k[2] * (D @ self.P + self.P @ D)


class Target:
    """M ξ̈ + D ξ̇ + K ξ = (R_cᵀ f, J_lᵀ R_cᵀ m), critically damped; R_c constant, or None for that of the reference."""

    def __init__(self, M: Array, K: Array, dt: float, R_c: Array | None) -> None:
        w2, modes = eigh(K, M)
        D = (M @ modes * (2.0 * np.sqrt(w2))) @ (M @ modes).T
        A = np.zeros((18, 18))
        A[:6, 6:12] = np.eye(6)
        A[6:12] = np.linalg.inv(M) @ np.hstack([-K, -D, np.eye(6)])
        self.step, self.A, self.R_c = expm(A * dt)[:12], A[6:12], R_c
        self.xi, self.rate = np.zeros(6), np.zeros(6)

    def reference(self, desired: Motion, f: Array) -> Motion:
        R_c = desired.R if self.R_c is None else self.R_c
        J = Rotation(self.xi[3:])
        self.pulled = np.r_[R_c.T @ f[:3], J.J().T @ (R_c.T @ f[3:])]
        acc = self.A @ np.r_[self.xi, self.rate, self.pulled]
        omega = R_c @ J.J() @ self.rate[3:]
        alpha = R_c @ (J.J() @ acc[3:] + J.dJ(self.rate[3:]) @ self.rate[3:])
        x, dx, ddx = R_c @ self.xi[:3], R_c @ self.rate[:3], R_c @ acc[:3]
        E, (R_d, p_d, v_d, a_d) = pin.exp3(self.xi[3:]), desired
        w, wd = v_d[3:], a_d[3:]
        if self.R_c is None:
            linear = a_d[:3] + np.cross(wd, x) + np.cross(w, np.cross(w, x))
            v = np.r_[v_d[:3] + np.cross(w, x) + dx, w + omega]
            a = np.r_[linear + 2 * np.cross(w, dx) + ddx, wd + alpha + np.cross(w, omega)]
            return Motion(R_d @ E, p_d + x, v, a)
        G = R_c @ E @ R_c.T
        v = np.r_[v_d[:3] + dx, omega + G @ w]
        a = np.r_[a_d[:3] + ddx, alpha + np.cross(omega, G @ w) + G @ wd]
        return Motion(G @ R_d, p_d + x, v, a)

    def advance(self) -> None:
        y = self.step @ np.r_[self.xi, self.rate, self.pulled]
        self.xi, self.rate = y[:6], y[6:]


class Gains(NamedTuple):
    """Per coordinate: six of the tool, then those of the null space."""

    rate: Array
    gamma: Array
    smoothing: Array
    k1: Array
    k2: Array
    exponent: float
    margin: float


class ToolLaw:
    """The controller: `torque(q, v, desired, f)` advances it by one period."""

    def __init__(
        self, model: pin.Model, frame: int, target: Target, gains: Gains, dt: float, q_n: Array
    ) -> None:
        self.m, self.fid, self.d, self.target = model, frame, model.createData(), target
        self.g, self.dt, self.q_n, self.n = gains, dt, q_n, max(model.nv - 6, 0)
        self.z, self.V = np.zeros(6 + self.n), np.zeros((model.nv, 0))
        self.length, self.sigma0, self.mu = 0.3, 0.08, 0.08

    def _surface(self, e: Array) -> tuple[Array, Array]:
        al, ep, m = self.g.exponent, self.g.smoothing, np.abs(e)
        c1, c2 = (2 - al) * ep ** (al - 1), (al - 1) * ep ** (al - 2)
        near, big = m <= ep, np.maximum(m, ep) ** (al - 1)
        value = self.g.rate * e + self.g.gamma * e * np.where(near, c1 + c2 * m, big)
        slope = self.g.rate + self.g.gamma * np.where(near, c1 + 2 * c2 * m, al * big)
        return value, slope

    def _kinematics(self, q: Array, v: Array) -> None:
        m, d, fid = self.m, self.d, self.fid
        pin.forwardKinematics(m, d, q, v, np.zeros(m.nv))
        pin.computeJointJacobians(m, d)
        X = pin.updateFramePlacement(m, d, fid)
        self.R, self.p = X.rotation.copy(), X.translation.copy()
        self.J = np.array(pin.getFrameJacobian(m, d, fid, AXES))
        drift = pin.getFrameClassicalAcceleration(m, d, fid, AXES)
        self.drift = np.r_[drift.linear, drift.angular]
        pin.computeJointJacobiansTimeVariation(m, d, q, v)
        self.dJ = np.array(pin.getFrameJacobianTimeVariation(m, d, fid, AXES))

    def _null(self) -> tuple[Array, Array]:
        """V with a continuous sign (one dimension), and its rate."""
        W = np.repeat([1 / self.length, 1.0], 3)
        self.U, self.S, self.Vt = np.linalg.svd(W[:, None] * self.J)
        self.W, V = W, self.Vt[6:].T
        if self.V.size and (V * self.V).sum() < 0:
            V = -V
        self.V = V
        S = self.S / (self.S**2 + 1e-4)
        return V, -(self.Vt[:6].T * S) @ (self.U.T @ (W[:, None] * (self.dJ @ V)))

    def torque(self, q: Array, v: Array, desired: Motion, f: Array) -> Array:
        self._kinematics(q, v)
        xr, tw = self.target.reference(desired, f), self.J @ v
        e = pin.log3(xr.R @ self.R.T)
        L = Rotation(e)
        ed = L.J_inverse() @ xr.v[3:] - L.J_inverse(-1.0) @ tw[3:]
        V, Vd = self._null()
        away = pin.difference(self.m, q, self.q_n)
        e1 = np.r_[xr.p - self.p, e, V.T @ away]
        e2 = np.r_[xr.v[:3] - tw[:3], ed, -V.T @ v]
        rate = np.r_[e2[:6], -V.T @ v + Vd.T @ away]
        value, slope = self._surface(e1)
        s = e2 + value
        h = self.g.margin * self.dt
        k1, k2, root = self.g.k1, self.g.k2, np.sqrt(np.abs(s))
        D = np.abs(s) + h * k1 * root + h * h * k2
        u, dz = (k1 * root + 2 * h * k2) * s / D + k2 * self.z, self.dt * s / D
        gain = 1 + slope * self.dt / 2
        y = (slope * rate + u) / gain
        turning = L.J_inverse() @ xr.a[3:] + L.dJ_inverse(ed) @ xr.v[3:]
        turning = turning - L.dJ_inverse(ed, -1.0) @ tw[3:] + y[3:6]
        b = np.r_[xr.a[:3] + y[:3], L.J(-1.0) @ turning] - self.drift
        mu2 = (
            np.where(self.sigma0 > self.S, (1 - (self.S / self.sigma0) ** 2) ** 2, 0.0) * self.mu**2
        )
        kept = self.S**2 / (self.S**2 + mu2)
        a = self.Vt[:6].T @ (self.S / (self.S**2 + mu2) * (self.U.T @ (self.W * b)))
        a = a + V @ (y[6:] - Vd.T @ v)
        a = a + self.Vt[:6].T @ ((1 - kept) * (self.Vt[:6] @ (20.0 * away - 9.0 * v)))
        missing = np.zeros(6 + self.n)
        if (kept < 1).any():
            mb = b - self.J @ a
            missing[:6] = np.r_[mb[:3], L.J_inverse(-1.0) @ mb[3:]]
        self.z = self.z + np.where(dz * gain * missing > 0, 0.0, dz)
        self.target.advance()
        return np.array(pin.rnea(self.m, self.d, q, v, a) - self.J.T @ f)
