"""A small study, and makers that fail; in a module of its own, so that worker processes can load it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance.control.baselines import ComputedTorqueImpedance, PDGravity
from rbimpedance.control.protocol import Controller

TARGET = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
Maker = Callable[[rbi.study.Task], Controller[Any]]


def task(name: str) -> rbi.study.Task:
    return rbi.study.Task(robot=name, arm=rbi.load_robot("two_link"), impedance=TARGET, dt=1e-3)


def computed_torque(task: rbi.study.Task) -> Controller[Any]:
    return ComputedTorqueImpedance(task.arm, task.impedance, task.dt)


def spring(task: rbi.study.Task) -> Controller[Any]:
    return PDGravity(task.arm, task.impedance, task.dt)


def wild(task: rbi.study.Task) -> Controller[Any]:
    """Too stiff for its period."""
    stiff = rbi.Impedance(mass=1.0, damping=10.0, stiffness=1e9)
    return PDGravity(task.arm, stiff, task.dt)


def broken(task: rbi.study.Task) -> Controller[Any]:
    raise ValueError(f"no gains for {task.robot}: {object()}")


def deadly(marker: Path, task: rbi.study.Task) -> Controller[Any]:
    """Takes its process along, the first time."""
    if not marker.exists():
        marker.touch()
        os._exit(1)
    return spring(task)


def payload(task: rbi.study.Task, rng: np.random.Generator) -> rbi.study.Experiment:
    mass = rng.uniform(0.1, 0.5)
    trajectory = rbi.trajectories.cosine(task.arm, center=0.5, amplitude=0.2, period=1.0)
    plant = task.arm.with_payload(mass)
    q0 = trajectory(0.0).q
    return rbi.study.Experiment(plant=plant, trajectory=trajectory, q0=q0, inputs={"payload": mass})


def push(task: rbi.study.Task, rng: np.random.Generator) -> rbi.study.Experiment:
    force = rng.uniform(1.0, 5.0)
    return rbi.study.Experiment(
        plant=task.arm,
        trajectory=rbi.trajectories.hold(task.arm),
        environment=[force, 0.0, 0.0, 0.0, 0.0, 0.0],
        inputs={"force": force},
    )


CONTROLLERS: Mapping[str, Maker] = {"torque": computed_torque, "spring": spring}

SMALL = rbi.Study(
    name="small",
    robots={name: partial(task, name) for name in ("one", "two")},
    controllers=CONTROLLERS,
    disturbances={"payload": payload, "push": push},
    samples=2,
    duration=0.05,
    after=0.01,
    seed=5,
)


def with_controller(name: str, maker: Maker) -> rbi.Study:
    return replace(SMALL, controllers={**CONTROLLERS, name: maker})
