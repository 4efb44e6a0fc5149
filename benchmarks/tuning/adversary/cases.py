"""The tasks that are attacked: arms, uncertainties, motions and periods."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import ARMS, Array, load
from rbimpedance.trajectories import Reference, Trajectory, cosine, hold
from tests.tuning.strongly_coupled import task_of

UNSEEN = ("ur10", "ur3", "finger_edu", "asr_twodof", "bravo7_no_ee")
"""Arms that no rule of the tuning was made with."""

RANDOM_ARMS, COUPLED_ARMS = 28, 200
PERIODS = (5e-4, 1e-3, 1e-3, 2e-3, 4e-3)
MOTIONS = ("slow", "fast", "wide", "mixed", "rest")


@dataclass(frozen=True, eq=False)
class Case:
    """A task for `propose_gains`.

    Attributes:
        name: Of arm, uncertainty, motion and period.
        family: "tuned on", "unseen", "random" or "coupled".
        build: Makes arm, uncertainty, trajectory, period and further arguments.
    """

    name: str
    family: str
    build: Callable[[], tuple[rbi.ArmModel, rbi.Uncertainty, Trajectory, float, dict[str, Any]]]


def cases() -> list[Case]:
    """All tasks, alike ones far from each other, so that the first few are a small form of all."""
    arms = [("tuned on", name, 4) for name in ARMS] + [("unseen", name, 4) for name in UNSEEN]
    arms += [("random", f"random {3 + i % 7} joints #{i}", 1) for i in range(RANDOM_ARMS)]
    mixed = [
        _case(family, name, k, i)
        for i, (family, name, times) in enumerate(arms)
        for k in range(times)
    ]
    order = np.random.default_rng(5).permutation(len(mixed))
    return [mixed[i] for i in order] + [_coupled(seed) for seed in range(COUPLED_ARMS)]


def _case(family: str, name: str, k: int, i: int) -> Case:
    kind = KINDS[(i + k) % len(KINDS)]
    move, dt = MOTIONS[(2 * i + k) % len(MOTIONS)], PERIODS[(i + 3 * k) % len(PERIODS)]

    def build() -> Any:
        arm = _random_arm(i) if family == "random" else load(name)
        trajectory = _motion(arm, move)
        q0 = trajectory(0.0).q if k % 2 else arm.integrate(trajectory(0.0).q, np.full(arm.nv, 0.1))
        return arm, UNKNOWN[kind](arm), trajectory, dt, {"q0": q0, "duration": 4.0}

    return Case(f"{name}, {kind}, {move}, {1e3 * dt:g} ms", family, build)


def _coupled(seed: int) -> Case:
    def build() -> Any:
        with tempfile.TemporaryDirectory() as folder:
            arm, unknown, motion = task_of(Path(folder), seed)
        return arm, unknown, motion, 1e-3, {"q0": motion(0.0).q + 0.1, "duration": 2.0}

    return Case(f"coupled links #{seed}", "coupled", build)


def _weight(arm: rbi.ArmModel) -> float:
    return float(sum(body.mass for body in arm.raw_dynamics.model.inertias))


def _payload(arm: rbi.ArmModel) -> rbi.Uncertainty:
    return rbi.Uncertainty(payload=0.08 * _weight(arm), inertia_scale=1.1)


def _box(arm: rbi.ArmModel) -> rbi.Uncertainty:
    corners = [[-0.04, -0.04, 0.0], [0.04, 0.04, 0.08]]
    return rbi.Uncertainty(0.05 * _weight(arm), payload_com=corners, payload_gyration=0.03)


def _friction(arm: rbi.ArmModel) -> rbi.Uncertainty:
    size = 0.02 * _weight(arm)
    return rbi.Uncertainty(0.04 * _weight(arm), 1.05, viscous=size, coulomb=min(size, 0.5))


def _torque(arm: rbi.ArmModel) -> rbi.Uncertainty:
    return rbi.Uncertainty(0.04 * _weight(arm), 1.05, torque_constant=0.05)


def _tilt(arm: rbi.ArmModel) -> rbi.Uncertainty:
    coulomb = min(0.01 * _weight(arm), 0.3)
    return rbi.Uncertainty(0.04 * _weight(arm), coulomb=coulomb, gravity_tilt=0.05)


def _rotors(arm: rbi.ArmModel) -> rbi.Uncertainty:
    return rbi.Uncertainty(0.04 * _weight(arm), armature=(0.02, 0.1), viscous=0.2, coulomb=0.1)


def _late(arm: rbi.ArmModel) -> rbi.Uncertainty:
    noise: dict[str, Any] = {"position_noise": 2e-5, "velocity_noise": 2e-4, "delay": 1}
    return rbi.Uncertainty(0.04 * _weight(arm), 1.05, **noise)


UNKNOWN: dict[str, Callable[[rbi.ArmModel], rbi.Uncertainty]] = {
    "payload": _payload,
    "box": _box,
    "friction": _friction,
    "torque constants": _torque,
    "tilt": _tilt,
    "rotors": _rotors,
    "noise and delay": _late,
}
KINDS = tuple(UNKNOWN)


def _motion(arm: rbi.ArmModel, name: str) -> Trajectory:
    if name == "rest":
        return hold(arm, _center(arm))
    if name == "mixed":
        return _mixed(arm)
    amplitude, period = {"slow": (0.2, 6.0), "fast": (0.1, 2.0), "wide": (0.4, 8.0)}[name]
    return cosine(arm, center=_center(arm), amplitude=amplitude, period=period)


def _center(arm: rbi.ArmModel) -> Array:
    """The posture in whose neighbourhood an arm moves: `ready`, but away from its limits."""
    room = np.minimum(0.6, 0.49 * (arm.upper - arm.lower))
    return np.clip(arm.ready, arm.lower + room, arm.upper - room)


def _mixed(arm: rbi.ArmModel) -> Trajectory:
    """Every joint swings at its own two frequencies, so that joints reverse at different times."""
    rng = np.random.default_rng(arm.nv)
    size = rng.uniform(0.02, 0.08, (2, arm.nv))
    rate, phase = rng.uniform(0.7, 2.5, (2, arm.nv)), rng.uniform(0.0, 2.0 * np.pi, (2, arm.nv))

    def swing(t: float) -> Reference:
        angle = rate * t + phase
        x, v = (size * np.sin(angle)).sum(axis=0), (size * rate * np.cos(angle)).sum(axis=0)
        return Reference(
            arm.integrate(_center(arm), x), v, -(size * rate**2 * np.sin(angle)).sum(axis=0)
        )

    return swing


def _random_arm(seed: int) -> rbi.ArmModel:
    """A chain of 3 to 9 joints with random axes, lengths, offsets, masses; half of them with rotors."""
    rng = np.random.default_rng((17, seed))
    n = 3 + (seed - 11) % 7
    text, parent, reach = '<link name="base"/>', "base", 0.0
    for i in range(n):
        mass = 6.0 * np.exp(-3.0 * i / n) * rng.uniform(0.5, 1.5)
        length, radius = rng.uniform(0.08, 0.35), rng.uniform(0.02, 0.05)
        axis = np.eye(3)[rng.integers(3)] if rng.uniform() < 0.7 else rng.normal(size=3)
        text += _joint(f"j{i}", "revolute", parent, f"l{i}", reach, axis)
        text += _link(f"l{i}", mass, length, radius, rng.uniform(-0.02, 0.02, 2))
        parent, reach = f"l{i}", length
    text += _joint("mount", "fixed", parent, "tool", reach, np.eye(3)[2]) + '<link name="tool"/>'
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(f'<robot name="random{seed}">{text}</robot>', encoding="utf-8")
        return rbi.load_robot(path, armature=0.05 if seed % 2 else None)


def _joint(name: str, kind: str, parent: str, child: str, reach: float, axis: Array) -> str:
    limit = (
        '<limit lower="-2.8" upper="2.8" effort="200" velocity="4"/>' if kind == "revolute" else ""
    )
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {reach}"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>{limit}</joint>'
    )


def _link(name: str, mass: float, length: float, radius: float, off: Array) -> str:
    """A rod along z."""
    across, along = mass * (length**2 / 12.0 + radius**2 / 4.0), mass * radius**2 / 2.0
    return (
        f'<link name="{name}"><inertial><origin xyz="{off[0]} {off[1]} {length / 2.0}"/><mass value="{mass}"/>'
        f'<inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
