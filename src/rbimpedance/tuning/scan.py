"""Short runs of every sample from both sides of the motion, and a search from the worst: who goes astray on its way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..control.backends import is_available
from ..law.impedance import Impedance
from ..simulation.batch import BatchResult, simulate_batch
from ..trajectories.reference import difference_each
from .gain_design import Design, DesignTask
from .plant_sample import PlantSample
from .worst_case import both_sides, controller_for

_SHARE, _LONGEST = 0.3, 1.0  # of the motion, and in seconds
_NEAR, _FROM = 8, 2  # plants of the search, around how many


class Scan(NamedTuple):
    """What short runs of many plants show; arrays have shape (nv,).

    Attributes:
        peak: Largest true error abs(e1) [rad or m].
        peak_torque: Largest torque [N·m or N].
        worst: The plants that came off worst: one that diverged, the largest error and the largest torque.
    """

    peak: Array
    peak_torque: Array
    worst: tuple[PlantSample, ...]


def scan(task: DesignTask, design: Design, impedance: Impedance, q0: Array) -> Scan | None:
    """Run all samples of a design for a short time; None where nothing compiled can do it.

    Args:
        task: The requirements.
        design: Gains with a finite margin.
        impedance: Target impedance.
        q0: Initial configuration, shape (nq,).
    """
    if task.backend != "compiled" or not is_available("rollout"):
        return None
    samples = design.measured.samples
    if any(sample.is_imperfect for sample in samples):  # these run one by one: the corners alone
        samples = samples[len(samples) // 2 :]
    found = _runs(task, design, impedance, q0, samples)
    badness = found.badness
    for k in np.argsort(-badness)[:_FROM].tolist():
        near = task.uncertainty.near(task.arm, found.samples[k], _NEAR, seed=task.seed + k)
        found = found.joined(_runs(task, design, impedance, q0, near))
    return found.scan()


class _Found(NamedTuple):
    """Largest errors and torques of samples, each of shape (samples, nv); infinite where one diverged."""

    samples: tuple[PlantSample, ...]
    peak: Array
    torque: Array

    @property
    def badness(self) -> Array:
        """How far off a plant came, joint by joint in units of the usual."""
        usual = np.median(self.peak, axis=0) + 1e-12
        badness: Array = (self.peak / usual).max(axis=1)
        return badness

    def joined(self, other: _Found) -> _Found:
        """Both together."""
        return _Found(
            self.samples + other.samples,
            np.vstack([self.peak, other.peak]),
            np.vstack([self.torque, other.torque]),
        )

    def scan(self) -> Scan:
        """The worst of them."""
        leaders = {int(np.argmax(self.badness)), int(np.argmax(self.peak.max(axis=1)))}
        finite = np.isfinite(self.peak).all(axis=1)
        return Scan(
            self.peak[finite].max(axis=0, initial=0.0),
            self.torque[finite].max(axis=0, initial=0.0),
            tuple(self.samples[i] for i in sorted(leaders)),
        )


def _runs(
    task: DesignTask,
    design: Design,
    impedance: Impedance,
    q0: Array,
    samples: Sequence[PlantSample],
) -> _Found:
    """Run plants from both sides of the motion."""
    law = controller_for(design, task.dt, impedance, task.limits, task.backend)
    starts = both_sides(task, q0)
    ticks = max(round(min(_SHARE * task.duration, _LONGEST) / task.dt), 10)
    controllers = [sample.wrap(law, noisy=False) for sample in samples]
    batch = simulate_batch(
        controllers * len(starts),
        [sample.plant for sample in samples] * len(starts),
        task.trajectory,
        q0=np.repeat(starts, len(samples), axis=0),
        duration=ticks * task.dt,
        channels=("q", "q_r", "tau"),
        metrics=False,
    )
    errors, torques = _largest(task, batch)
    sides = (len(starts), len(samples), task.arm.nv)
    return _Found(
        tuple(samples), errors.reshape(sides).max(axis=0), torques.reshape(sides).max(axis=0)
    )


def _largest(task: DesignTask, batch: BatchResult) -> tuple[Array, Array]:
    """Largest error and torque of every world, each of shape (N, nv)."""
    pairs = zip(batch["q"], batch["q_r"], strict=True)
    errors = np.array([np.abs(difference_each(task.arm, q, q_r)).max(axis=0) for q, q_r in pairs])
    torques = np.abs(batch["tau"]).max(axis=1)
    errors[batch.diverged], torques[batch.diverged] = np.inf, np.inf
    return errors, torques
