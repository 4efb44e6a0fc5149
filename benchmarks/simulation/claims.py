"""Measure every figure of docs/claims.md: python -m benchmarks.simulation.claims [--out FILE].

Prints one JSON object; all runs are section 4 of the paper with the mass matrix known only.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import tell
from rbimpedance import SimulationResult
from rbimpedance._common.arrays import Array
from rbimpedance.law.certificate import certify
from rbimpedance.simulation import scenarios
from rbimpedance.simulation.scenarios import Scenario


def at(result: SimulationResult, channel: str, t: float) -> float:
    """Largest absolute value over the joints at a time."""
    return float(np.abs(getattr(result, channel)[np.searchsorted(result.t, t - 1e-9)]).max())


def disturbance(scenario: Scenario, result: SimulationResult) -> Array:
    """What the controller does not know, Δ = f(q, v) of the plant, shape (N, nv) [rad/s²]."""
    return np.array([scenario.plant.drift(q, v) for q, v in zip(result.q, result.v, strict=True)])


def finite_time(result: SimulationResult) -> dict[str, float]:
    """Claims on convergence: errors over time, and the surface's closed form once sliding."""
    gamma, p, start = 3.0, 5.0 / 3.0, 5.0
    e0 = at(result, "e1", start)
    predicted = (e0 ** (1.0 - p) + gamma * (p - 1.0) * 15.0) ** (-1.0 / (p - 1.0))
    return {
        **{f"e1 at {t} s [rad]": at(result, "e1", t) for t in (5, 10, 20)},
        "e1 at 20 s by the closed form from 5 s [rad]": predicted,
        "e_im at 10 s [N m]": at(result, "e_im", 10),
        "abs(s) below 1e-2 from [s]": float(
            result.t[np.flatnonzero((np.abs(result.s) > 1e-2).any(axis=1))[-1] + 1]
        ),
    }


def assumption_2(scenario: Scenario, result: SimulationResult) -> dict[str, Any]:
    """Rate of the disturbance against k2, and what certify makes of the bound that does hold."""
    delta = disturbance(scenario, result)
    rate = np.abs(np.gradient(delta, result.t, axis=0)).max(axis=1)
    late = float(rate[result.t >= 1.0].max())
    certificate = certify(8.0, 10.0, late, s0=result.s[0], disturbance0=delta[0])
    return {
        "largest rate of the disturbance [rad/s^3]": float(rate.max()),
        "from 0.1 s on": float(rate[result.t >= 0.1].max()),
        "from 1 s on": late,
        "T0 were that bound true from the start [s]": certificate.reaching_time.tolist(),
    }


def chatter() -> dict[str, dict[str, float]]:
    """Torque variation of joint 1 in the last 5 s at three periods."""
    laws = {"paper's law": ("power", "explicit"), "both corrected": ("fast-terminal", "matched")}
    measured: dict[str, dict[str, float]] = {}
    for name, (surface, scheme) in laws.items():
        measured[name] = {}
        for dt in (1e-2, 1e-3, 1e-4):
            result = scenarios.paper(surface=surface, scheme=scheme, dt=dt).simulate()  # type: ignore[arg-type]
            variation = result.metrics(after=5.0)["tau_variation"][0]
            measured[name][f"h = {dt:g} s [N m/s]"] = float(variation)
    return measured


def main() -> None:
    """Measure, print, and write where asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="also write the JSON here")
    arguments = parser.parse_args()
    scenario = scenarios.paper(duration=20.0)
    result = scenario.simulate()
    measured = {
        "finite time": finite_time(result),
        "assumption 2": assumption_2(scenario, result),
        "chatter": chatter(),
    }
    tell(measured, arguments.out)


if __name__ == "__main__":
    main()
