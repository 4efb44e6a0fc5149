"""Tables of the tick: every way to take it, its phases, laws, arms, numbers of joints."""

from __future__ import annotations

import numpy as np

from rbimpedance.cli import timing
from rbimpedance.cli.timing import (
    BACKENDS,
    REALTIME,
    RNEA,
    STEP,
    controller,
    inputs,
    interleaved,
    timer,
)

from . import ticks
from .cases import SCHEMES, SURFACES, chain, load
from .percentiles import median, percentiles, ratios
from .plan import Setting
from .report import RATIO, Line, Section

_TURNS = 50
_PHASES = (
    "check of the inputs",
    "filter, errors, surface, reaching law",
    "torque of the model",
    "friction, limits, flags",
)
TOTAL = "total"


def tick(setting: Setting) -> Section:
    """Every way to take a tick, back to back."""
    timers = {name: timer(made) for name, made in ticks.of_arm(setting.arm).items()}
    found = interleaved(timers, setting.plan.ticks, rounds=_TURNS, on_tick=setting.on_tick)
    lines = tuple(
        Line(name, percentiles(durations) | ratios(durations, found[RNEA]))
        for name, durations in found.items()
    )
    return Section(
        "tick",
        f"One tick, back to back: {setting.robot}, {setting.arm.nv} joints",
        f"{setting.plan.ticks} ticks of each kind alternately, in chunks, over 64 states along a motion; fast terminal "
        "surface, matched scheme. Percentiles are compared with the same percentile of `pin.rnea`.",
        lines,
    )


def phases(setting: Setting) -> Section:
    """Where the time of a tick goes."""
    from .stages import stage_times  # noqa: PLC0415 (Numba is loaded when needed)

    given = inputs(setting.arm)
    made = {backend: controller(setting.arm, backend) for backend in BACKENDS}
    timers = {STEP[b]: timer(timing.step(made[b], given)) for b in BACKENDS}
    timers[RNEA] = timer(timing.rnea(setting.arm, given))
    found = interleaved(timers, setting.plan.ticks, rounds=_TURNS, on_tick=setting.on_tick)
    medians = {name: median(durations) for name, durations in found.items()}
    law, model, after, check = stage_times(made["compiled"], given[0], setting.plan.runs)
    lines = []
    for backend, model_time in zip(BACKENDS, (medians[RNEA], model), strict=True):
        total = medians[STEP[backend]]
        parts = dict(zip(_PHASES, (check, law, model_time, after), strict=True))
        parts["call from Python, output, state"] = total - sum(parts.values())
        for name, value in (parts | {TOTAL: total}).items():
            figures = {"time [µs]": value, f"{RATIO} the tick": value / total}
            lines.append(Line(f"{backend}: {name}", figures))
    return Section(
        "phases",
        f"Where the time of a tick goes: {setting.robot}",
        "Stages of the compiled code by differences, in a loop inside compiled code that sees one state over and over; "
        'the model\'s torque of "pinocchio" is `pin.rnea` called from Python; the rest of the median tick is the '
        "last line.",
        tuple(lines),
    )


def laws(setting: Setting) -> Section:
    """Every surface with every scheme."""
    given, lines = inputs(setting.arm), []
    for k, (surface, scheme) in enumerate((s, c) for s in SURFACES for c in SCHEMES):
        timers = {RNEA: timer(timing.rnea(setting.arm, given))}
        for backend in BACKENDS:
            made = controller(setting.arm, backend, surface, scheme)
            timers[STEP[backend]] = timer(timing.step(made, given))
            timers[REALTIME[backend]] = timer(timing.realtime(made, given))
        found = interleaved(timers, setting.plan.ticks // 4, rounds=_TURNS // 2)
        yardstick = median(found.pop(RNEA))
        figures = {f"{RATIO} rnea, {name}": median(x) / yardstick for name, x in found.items()}
        lines.append(Line(f"{surface}, {scheme}", figures))
        setting.on_tick(k + 1, len(SURFACES) * len(SCHEMES))
    return Section(
        "laws",
        f"Any surface, any scheme: {setting.robot}",
        "Medians back to back as ratios to `pin.rnea` in the same turns.",
        tuple(lines),
    )


def arms(setting: Setting) -> Section:
    """Every arm."""
    lines = []
    for k, name in enumerate(setting.plan.arms):
        arm = load(name)
        timers = {key: timer(made) for key, made in ticks.of_arm(arm).items()}
        found = interleaved(timers, setting.plan.ticks // 4, rounds=_TURNS // 2)
        yardstick = median(found.pop(RNEA))
        figures = {"joints": float(arm.nv), "pin.rnea [µs]": yardstick}
        figures |= {f"{RATIO} rnea, {key}": median(x) / yardstick for key, x in found.items()}
        lines.append(Line(name, figures))
        setting.on_tick(k + 1, len(setting.plan.arms))
    return Section(
        "arms",
        "Arms",
        "Medians back to back as ratios to `pin.rnea` on the same arm in the same turns.",
        tuple(lines),
    )


def scaling(setting: Setting) -> Section:
    """Chains of 1 to 50 joints."""
    lines, numbers = [], setting.plan.joints
    medians: dict[str, list[float]] = {}
    for k, n in enumerate(numbers):
        timers = {name: timer(made) for name, made in ticks.of_arm(chain(n)).items()}
        found = interleaved(timers, setting.plan.ticks // 10, rounds=_TURNS // 2)
        figures = {f"{name} [µs]": median(durations) for name, durations in found.items()}
        lines.append(Line(f"{n} joints", figures))
        for name, value in figures.items():
            medians.setdefault(name, []).append(value)
        setting.on_tick(k + 1, len(numbers))
    fits = {name: linear_fit(numbers, values) for name, values in medians.items()}
    for i, name in enumerate(("fit: a joint [µs]", "fit: beside the joints [µs]", "fit: R²")):
        lines.append(Line(name, {column: fit[i] for column, fit in fits.items()}))
    return Section(
        "scaling",
        "Chains of n joints",
        "Medians back to back, and the straight line through them.",
        tuple(lines),
    )


def linear_fit(x: tuple[int, ...], y: list[float]) -> tuple[float, float, float]:
    """Return slope, intercept and coefficient of determination of the straight line through points."""
    slope, intercept = np.polyfit(x, y, 1)
    rest = np.array(y) - (slope * np.array(x) + intercept)
    return float(slope), float(intercept), float(1.0 - rest.var() / np.var(y))
