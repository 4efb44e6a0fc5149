"""What would help where no gains can be proposed: each way is tried on the bounds, without simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from .gain_design import Design, Task, design, measure_task

KNOWN_ARMATURE = 0.1
"""Reflected inertia that geared arms of this size have [kg·m²]; URDFs leave it out."""


def remedies(task: Task, found: Design) -> tuple[str, ...]:
    """Return what would help, with what it would change, the best way first.

    Args:
        task: What was asked for.
        found: The design that cannot be carried.
    """
    tried = [_first_that_is_enough(way) for way in _ways(task)]
    tried.sort(key=lambda way: (way[1].joint is not None, float(way[1].error.max())))
    return tuple(_told(words, found, way) for words, way in tried if _helps(found, way))


def _first_that_is_enough(way: Sequence[tuple[str, Task]]) -> tuple[str, Design]:
    """The gentlest step of a way that the bounds allow gains for, else the strongest."""
    tried = ((words, design(other, measure_task(other))) for words, other in way)
    found = next(tried)
    for stronger in tried:
        if found[1].joint is None:
            break
        found = stronger
    return found


def _ways(task: Task) -> Iterator[list[tuple[str, Task]]]:
    """Ways to an easier task, each as steps from gentle to strong, with what they are called."""
    uncertainty, arm = task.uncertainty, task.arm

    def but(**changes: object) -> Task:
        return replace(task, uncertainty=uncertainty.but(**changes))

    if (arm.armature < KNOWN_ARMATURE).any() and uncertainty.armature is None:
        words = f"a known armature, if the arm is geared: {KNOWN_ARMATURE:g} kg·m² for example"
        geared = arm.with_armature(np.maximum(arm.armature, KNOWN_ARMATURE))
        yield [(words, replace(task, arm=geared))]
    yield [
        (f"a shorter period, dt = {task.dt / n:g} s", replace(task, dt=task.dt / n))
        for n in (2, 4, 8)
    ]
    low, high = uncertainty.payload.tolist()
    if high > low:
        most = [low + share * (high - low) for share in (0.5, 0.25)]
        yield [(f"a payload of {m:g} kg at most", but(payload=(low, m))) for m in most]
        yield [(f"a payload that is known, {high:g} kg", but(payload=(high, high)))]
    if uncertainty.delay:
        ticks = range(uncertainty.delay - 1, -1, -1)
        yield [(f"a delay of {n} ticks", but(delay=n)) for n in ticks]
    noise = {name: getattr(uncertainty, name) for name in ("position_noise", "velocity_noise")}
    if any(noise.values()):
        yield [
            (f"1/{n} of the noise", but(**{name: size / n for name, size in noise.items()}))
            for n in (2, 10)
        ]
    if task.surface is not None:
        yield [("a surface of the proposal's own", replace(task, surface=None))]


def _helps(found: Design, way: Design) -> bool:
    """Whether the bounds then allow for gains, or at least come closer to it."""
    return way.joint is None or way.margin < found.margin or way.error.max() < found.error.max()


def _told(words: str, found: Design, way: Design) -> str:
    enough = "enough by the bounds" if way.joint is None else "not enough alone"
    return (
        f"{words}: margin {_figure(found.margin)} → {_figure(way.margin)}, "
        f"error {_figure(found.error.max())} → {_figure(way.error.max())} rad; {enough}"
    )


def _figure(value: float) -> str:
    return f"{value:.2g}" if np.isfinite(value) else "none"
