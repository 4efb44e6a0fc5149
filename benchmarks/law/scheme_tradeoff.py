"""Precision, wrong input gain, noise: what each discretisation of the super-twisting law is good at.

    python -m benchmarks.law.scheme_tradeoff [--out docs/figures] [--seed 1]

The plant is ds/dt = w - g·u with abs(dw/dt) ≤ L = 5, integrated exactly while u is held; k1 = 8, k2 = 10, s(0) = 1.
Prints the figures of docs/schemes.md as JSON, and writes scheme_tradeoff.png and scheme_tradeoff.json.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.pages import FIGURES, tell
from rbimpedance import SuperTwisting
from rbimpedance._common.arrays import Array
from rbimpedance.law.super_twisting import Scheme
from rbimpedance.pictures.figures.style import COLORS

K1, K2, L = 8.0, 10.0, 5.0
SCHEMES: tuple[Scheme, ...] = ("explicit", "matched", "implicit")
COLOR = dict(zip(SCHEMES, (COLORS[1], COLORS[0], COLORS[2]), strict=True))
GAINS = np.concatenate([np.geomspace(0.6, 4.0, 35), np.geomspace(4.3, 24.0, 25)])
MARGINS = (1.0, 2.0, 4.0, 10.0)
NOISES = np.geomspace(1e-6, 1e-3, 13)
DIVERGED = 1e3  # of abs(s), from 1 at the start

Rates = Callable[[float, Array], Array]


class Figures(NamedTuple):
    """Figures of a run after its first half, one a lane; NaN where it diverged."""

    precision: Array  # max abs(s)/(L·h²)
    variation: Array  # total variation of u a second


def run(
    law: SuperTwisting,
    h: float,
    rates: Rates,
    *,
    lanes: int = 1,
    gain: Any = 1.0,
    noise: Any = 0.0,
    seed: int = 0,
) -> Figures:
    """Sample the loop for 20 s, the lanes side by side."""
    rng, ticks = np.random.default_rng(seed), round(20.0 / h)
    s, w, peak, variation, last = np.ones(lanes), np.zeros(lanes), *np.zeros((3, lanes))
    state = law.start(s)
    for k in range(ticks):
        u, state = law.step(s + noise * rng.standard_normal(lanes), state, h)
        if 2 * k >= ticks:
            peak, variation = np.maximum(peak, np.abs(s)), variation + np.abs(u - last)
        last, rate = u, rates(k * h, s)
        s = np.clip(s + h * (w + rate * h / 2.0 - gain * u), -DIVERGED, DIVERGED)
        w = w + rate * h
    lost = peak >= DIVERGED
    return Figures(
        np.where(lost, np.nan, peak / (L * h**2)), np.where(lost, np.nan, variation / 10.0)
    )


def square(t: float, s: Array) -> Array:
    """A triangle of height 2.5 and period 1 s in w."""
    return np.full_like(s, L if t % 1.0 < 0.5 else -L)


def disturbances(seed: int) -> dict[str, Rates]:
    """The rates of w by name."""
    rng = np.random.default_rng(seed)
    return {
        "worst sign": lambda _, s: np.where(s >= 0.0, L, -L),
        "square": square,
        "random": lambda _, s: L * rng.choice([-1.0, 1.0], s.shape),
    }


def measure(seed: int) -> dict[str, Any]:
    """Measure everything that docs/schemes.md says."""
    laws = {scheme: SuperTwisting(K1, K2, scheme=scheme) for scheme in SCHEMES}
    margins = {m: SuperTwisting(K1, K2, "matched", m) for m in MARGINS}
    wide: dict[str, Any] = {"lanes": len(GAINS), "gain": GAINS}
    return {
        "precision max|s|/(L h^2)": {
            f"h = {h:g} s": {
                scheme: {
                    name: float(run(law, h, rates).precision[0])
                    for name, rates in disturbances(seed).items()
                }
                for scheme, law in laws.items()
            }
            for h in (1e-2, 1e-3)
        },
        "input gain": {
            "g": GAINS.tolist(),
            **{scheme: _sweep(run(law, 1e-3, square, **wide)) for scheme, law in laws.items()},
        },
        "noise on s": {
            "standard deviation": NOISES.tolist(),
            **{
                scheme: _sweep(run(law, 1e-3, square, lanes=len(NOISES), noise=NOISES, seed=seed))
                for scheme, law in laws.items()
            },
        },
        "margin of the matched scheme": {
            f"{m:g}": _sweep(run(law, 1e-3, square, **wide)) for m, law in margins.items()
        },
    }


def _sweep(figures: Figures) -> dict[str, list[float]]:
    return {
        "max|s|/(L h^2)": figures.precision.tolist(),
        "variation of u per second": figures.variation.tolist(),
    }


def tolerated(sweep: dict[str, list[float]], gains: Array) -> tuple[float, float]:
    """Smallest and largest gain around 1 at which u varies by at most 5 % more than w asks for."""
    excess = np.array(sweep["variation of u per second"]) * gains / L
    good = excess <= 1.05
    start = int(np.argmin(np.abs(gains - 1.0)))
    if not good[start]:
        return np.nan, np.nan
    low = start - int(np.argmin(np.append(good[: start + 1][::-1], False))) + 1
    high = start + int(np.argmin(np.append(good[start:], False))) - 1
    return float(gains[low]), float(gains[high])


def plot(figures: dict[str, Any], path: Path) -> None:
    """Draw the four panels."""
    style: Any = {
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.alpha": 0.3,
        "font.size": 9,
    }
    with plt.rc_context(style):
        figure, axes = plt.subplots(2, 2, figsize=(9.0, 6.6), layout="constrained")
        _plot_precision(axes[0, 0], figures["precision max|s|/(L h^2)"]["h = 0.001 s"])
        _plot_gain(axes[0, 1], figures["input gain"])
        _plot_noise(axes[1, 0], figures["noise on s"])
        _plot_margin(axes[1, 1], figures["margin of the matched scheme"])
        figure.savefig(path, dpi=150)
        plt.close(figure)


def _plot_precision(axes: Any, figures: dict[str, dict[str, float]]) -> None:
    for i, scheme in enumerate(SCHEMES):
        names, heights = zip(*figures[scheme].items(), strict=True)
        bars = axes.bar(
            np.arange(3) + 0.27 * (i - 1), heights, 0.25, label=scheme, color=COLOR[scheme]
        )
        axes.bar_label(bars, fmt="%.1f", padding=2, fontsize=8)
    axes.set_xticks(range(3), names)
    axes.grid(visible=False, axis="x")
    axes.set(title="Worst-case precision", ylabel=r"max |s| / (L h²)", ylim=(0.0, 20.0))
    axes.legend(frameon=False, ncols=3, loc="upper center")


def _plot_gain(axes: Any, figures: dict[str, Any]) -> None:
    narrow = GAINS <= 3.0
    for scheme in SCHEMES:
        precision = np.array(figures[scheme]["max|s|/(L h^2)"])
        axes.semilogy(GAINS[narrow], precision[narrow], color=COLOR[scheme], label=scheme)
        if np.isnan(precision[narrow]).any():
            last = int(np.argmax(np.isnan(precision))) - 1
            axes.plot(GAINS[last], precision[last], "x", color=COLOR[scheme])
            axes.annotate(
                "diverges beyond",
                (GAINS[last], precision[last]),
                (8, -3),
                textcoords="offset points",
            )
    axes.set(
        title="Wrong input gain", xlabel="true gain / assumed gain", ylabel=r"max |s| / (L h²)"
    )
    axes.legend(frameon=False, loc="upper right")


def _plot_noise(axes: Any, figures: dict[str, Any]) -> None:
    for scheme in SCHEMES:
        variation = figures[scheme]["variation of u per second"]
        axes.loglog(NOISES, variation, color=COLOR[scheme], label=scheme)
    axes.axhline(L, color="black", linewidth=1.0, linestyle=":")
    axes.annotate(
        "what w asks for", (NOISES[-1], L), (0, 4), textcoords="offset points", ha="right"
    )
    axes.set(
        title="Noise (h = 1 ms)",
        xlabel="standard deviation of the noise on s",
        ylabel="variation of u per second",
    )
    axes.legend(frameon=False, loc="upper left")


def _plot_margin(axes: Any, figures: dict[str, Any]) -> None:
    for margin, color in zip(MARGINS, COLORS, strict=False):
        sweep = figures[f"{margin:g}"]
        excess = np.array(sweep["variation of u per second"]) * GAINS / L
        cost = np.interp(1.0, GAINS, sweep["max|s|/(L h^2)"])
        axes.loglog(
            GAINS,
            excess,
            color=color,
            label=f"margin {margin:g}: max |s| = {cost:.0f} L h² at gain 1",
        )
    axes.set_xticks([0.6, 1, 2, 4, 10, 20], ["0.6", "1", "2", "4", "10", "20"])
    axes.minorticks_off()
    axes.set(
        title="What a margin buys (matched)",
        xlabel="true gain / assumed gain",
        ylabel="variation of u / what w asks for",
        ylim=(0.6, 1e6),
    )
    axes.legend(frameon=False, loc="upper left")


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=FIGURES, help="folder for the two files")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with np.errstate(all="ignore"):  # what diverges, diverges
        figures = measure(arguments.seed)
    sweeps = {s: figures["input gain"][s] for s in SCHEMES} | {
        f"matched, margin {m}": sweep
        for m, sweep in figures["margin of the matched scheme"].items()
    }
    figures["gains tolerated without chatter"] = {
        name: tolerated(sweep, GAINS) for name, sweep in sweeps.items()
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    plot(figures, arguments.out / "scheme_tradeoff.png")
    tell(figures, arguments.out / "scheme_tradeoff.json")


if __name__ == "__main__":
    main()
