"""How tight the certificate of the sampled loop is: its bounds over the worst of random adversarial runs.

python -m benchmarks.law.sampled_certificate [arms]
"""

from __future__ import annotations

import sys

import numpy as np

from rbimpedance.law.sampled_certificate import certify_sampled
from rbimpedance.law.super_twisting import SuperTwisting
from rbimpedance.law.surfaces import FastTerminalSurface
from tests.law.sampled_plants import adversarial_errors

DT, RUNS = 1e-3, 15


def arm(rng: np.random.Generator) -> tuple[dict[str, object], np.ndarray, np.ndarray]:
    """Return a law, input gains around 1 and rates of a random arm of 2 to 7 joints."""
    n = int(rng.integers(2, 8))
    k2 = rng.uniform(5.0, 200.0, n)
    gains = np.eye(n) + rng.uniform(-0.04, 0.04, (8, n, n)) / np.sqrt(n)
    gains *= rng.uniform(0.85, 1.15, (8, n, 1))
    law = {"k1": 2.2 * np.sqrt(k2 / 0.8), "k2": k2, "margin": float(rng.uniform(1.2, 3.0))}
    return law, gains, rng.uniform(0.01, 0.15, n) * k2


def main() -> None:
    """Print, arm by arm, whether it is certified and its bounds over the worst runs."""
    surface, ratios = FastTerminalSurface(smoothing=0.03), []
    for seed in range(int(sys.argv[1]) if len(sys.argv) > 1 else 20):
        law, gains, rate = arm(np.random.default_rng(seed))
        lost = seed % 2
        found = certify_sampled(**law, gains=[gains], rate=rate, surface=surface, dt=DT, lost=lost)  # type: ignore[arg-type]
        if not found.feasible:
            print(f"arm {seed}, {lost} lost: not proven, {found.reason}", flush=True)
            continue
        reaching = SuperTwisting(law["k1"], law["k2"], "matched", law["margin"])  # type: ignore[arg-type]
        worst = np.zeros(len(rate))
        for run in range(RUNS):
            loop = {"lost": lost, "loss": 0.5, "ticks": 1000, "seed": run}
            e1, _ = adversarial_errors(reaching, surface, DT, gains, rate, **loop)  # type: ignore[arg-type]
            worst = np.maximum(worst, np.abs(e1).max(axis=0))
        ratio = found.e1_bound / worst
        ratios.append(ratio.min())
        print(
            f"arm {seed}, {lost} lost: bound over worst run {ratio.min():.2f} to {ratio.max():.2f}",
            flush=True,
        )
    print(f"proven {len(ratios)}; smallest ratio {min(ratios):.2f}, median {np.median(ratios):.2f}")


if __name__ == "__main__":
    main()
