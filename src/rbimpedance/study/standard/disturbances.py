"""The twelve disturbances of the standard study: plants that no controller knows, and what happens to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from ..._common.arrays import Array
from ...control.encoders import QuantizedEncoders
from ...control.protocol import Controller
from ...interaction import FrameWrench, Push, Wall
from ...interaction.estimators import MomentumObserver
from ...simulation.plants import DrivenPlant
from ...tuning import ImperfectController
from ..definition import Experiment, Task
from .arms import DELAY
from .draws import Draws

Disturbance: TypeAlias = Callable[[Task, np.random.Generator], Experiment]
"""Draws what one run is put through."""

OBSERVER_GAIN = 50.0
"""Bandwidth of the observer that takes the place of a force sensor [rad/s]."""

COUNTS = 2**21
"""Of an encoder, per turn of the joint: 14 bits on a motor behind a gear of 128."""

ENCODER_BANDWIDTH = 2000.0
"""Of the low-pass behind the encoders' differences [rad/s]."""

SPRING_SUBSTEPS = 8
"""Physics steps per control period that the stiffest gear on the lightest link needs."""


@dataclass(frozen=True)
class Chirp:
    """A wrench whose frequency rises steadily.

    Attributes:
        wrench: At its largest, shape (6,).
        low: Frequency at t = 0 [Hz].
        rise: How fast it rises [Hz/s].
    """

    wrench: Array
    low: float = 0.2
    rise: float = 0.76

    def __call__(self, t: float) -> Array:
        """Return the wrench at a time [s]."""
        phase = 2.0 * np.pi * (self.low * t + self.rise * t**2 / 2.0)
        return np.array(np.sin(phase) * self.wrench)


def nothing(task: Task, rng: np.random.Generator) -> Experiment:
    """The plant is what the controllers take it for."""
    return Draws(task, rng).experiment(task.model)


def payload(task: Task, rng: np.random.Generator) -> Experiment:
    """A mass in the hand."""
    draws = Draws(task, rng)
    return draws.experiment(draws.loaded(task.arm))


def friction(task: Task, rng: np.random.Generator) -> Experiment:
    """Friction in every joint, viscous and dry, of an arm that is known otherwise."""
    draws = Draws(task, rng)
    return draws.experiment(draws.rubbing(task.model))


def everything(task: Task, rng: np.random.Generator) -> Experiment:
    """Payload, links and friction at once."""
    draws = Draws(task, rng)
    return draws.experiment(draws.rubbing(draws.loaded(draws.scaled(task.arm))))


def push(task: Task, rng: np.random.Generator) -> Experiment:
    """A hand pushes the tool for two seconds; the arm has a payload, as in all that follow."""
    draws = Draws(task, rng)
    wrench = Push(draws.wrench(3.0, 8.0), start=1.5, duration=2.0, rise=0.3)
    return draws.experiment(draws.loaded(task.arm), environment=wrench)


def chirp(task: Task, rng: np.random.Generator) -> Experiment:
    """A force at the tool whose frequency rises from 0.2 to 4 Hz."""
    draws = Draws(task, rng)
    wrench = FrameWrench(Chirp(draws.wrench(2.0, 5.0)))
    return draws.experiment(draws.loaded(task.arm), environment=wrench)


def wall(task: Task, rng: np.random.Generator) -> Experiment:
    """A wall across the tool's path, at half of it."""
    draws = Draws(task, rng)
    trajectory, plant = draws.motion(), draws.loaded(task.arm)
    instants = 0.0, draws.inputs["period"] / 2.0
    here, there = (task.arm.frame_placement(trajectory(t).q)[1] for t in instants)
    stiffness = draws.log_uniform("wall_stiffness", 1e3, 1e4)
    met = Wall((here + there) / 2.0, here - there, stiffness, damping=20.0)
    return draws.experiment(plant, trajectory=trajectory, environment=met)


def noise(task: Task, rng: np.random.Generator) -> Experiment:
    """Noisy positions and velocities."""
    draws, seed = Draws(task, rng), int(rng.integers(2**31))
    wrap = partial(ImperfectController, position_noise=1e-4, velocity_noise=1e-3, seed=seed)
    return draws.experiment(draws.loaded(task.arm), wrap=wrap)


def delay(task: Task, rng: np.random.Generator) -> Experiment:
    """Measurements that are late by as much as the gains are made for."""
    draws, wrap = Draws(task, rng), partial(ImperfectController, delay=DELAY)
    return draws.experiment(draws.loaded(task.arm), wrap=wrap)


def no_force_sensor(task: Task, rng: np.random.Generator) -> Experiment:
    """The push again, estimated by a momentum observer, which interprets the unknown payload as a push, too."""
    draws = Draws(task, rng)
    wrench = Push(draws.wrench(3.0, 8.0), start=1.5, duration=2.0, rise=0.3)
    sensor = MomentumObserver(task.model, OBSERVER_GAIN, task.dt)
    return draws.experiment(draws.loaded(task.arm), environment=wrench, sensor=sensor)


def drives(task: Task, rng: np.random.Generator) -> Experiment:
    """Motors that lag and ripple, and encoders that count: together as late as the gains are made for."""
    draws = Draws(task, rng)
    lag = draws.uniform("torque_lag", 0.5e-3, 1e-3)
    driven = DrivenPlant(draws.loaded(task.arm), time_constant=lag, ripple=0.01)
    return draws.experiment(driven, wrap=counting)


def elastic_joints(task: Task, rng: np.random.Generator) -> Experiment:
    """Gears that yield, encoders on the motors: nothing that the gains are made for."""
    draws = Draws(task, rng)
    stiffness = draws.log_uniform("joint_stiffness", 5e3, 2e4)
    yielding = DrivenPlant(draws.loaded(task.arm), stiffness=stiffness)
    return draws.experiment(yielding, substeps=SPRING_SUBSTEPS)


def counting(controller: Controller[Any]) -> Controller[Any]:
    """Return the controller behind encoders, whose differences are its velocities."""
    return QuantizedEncoders(
        controller,
        resolution=2.0 * np.pi / COUNTS,
        velocity="differentiated",
        bandwidth=ENCODER_BANDWIDTH,
    )


DISTURBANCES: Mapping[str, Disturbance] = MappingProxyType(
    {
        "nothing": nothing,
        "payload": payload,
        "friction": friction,
        "everything": everything,
        "push": push,
        "chirp": chirp,
        "wall": wall,
        "noise": noise,
        "delay": delay,
        "no force sensor": no_force_sensor,
        "drives": drives,
        "elastic joints": elastic_joints,
    }
)
"""By name."""
