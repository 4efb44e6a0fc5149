"""Tables of loops: ticks paced at 1 kHz, one closed loop, many at once."""

from __future__ import annotations

import os

from rbimpedance.cli import timing
from rbimpedance.cli.timing import (
    BACKENDS,
    DT,
    RNEA,
    batch_timer,
    inputs,
    interleaved,
    plants,
    simulate_timer,
    timer,
)

from . import paced as pacing
from . import ticks
from .percentiles import median, percentiles, ratios
from .plan import Setting
from .report import RATIO, Line, Section

_BATCH_TURNS = 3


def paced(setting: Setting) -> Section:
    """Every way to take a tick at 1 kHz, by state of the garbage collector."""
    lines, beside = [], pacing.ballast()
    for mode in pacing.COLLECTORS:
        things = ticks.of_arm(setting.arm)
        for made in things.values():
            next(made)
        with pacing.collector(mode):
            found = pacing.run(things, setting.plan.paced, DT, setting.on_tick)
        yardstick = found.durations[RNEA]
        for name, durations in found.durations.items():
            figures = percentiles(durations) | ratios(durations, yardstick)
            lines.append(Line(f"gc {mode}: {name}", figures))
        lines.append(Line(f"gc {mode}: wake-up late by", percentiles(found.late)))
        lines.append(
            Line(f"gc {mode}: longest, entry in the log included", {"max [µs]": found.pause})
        )
    del beside
    return Section(
        "paced",
        f"One tick, paced at 1 kHz: {setting.robot}",
        f"{setting.plan.paced} periods; in each, every kind of tick once, at equal distances, with the process asleep "
        f"in between, and a dict into a log. The program has {pacing.BALLAST} dicts with lists in memory.",
        tuple(lines),
    )


def loop(setting: Setting) -> Section:
    """The closed loop of one world."""
    given, ticks_a_run = inputs(setting.arm), setting.plan.loop_ticks
    timers = {
        RNEA: timer(timing.rnea(setting.arm, given)),
        "pin.aba": timer(ticks.aba(setting.arm, given)),
        **{f"simulate, {b}": simulate_timer(setting.arm, b) for b in BACKENDS},
    }
    turns = setting.plan.runs
    found = interleaved(timers, ticks_a_run * turns, rounds=turns, on_tick=setting.on_tick)
    yardstick = median(found[RNEA]) + median(found["pin.aba"])
    lines = [
        Line(name, {"a step [µs]": median(x), f"{RATIO} (rnea + aba)": median(x) / yardstick})
        for name, x in found.items()
    ]
    return Section(
        "loop",
        f"Closed loop: {setting.robot}",
        f"`simulate` with one physics step a tick, logs and everything else included, runs of {ticks_a_run} ticks; "
        "compared with one `pin.rnea` and one `pin.aba` called from Python.",
        tuple(lines),
    )


def batch(setting: Setting) -> Section:
    """Many worlds at once."""
    given, plan, lines = inputs(setting.arm), setting.plan, []
    cores = tuple(dict.fromkeys((1, os.cpu_count() or 1)))
    for k, count in enumerate(plan.worlds):
        worlds = plants(setting.arm, count)
        timers = {
            RNEA: timer(timing.rnea(setting.arm, given)),
            "pin.aba": timer(ticks.aba(setting.arm, given)),
            **{str(n): batch_timer(setting.arm, worlds, n) for n in cores},
        }
        found = interleaved(timers, _BATCH_TURNS * plan.batch_ticks, rounds=_BATCH_TURNS)
        yardstick = median(found[RNEA]) + median(found["pin.aba"])
        for threads in cores:
            step = median(found[str(threads)])
            figures = {"a world-step [µs]": step, f"{RATIO} (rnea + aba)": step / yardstick}
            lines.append(Line(f"{count} worlds, {threads} threads", figures))
        setting.on_tick(k + 1, len(plan.worlds))
    return Section(
        "batch",
        f"Many closed loops at once: {setting.robot}",
        f"`simulate_batch`, {plan.batch_ticks} ticks with one physics step each, every world with a payload of its "
        "own, metrics from every tick included; the whole call over worlds times ticks.",
        tuple(lines),
    )
