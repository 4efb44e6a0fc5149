"""A day of ticks: drift of the loop and growth of the memory."""

from __future__ import annotations

import resource
import time
from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT, Array, law
from benchmarks.pages import markdown
from rbimpedance.trajectories import cosine

from .guarded_arm import PEAK_RATE

PERIOD = 6.0  # s, of the motion; it is looked at once a minute, ten periods
NAMES = ("q_r", "e1", "s", "tau")


def day(hours: float) -> str:
    """Run two_link for so long by compiled code, compare the same phase of every minute, and return the table."""
    minutes(10)
    first, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    found = minutes(round(60.0 * hours))
    last, took = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic() - began
    header = ("same phase of every minute", "spread in the first hour", "spread in the last hour")
    rows = [[name, *_spreads(found[name][0][2:])] for name in NAMES]  # two minutes to settle
    said = (
        f"{hours:g} h, {round(3600 * hours / DT):,} ticks in {took / 60:.1f} min; peak memory {first / 1024:.0f} MB "
        f"after ten minutes, {last / 1024:.0f} MB at the end."
    )
    return f"{markdown((*header, 'moved in between'), rows)}\n\n{said}"


def minutes(count: int) -> Any:
    """Run so many minutes; logged is one tick of each."""
    arm = rbi.load_robot("two_link")
    limits = rbi.Limits(60.0, PEAK_RATE)
    controller = law(arm, rbi.SuperTwisting(15.0, 40.0), limits=limits, backend="compiled")
    return rbi.simulate_batch(
        [controller],
        arm.with_payload(0.3),
        cosine(arm, center=0.5, amplitude=0.2, period=PERIOD),
        environment=np.array([3.0, 0.0, 2.0, 0.0, 0.0, 0.0]),
        duration=60.0 * count,
        substeps=2,
        channels=NAMES,
        every=round(60.0 / DT),
        metrics=False,
    )


def _spreads(x: Array) -> tuple[str, str, str]:
    """Spread of a channel in the first and in the last hour, and the distance of their means."""
    hour = min(60, len(x) // 2)
    early, late = x[:hour], x[-hour:]
    moved = np.abs(late.mean(axis=0) - early.mean(axis=0)).max()
    first, last = (f"{np.ptp(part, axis=0).max():.1e}" for part in (early, late))
    return first, last, f"{moved:.1e}"
