"""The task: a circle with a turning tool and a push, by arms whose payload and masses are not known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from benchmarks.arms import Array, load
from rbimpedance.law.rotations import cross

from .gen3 import gen3

DT = 1e-3
IMPEDANCE = rbi.CartesianImpedance((3.0, 0.15), [1000.0, 1000.0, 200.0, 30.0, 30.0, 10.0])
PUSH = np.array([12.0, 0.0, -16.0, 0.0, 0.0, 0.0])  # 20 N
DURATION, PUSHED, FREE, UNDER_PUSH = 8.0, (3.0, 5.0), (6.5, 8.0), (2.5, 5.0)
SIZE = 0.04  # radius of gyration of the payload [m]


class Case(NamedTuple):
    """An arm in its posture, with its payload [kg]."""

    arm: rbi.ArmModel
    q: Array
    payload: float

    def plant(self) -> rbi.ArmModel:
        """What the controller does not know: links 10 % heavier, and the payload."""
        inertia = self.payload * SIZE**2 * np.eye(3)
        heavy = self.arm.with_scaled_inertia(1.1)
        return heavy.with_payload(self.payload, com=(0.0, 0.0, 0.03), inertia=inertia)


def case(name: str) -> Case:
    """Return one of the three arms."""
    arm, angles, payload = {
        "panda": lambda: (load("panda", 0.1), [0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 0.8], 2.0),
        "ur5": lambda: (load("ur5", 0.1), [0.0, -1.2, 1.6, -1.9, -1.57, 0.3], 2.0),
        "gen3": lambda: (gen3(), [0.0, 0.262, np.pi, -2.27, 0.0, 0.96, 1.57], 1.0),
    }[name]()
    arm = arm.with_friction(0.0, 0.0)
    return Case(arm, arm.integrate(arm.zero, angles), payload)


class Circle:
    """A circle of 0.1 m in 4 s across x, while the tool swings by 0.3 rad about two axes."""

    def __init__(self, start: rbi.Pose) -> None:
        self.start = start
        self.origin = rbi.trajectories.cartesian.circle(
            start, 0.1, 4.0, normal=(1.0, 0.0, 0.0), towards=(0.0, 0.0, -1.0)
        )

    def __call__(self, t: float) -> rbi.CartesianReference:
        """Return the desired motion at a time."""
        (_, p), v, a = self.origin(t)
        x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        (f, df, ddf), (g, dg, ddg) = self._swing(t, 1.0), self._swing(t, 0.7)
        first = Rotation.from_rotvec(f * x)
        turned = first.apply(y)
        rotation = (first * Rotation.from_rotvec(g * y)).as_matrix() @ self.start.rotation
        omega = df * x + dg * turned
        alpha = ddf * x + ddg * turned + cross(df * x, dg * turned)
        return rbi.CartesianReference(
            rbi.Pose(rotation, p), np.r_[v[:3], omega], np.r_[a[:3], alpha]
        )

    def _swing(self, t: float, rate: float) -> tuple[float, float, float]:
        """0.3·sin of a phase that starts from rest within 2 s, at a rate of a turn in 3 s."""
        w, T = rate * 2.0 * np.pi / 3.0, 2.0
        x = min(max(t / T, 0.0), 1.0)
        phase = w * (T * (x**3 - x**4 / 2.0) + max(t - T, 0.0))
        d, dd = w * x * x * (3.0 - 2.0 * x), w / T * 6.0 * x * (1.0 - x)
        sin, cos = np.sin(phase), np.cos(phase)
        return 0.3 * sin, 0.3 * cos * d, 0.3 * (cos * dd - sin * d * d)


def push(t: float) -> Array:
    """20 N on the tool for two seconds."""
    return PUSH * (PUSHED[0] <= t < PUSHED[1])


def proposed(setting: Case) -> rbi.CartesianController:
    """Return the law with the gains that are proposed for what is not known here."""
    arm, q, payload = setting
    unknown = rbi.Uncertainty(
        payload=payload,
        inertia_scale=(1.0, 1.1),
        payload_com=(0.0, 0.0, 0.03),
        payload_gyration=SIZE,
    )
    circle = Circle(rbi.Pose(*arm.frame_placement(q)))
    found = rbi.propose_gains(
        arm, unknown, circle, DT, frame=arm.tool_frame, q0=q, duration=DURATION, samples=8
    )
    return found.controller(IMPEDANCE)


def _pid(bandwidth: float) -> Callable[[Case], Any]:
    return lambda it: rbi.baselines.CartesianPID(it.arm, IMPEDANCE, bandwidth, DT)


LAWS: dict[str, Callable[[Case], Any]] = {
    "super-twisting, default gains": lambda it: rbi.CartesianController(it.arm, IMPEDANCE, dt=DT),
    "super-twisting, proposed gains": proposed,
    "Cartesian PD, gravity": lambda it: rbi.baselines.CartesianPD(it.arm, IMPEDANCE, DT),
    "operational space, Λ": lambda it: rbi.baselines.OperationalSpace(it.arm, IMPEDANCE, DT),
    "Hogan, measured force": lambda it: rbi.baselines.CartesianHogan(it.arm, IMPEDANCE, DT),
    "PID on x_r, poles 40": _pid(40.0),
    "PID on x_r, poles 100": _pid(100.0),
}
"""Every law of the tables, made for a case."""
