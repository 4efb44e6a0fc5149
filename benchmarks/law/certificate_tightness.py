"""How tight is `certify`? Measured reaching times over certified ones, on random closed loops.

    python -m benchmarks.law.certificate_tightness [--runs 300] [--figure docs/figures/certificate_tightness.png]

Draws laws and starts at random, lets each face one of four disturbances inside its d_max (sine, square, random, one
that decides its sign by the state), and then the slowest of a family of state-dependent ones. Prints the ratios as JSON
and writes their histogram.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.pages import FIGURES, tell
from rbimpedance.law.certificate import Certificate, certify
from tests.oracles import reaching
from tests.oracles.reaching import Array, Laws

LINES = 24  # directions of the switching line, each with both signs


def measure_mixed(rng: np.random.Generator, laws: Laws) -> dict[str, Array]:
    """Reaching time of each run under the one disturbance that is its turn, by kind."""
    times = {}
    rates = reaching.disturbances(rng, laws)
    for index, (kind, rate) in enumerate(rates.items()):
        times[kind] = reaching.measure_reaching(laws, rate).time[index :: len(rates)]
    return times


def measure_slowest(laws: Laws) -> Array:
    """Longest reaching time over disturbances at full rate whose sign changes across a line of the (s, z) plane."""
    angles = (np.arange(LINES) + 0.5) * np.pi / LINES - np.pi / 2.0
    slope = np.tile(np.tan(angles), 2)[:, None] * np.sqrt(2.0 * laws.k2)
    side = np.repeat([1.0, -1.0], LINES)[:, None] * np.ones_like(laws.k2)
    tiled = Laws(*(np.tile(field, 2 * LINES) for field in laws))

    def rate(time: Array, x1: Array, z: Array) -> Array:
        del time
        share: Array = side.ravel() * np.sign(z + slope.ravel() * x1)
        return share

    times = reaching.measure_reaching(tiled, rate, step=0.1).time
    longest: Array = times.reshape(2 * LINES, -1).max(axis=0)
    return longest


def summary(ratio: Array) -> dict[str, float]:
    """Minimum, quartiles and maximum of a ratio."""
    names = ("min", "quartile", "median", "upper_quartile", "max")
    quantiles = np.quantile(ratio, [0.0, 0.25, 0.5, 0.75, 1.0])
    return dict(zip(names, np.round(quantiles, 4).tolist(), strict=True))


def plot(mixed: Array, slowest: Array, printed: Array, path: Path) -> None:
    """Histogram of measured over certified reaching times."""
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    bins = np.linspace(0.0, 1.0, 41).tolist()
    axes.hist(
        mixed, bins, color="tab:blue", alpha=0.6, label=f"measured / certified, {mixed.size} runs"
    )
    axes.hist(
        slowest,
        bins,
        histtype="step",
        color="tab:red",
        linewidth=1.8,
        label="slowest disturbance found / certified",
    )
    axes.hist(
        printed,
        bins,
        histtype="step",
        color="0.35",
        linewidth=1.4,
        label="measured / the paper's formula (18)",
    )
    axes.axvline(1.0, color="black", linewidth=1.0, linestyle="--")
    axes.set(xlabel="measured reaching time / bound", ylabel="runs", xlim=(0.0, 1.03))
    axes.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=2024)
    parser.add_argument("--figure", type=Path, default=FIGURES / "certificate_tightness.png")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    laws = reaching.random_laws(rng, arguments.runs)
    certificate: Certificate = certify(
        laws.k1, laws.k2, laws.d_max, s0=laws.s0, disturbance0=laws.disturbance0
    )
    times = measure_mixed(rng, laws)
    kinds = list(times)
    bound = {k: certificate.reaching_time[i :: len(kinds)] for i, k in enumerate(kinds)}
    paper = {k: certificate.reaching_time_paper[i :: len(kinds)] for i, k in enumerate(kinds)}
    mixed = np.concatenate([times[k] / bound[k] for k in kinds])
    printed = np.concatenate([times[k] / paper[k] for k in kinds])
    slowest = measure_slowest(laws) / certificate.reaching_time
    plot(mixed, slowest, printed, arguments.figure)
    report = {
        "runs": arguments.runs,
        "exceeded": int(np.sum(mixed > 1.0) + np.sum(slowest > 1.0)),
        "measured_over_certified": summary(mixed),
        **{f"measured_over_certified_{k}": summary(times[k] / bound[k]) for k in kinds},
        "slowest_found_over_certified": summary(slowest),
        "measured_over_printed_formula": summary(printed),
        "certified_over_printed_formula": summary(
            certificate.reaching_time / certificate.reaching_time_paper
        ),
    }
    tell(report, None)


if __name__ == "__main__":
    main()
