"""One task: the proposal, adversarial plants in closed loop, and how they compare with what the proposal states."""

from __future__ import annotations

import time
import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.arms import Array
from rbimpedance.tuning import GainProposal, propose_gains

from . import by_hand
from .cases import Case
from .closed_loops import LATE, Start, run
from .plants import Plants

SEARCHES, AROUND = 2, 4


class Tested(NamedTuple):
    """What became of one plant; each figure is the largest of any joint over what is stated for it.

    Attributes:
        share: The plant.
        diverged: Whether it did.
        peak: Largest error over the stated peak.
        torque: Largest torque over the stated one.
        error: Largest late error over the stated bound.
        late: Largest late error [rad or m].
        stated: What is stated for that joint.
        reaching: Time from which s stays within its bound, over `reaching_time`.
        settling: Time from which e1 does, over `total_time`.
    """

    share: Array
    diverged: bool
    peak: float
    torque: float
    error: float
    late: float
    stated: float
    reaching: float
    settling: float

    @property
    def badness(self) -> float:
        """How near the plant comes to break something."""
        return np.inf if self.diverged else max(self.peak, self.error)


def attack(case: Case, plants: int | None = None) -> dict[str, Any]:
    """Return what became of a task.

    Args:
        case: The task.
        plants: At most this many of the first plants, without a search, for a quick look; None for all.
    """
    arm, unknown, trajectory, dt, more = case.build()
    task = {"backend": "compiled", "remedy_time": 0.0, **more}
    begin, used = time.perf_counter(), time.thread_time()
    proposal = propose_gains(arm, unknown, trajectory, dt, **task)
    took = {"seconds": time.perf_counter() - begin, "cpu": time.thread_time() - used}
    row = {
        "case": case.name,
        "family": case.family,
        "feasible": proposal.feasible,
        "joints": arm.nv,
    }
    row |= took | {"reason": proposal.reason, "proven": proposal.coupling.is_proven}
    seed = zlib.crc32(case.name.encode())
    source = Plants(unknown, arm, seed)
    starts = both_starts(proposal, more)
    if not proposal.feasible:
        by = by_hand.tune(proposal, source, starts)
        return row | {"by_hand": by}
    tested = _searched(proposal, source, starts, plants)
    return row | _summary(tested) | {"margin": float(proposal.margin.max())}


def both_starts(proposal: GainProposal, more: dict[str, Any]) -> list[Start]:
    """The start of the task, and its mirror image on the other side of the motion."""
    arm, duration = proposal.nominal, more["duration"]
    on_motion = np.asarray(proposal.trajectory(0.0).q)
    away = arm.difference(more["q0"], on_motion)
    if not np.any(away):
        return [Start(on_motion, duration)]
    other = np.clip(arm.integrate(on_motion, away), arm.lower, arm.upper)
    return [Start(more["q0"], duration), Start(other, duration)]


def _searched(
    proposal: GainProposal, source: Plants, starts: Sequence[Start], most: int | None
) -> list[Tested]:
    """Test the first plants, then those near the worst of them."""
    tested = test(proposal, source, source.first()[:most], starts)
    for _ in range(SEARCHES if most is None else 0):
        worst = sorted(tested, key=lambda one: -one.badness)[:2]
        near = [point for one in worst for point in source.near(one.share, AROUND)]
        tested += test(proposal, source, near, starts)
    return tested


def test(
    proposal: GainProposal, source: Plants, points: Sequence[Array], starts: Sequence[Start]
) -> list[Tested]:
    """Run plants from every start; the worst start of each counts."""
    samples = [source.sample(point) for point in points]
    law, tested = proposal.controller(), []
    runs = [run(law, samples, proposal, start) for start in starts]
    for i, point in enumerate(points):
        of_starts = [_compared(proposal, point, {k: x[i] for k, x in one.items()}) for one in runs]
        figures = zip(*of_starts, strict=True)
        next(figures)
        tested.append(Tested(point, *map(max, figures)))
    return tested


def _compared(proposal: GainProposal, point: Array, log: dict[str, Array]) -> Tested:
    if log["diverged"]:
        return Tested(point, True, np.inf, np.inf, np.inf, np.inf, np.nan, np.inf, np.inf)
    said, t = stated(proposal), log["t"]
    true, s = np.abs(log["true"]), np.abs(proposal.surface.value(log["e1"], log["e2"]))
    late = true[t >= LATE * t[-1]].max(axis=0)
    worst = int(np.argmax(late / said["error"]))
    reaching = _last_outside(s, said["s"], t) / said["reaching_time"]
    settling = _last_outside(true, said["error"], t) / said["total_time"]
    return Tested(
        share=point,
        diverged=False,
        peak=float((true.max(axis=0) / said["peak"]).max()),
        torque=float((np.abs(log["tau"]).max(axis=0) / said["torque"]).max()),
        error=float(late[worst] / said["error"][worst]),
        late=float(late[worst]),
        stated=float(said["error"][worst]),
        reaching=float(reaching.max()),
        settling=float(settling.max()),
    )


def stated(proposal: GainProposal) -> dict[str, Array]:
    """What a proposal states of each joint."""
    return {
        "error": proposal.error,
        "s": proposal.s_error,
        "peak": proposal.peak,
        "torque": proposal.peak_torque,
        "reaching_time": proposal.reaching_time,
        "total_time": proposal.total_time,
    }


def _last_outside(x: Array, bound: Array, t: Array) -> Array:
    """The last time at which each joint is beyond its bound."""
    outside = x > bound
    times: Array = np.where(outside, t[:, None], 0.0).max(axis=0)
    return times


def _summary(tested: Sequence[Tested]) -> dict[str, Any]:
    largest = {
        name: max(getattr(one, name) for one in tested) for name in ("peak", "torque", "error")
    }
    times = {name: max(getattr(one, name) for one in tested) for name in ("reaching", "settling")}
    counted = {
        f"beyond_{name}": sum(getattr(one, name) > 1.0 for one in tested)
        for name in (*largest, *times)
    }
    worst = max(tested, key=lambda one: one.error)
    return {
        "plants": len(tested),
        "diverged": sum(one.diverged for one in tested),
        **largest, **times, **counted,
        "late": worst.late,
        "stated": worst.stated,
        "worst_plant": worst.share.round(3).tolist(),
    }  # fmt: skip
