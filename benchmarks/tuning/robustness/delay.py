"""The lightest tool mass with which contact is stable, against the age of the force readings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance.interaction import Delay, LowPass, contact_damping, recommended_mass, smallest_mass

from . import pushed
from .common import Figures, Job, Options, Part
from .pushed import FIRST, SETTINGS, TOOL_STIFFNESS, UP, WALL

AGES = (0, 1, 2, 3, 5, 7, 10)
RATIOS = (1.0, 0.7, 0.3)
CUTOFFS = (100.0, 50.0, 20.0, 10.0)
AGES_HEAVY = (0, 2, 5, 10)
AGES_ELSEWHERE = (2, 10)


def old_readings(place: str, plant: str, ratio: float, age: int, seed: int) -> Figures:
    """Readings that are some ticks old."""
    theory = smallest_mass(WALL, (age + 0.5) * DT, TOOL_STIFFNESS, ratio)
    rule = recommended_mass(WALL, TOOL_STIFFNESS, DT, age * DT, ratio)
    row = {"place": place, "plant": plant, "ratio": ratio, "age": age, "theory": theory}
    return row | _measured(place, plant, ratio, Delay(age), rule, seed)


def low_pass(ratio: float, cutoff: float, seed: int) -> Figures:
    """Readings behind a filter."""
    sensor = LowPass(cutoff, DT)
    rule = recommended_mass(WALL, TOOL_STIFFNESS, DT, sensor.delay, ratio)
    row = {"ratio": ratio, "cutoff": cutoff, "theory": _lightest_low_pass(ratio, cutoff)}
    return row | _measured(FIRST, "exact", ratio, sensor, rule, seed)


def _measured(place: str, plant: str, ratio: float, sensor: Any, rule: float, seed: int) -> Figures:
    force = _meet(place, plant, ratio, rule, sensor, seed)
    return {
        "lightest": _lightest(place, plant, ratio, sensor, seed),
        "rule": rule,
        "contacts": pushed.contacts(force),
        "peak": force.max(),
        "steady": force[-1],
    }


def _lightest(place: str, plant: str, ratio: float, sensor: Any, seed: int) -> float:
    """Smallest stable M_x by bisection on its logarithm, to 4 %."""
    low, high = 1e-3, 10.0
    while high / low > 1.04:
        middle = float(np.sqrt(low * high))
        stable = _dies_out(_meet(place, plant, ratio, middle, sensor, seed))
        low, high = (low, middle) if stable else (middle, high)
    return high


def _meet(place: str, plant: str, ratio: float, mass: float, sensor: Any, seed: int) -> Array:
    """Contact force at every tick of 2.5 s, from 0.02 m before the wall on; NaN from where the run diverges."""
    setting = SETTINGS[place]
    arm, impedance, wall, reaching = pushed.at_wall(setting, seed, mass, ratio)
    trajectory = pushed.approach(arm, setting.q, 0.02)
    true_arm = arm if plant == "exact" else pushed.heavy(arm)
    law = pushed.law(arm, impedance, reaching)
    how: Any = {"sensor": sensor, "duration": 2.5, "substeps": 2}
    try:
        result = pushed.met(law, true_arm, trajectory, wall, **how)
    except rbi.DivergenceError as error:
        return np.append(pushed.forces(error.result, true_arm, wall), np.nan)
    return pushed.forces(result, true_arm, wall)


def _dies_out(force: Array) -> bool:
    """Whether contact lasts and its oscillation, what a parabola leaves of the force, shrinks or is below 0.1 N."""
    if not np.isfinite(force).all():
        return False
    swings = []
    for begin in (1700, 2100):
        window = force[begin : begin + 400]
        ticks = np.arange(len(window))
        fit = np.polynomial.Polynomial.fit(ticks, window, 2)
        swings.append(float(np.std(window - fit(ticks))))
    return bool(force[1700:].min() > 0.0 and swings[1] < max(0.9 * swings[0], 0.1))


def _lightest_low_pass(ratio: float, cutoff: float) -> float:
    """Smallest stable M_x behind a first-order low-pass, by Routh; 0 where every mass is stable.

    M t s³ + (M + D t)s² + (D + K t)s + K + k_w with t = 1/ω is stable where (M + D t)(D + K t) > M t (K + k_w).
    """
    lag = 1.0 / (2.0 * np.pi * cutoff)
    masses = np.geomspace(1e-4, 10.0, 5000)
    damping = np.array([contact_damping(m, TOOL_STIFFNESS, WALL, ratio) for m in masses])
    left = (masses + damping * lag) * (damping + TOOL_STIFFNESS * lag)
    unstable = left <= masses * lag * (TOOL_STIFFNESS + WALL)
    return float(masses[unstable][-1]) if unstable.any() else 0.0


def jobs(options: Options) -> list[Job]:
    """The exact model; with what the model lacks; elsewhere; and filters."""
    cases = [(FIRST, "exact", ratio, age) for ratio in RATIOS for age in AGES]
    cases += [(FIRST, "heavy", ratio, age) for ratio in RATIOS for age in AGES_HEAVY]
    others = [place for place in SETTINGS if place != FIRST]
    cases += [(place, "exact", 1.0, age) for place in others for age in AGES_ELSEWHERE]
    old = [Job(old_readings, (*case, options.seed)) for case in cases]
    filters = [(ratio, cutoff) for ratio in (1.0, 0.3) for cutoff in CUTOFFS]
    return old + [Job(low_pass, (*case, options.seed)) for case in filters]


def collect(options: Options, answers: list[Any]) -> Figures:
    """Rows of old readings, and of filters."""
    del options
    arm, setting = pushed.load(SETTINGS[FIRST].arm), SETTINGS[FIRST]
    return {
        "rows": [row for row in answers if "age" in row],
        "filters": [row for row in answers if "cutoff" in row],
        "M_d / M_x [m^2]": float(np.sum((UP @ arm.jacobian(setting.q)[:3]) ** 2)),
    }


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """By age of the readings, at other places, and by cutoff."""
    found = {(row["place"], row["plant"], row["ratio"], row["age"]): row for row in data["rows"]}
    return {
        "delay": _by_age(found, data["M_d / M_x [m^2]"]),
        "delay-elsewhere": _elsewhere(found),
        "low-pass": _by_cutoff({(row["ratio"], row["cutoff"]): row for row in data["filters"]}),
    }


def _by_age(found: Mapping[Any, Mapping[str, Any]], share: float) -> str:
    rows = []
    for age in AGES:
        exact = [found[FIRST, "exact", ratio, age] for ratio in RATIOS]
        unknown = [found.get((FIRST, "heavy", ratio, age)) for ratio in RATIOS]
        first, *others = [_pair(a) + _alone(b) for a, b in zip(exact, unknown, strict=True)]
        inertia = f"{share * exact[0]['lightest']:.2g}"
        rows.append((f"{age} ms", first, inertia, *others, _with_rule(exact[0])))
    header = (
        *("age T of tau_ext", "ζ = 1: measured (bound); with the model error [kg]"),
        *("as M_d [kg·m²]", "ζ = 0.7 [kg]", "ζ = 0.3 [kg]"),
        "contacts, peak force with the recommended M_x, ζ = 1",
    )
    return markdown(header, rows)


def _elsewhere(found: Mapping[Any, Mapping[str, Any]]) -> str:
    last = AGES_ELSEWHERE[-1]
    rows = [
        (
            place,
            *(_pair(found[place, "exact", 1.0, age]) for age in AGES_ELSEWHERE),
            _with_rule(found[place, "exact", 1.0, last]),
        )
        for place in SETTINGS
        if place != FIRST
    ]
    header = (
        "arm, pose",
        *(f"T = {age} ms, ζ = 1: measured (bound) [kg]" for age in AGES_ELSEWHERE),
        f"contacts, peak force with the recommended M_x, T = {last} ms",
    )
    return markdown(header, rows)


def _by_cutoff(filters: Mapping[Any, Mapping[str, Any]]) -> str:
    rows = [
        (f"{f:g} Hz", _pair(filters[1.0, f]), _pair(filters[0.3, f]), _with_rule(filters[1.0, f]))
        for f in CUTOFFS
    ]
    header = (
        *("low-pass on tau_ext", "ζ = 1: measured (Routh) [kg]", "ζ = 0.3 [kg]"),
        "contacts, peak force with the recommended M_x, ζ = 1",
    )
    return markdown(header, rows)


def _pair(row: Mapping[str, Any]) -> str:
    return f"{row['lightest']:.2g} ({row['theory']:.2g})"


def _alone(row: Mapping[str, Any] | None) -> str:
    return "" if row is None else f"; {row['lightest']:.2g}"


def _with_rule(row: Mapping[str, Any]) -> str:
    return f"{row['contacts']}, {row['peak']:.0f} N ({row['rule']:.3g} kg)"


def draw(data: Mapping[str, Any], out: Path) -> None:
    """Lightest mass over the age of the readings."""
    figure, axes = plt.subplots(figsize=(6.0, 4.8), layout="constrained")
    rows = [row for row in data["rows"] if row["place"] == FIRST]
    for i, ratio in enumerate(RATIOS):
        for plant, mark, words in (("exact", "o", ""), ("heavy", "x", ", 2 kg and 10 % unknown")):
            some = [row for row in rows if row["ratio"] == ratio and row["plant"] == plant]
            ages = np.array([row["age"] for row in some]) + 0.5
            axes.loglog(
                ages,
                [row["lightest"] for row in some],
                f"C{i}{mark}",
                label=f"panda, ζ = {ratio:g}{words}",
            )
            if plant == "exact":
                axes.loglog(ages, [row["theory"] for row in some], f"C{i}-", label="target alone")
    rule = [recommended_mass(WALL, TOOL_STIFFNESS, DT, n * DT) for n in AGES]
    axes.loglog(np.array(AGES) + 0.5, rule, "k--", label="recommended, ζ = 1")
    axes.set(
        xlabel="age of the force readings + half a period [ms]",
        ylabel="lightest M_x with stable contact [kg]",
    )
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    figure.savefig(out / "contact_delay.png", dpi=150)
    plt.close(figure)


PARTS = {"delay": Part(jobs, collect, tables, draw)}
