"""Draws of one run: each is kept by its name, for the row."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._common.arrays import Array
from ...robot.arm_model import ArmModel
from ...simulation.plants import Plant
from ...trajectories import Trajectory, cosine
from ..definition import Experiment, Task
from .arms import AMPLITUDE, ARMS, PERIOD, posture


@dataclass
class Draws:
    """What is drawn for one run.

    Attributes:
        task: What the controllers were made for.
        rng: Source of randomness.
        inputs: What was drawn so far.
    """

    task: Task
    rng: np.random.Generator
    inputs: dict[str, float] = field(default_factory=dict)

    def uniform(self, name: str, low: float, high: float) -> float:
        """Draw a number uniformly."""
        self.inputs[name] = float(self.rng.uniform(low, high))
        return self.inputs[name]

    def log_uniform(self, name: str, low: float, high: float) -> float:
        """Draw a number whose logarithm is uniform."""
        self.inputs[name] = float(np.exp(self.rng.uniform(np.log(low), np.log(high))))
        return self.inputs[name]

    def direction(self) -> Array:
        """Draw a direction in space, uniformly, shape (3,)."""
        x = self.rng.normal(size=3)
        return np.array(x / np.linalg.norm(x))

    def wrench(self, low: float, high: float) -> Array:
        """Draw a force of that size [N] in any direction, as a wrench, shape (6,)."""
        return np.concatenate([self.uniform("force", low, high) * self.direction(), np.zeros(3)])

    def scaled(self, arm: ArmModel) -> ArmModel:
        """Return the arm with links lighter or heavier by up to a tenth."""
        return arm.with_scaled_inertia(self.uniform("inertia_scale", 0.9, 1.1))

    def loaded(self, arm: ArmModel) -> ArmModel:
        """Return the arm with a mass in its hand, up to the largest, somewhere about the tool."""
        mass = self.uniform("payload", 0.0, ARMS[self.task.robot].payload)
        return arm.with_payload(mass, self.rng.uniform((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1)))

    def rubbing(self, arm: ArmModel) -> ArmModel:
        """Return the arm with viscous and dry friction in every joint."""
        viscous, coulomb = self.rng.uniform(0.0, [[0.5], [0.3]], (2, arm.nv))
        self.inputs |= {"viscous": float(viscous.mean()), "coulomb": float(coulomb.mean())}
        return arm.with_friction(viscous, coulomb)

    def motion(self) -> Trajectory:
        """Return an oscillation of all joints about the arm's posture, no faster than the gains are designed for."""
        arm = self.task.arm
        center = arm.integrate(posture(arm), self.rng.uniform(-0.1, 0.1, arm.nv))
        amplitude = (
            AMPLITUDE * self.rng.uniform(0.6, 1.0, arm.nv) * self.rng.choice([-1, 1], arm.nv)
        )
        period = self.uniform("period", PERIOD, 1.5 * PERIOD)
        return cosine(arm, center=center, amplitude=amplitude, period=period)

    def experiment(self, plant: ArmModel | Plant[Any], **more: Any) -> Experiment:
        """Return the experiment; it begins at rest, on a motion that is drawn where none is given."""
        trajectory = more.pop("trajectory", None) or self.motion()
        return Experiment(
            plant=plant,
            trajectory=trajectory,
            q0=trajectory(0.0).q,
            inputs=self.inputs,
            **more,
        )
