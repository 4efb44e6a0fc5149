"""What a torque limit does to the integrators, under five ways to treat them; and which torque rate the law needs.

    python -m benchmarks.law.saturation [--out FILE] [--seed 3]

Section 4 of the paper with the fast terminal surface, the matched scheme, k1 = 16, k2 = 40, h = 1 ms, the mass matrix
known only. Prints the figures of docs/schemes.md as JSON.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import tell
from rbimpedance import ImpedanceController, SimulationResult, SuperTwisting
from rbimpedance._common.arrays import Array
from rbimpedance.law.limits import Allocation, Limits
from rbimpedance.law.super_twisting import ReachingState
from rbimpedance.simulation.scenarios import paper

K1, K2, DT = 16.0, 40.0, 1e-3


class WindingUp(SuperTwisting):
    """The integrators know nothing of the limits."""

    def anti_windup(
        self, state: ReachingState, following: ReachingState, missing: Array, dt: float
    ) -> ReachingState:
        """Return the next state as it is."""
        del state, missing, dt
        return following


class Conditioned(SuperTwisting):
    """The conditioning technique to the letter: z moves by the s for which the scheme gives the u that was realised."""

    def step(self, s: Array, state: ReachingState, dt: float) -> tuple[Array, ReachingState]:
        """Remember u, and step."""
        u, following = super().step(s, state, dt)
        object.__setattr__(self, "_u", u)
        return u, following

    def anti_windup(
        self, state: ReachingState, following: ReachingState, missing: Array, dt: float
    ) -> ReachingState:
        """Solve (k1·y + 2·h·k2)·y²/(y² + h·k1·y + h²·k2) = abs(w) for y = abs(s)^½ by bisection."""
        if not missing.any():
            return following
        w = self._u - missing - self.k2 * state.z  # type: ignore[attr-defined]
        low, high = np.zeros_like(w), np.full_like(w, 1e3)
        for _ in range(60):
            y = (low + high) / 2.0
            d = y**2 + dt * self.k1 * y + dt**2 * self.k2
            below = (self.k1 * y + 2.0 * dt * self.k2) * y**2 / d < np.abs(w)
            low, high = np.where(below, y, low), np.where(below, high, y)
        d = low**2 + dt * self.k1 * low + dt**2 * self.k2
        return following._replace(z=state.z + dt * np.sign(w) * low**2 / d)


class Clipping(Limits):
    """Every torque on its own: a joint at its limit disturbs the others."""

    def allocate(self, tau: Array, mass_matrix: Callable[[], Array], **rate: Any) -> Allocation:
        """Clip."""
        del rate
        applied = np.clip(tau, -self.effort, self.effort)
        acceleration_deficit = np.asarray(
            np.linalg.solve(mass_matrix(), tau - applied), dtype=np.float64
        )
        return Allocation(
            applied, applied != tau, np.zeros_like(applied != tau), acceleration_deficit
        )


def run(
    law: type[SuperTwisting],
    limits: Limits | None,
    duration: float = 5.0,
    q0: Array | None = None,
    gains: tuple[float, float] = (K1, K2),
) -> SimulationResult:
    """Simulate one variant."""
    scenario = paper(surface="fast-terminal", scheme="matched", dt=DT, duration=duration)
    old = scenario.controller
    assert isinstance(old, ImpedanceController)
    controller = ImpedanceController(
        old.arm,
        old.impedance,
        old.surface,
        law(*gains, scheme="matched"),
        DT,
        model="inertia",
        limits=limits,
    )
    start = scenario.q0 if q0 is None else q0
    return replace(scenario, controller=controller, q0=start).simulate()


def figures(result: SimulationResult) -> dict[str, float]:
    """Overshoot (largest e1 of opposite sign to its initial value), error from 1 s on, and time at a limit."""
    return {
        "overshoot [rad]": float(np.maximum(0.0, -result.e1 * np.sign(result.e1[0])).max()),
        "abs(e1) from 1 s on [rad]": float(np.abs(result.e1[result.t >= 1.0]).max()),
        "at a limit [s]": float(result.saturated.any(axis=1).sum() * DT),
    }


def random_starts(seed: int) -> dict[str, dict[str, float]]:
    """Overshoot from 16 random postures, with limits 20 to 56 % above the largest static torque."""
    static = np.array([23.52, 5.88])  # the arm stretched out, level
    found: dict[str, dict[str, float]] = {}
    for name, law in (("integrators wind up", WindingUp), ("integrators rest", SuperTwisting)):
        rng = np.random.default_rng(seed)
        overshoots = []
        for _ in range(16):
            q0, factor = rng.uniform(-1.5, 1.5, 2), rng.uniform(1.2, 1.56, 2)
            result = run(law, Limits(factor * static), 3.0, q0)
            overshoots.append(figures(result)["overshoot [rad]"])
        found[name] = {"median": float(np.median(overshoots)), "largest": max(overshoots)}
    return found


def rates() -> dict[str, dict[str, dict[str, float]]]:
    """Overshoot against the torque rate, as a multiple of sum_j abs(M_ij)·(k1²/2 + k2) with the arm stretched out."""
    arm = paper().controller.arm
    row = np.abs(arm.mass_matrix(np.zeros(2))).sum(axis=1)
    found: dict[str, dict[str, dict[str, float]]] = {}
    for k1, k2 in ((16.0, 40.0), (8.0, 10.0), (5.0, 10.0)):
        unit = row * (k1**2 / 2.0 + k2)
        cases = found[f"k1 = {k1:g}, k2 = {k2:g}, unit {unit.round().tolist()} N m/s"] = {}
        for factor in (np.inf, 4.0, 2.0, 1.5, 1.0, 0.75):
            result = run(SuperTwisting, Limits(rate=factor * unit), 5.0, gains=(k1, k2))
            cases[f"{factor:g}"] = figures(result) | {
                "abs(e1) from 4 s on [rad]": float(np.abs(result.e1[result.t >= 4.0]).max())
            }
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="also write the JSON here")
    parser.add_argument("--seed", type=int, default=3)
    arguments = parser.parse_args()
    pair, elbow = (36.0, 12.0), (np.inf, 4.0)
    report = {
        "limits 36 and 12 N m": {
            "without limits": figures(run(SuperTwisting, None)),
            "clipped, integrators wind up": figures(run(WindingUp, Clipping(pair))),
            "clipped, conditioned to the letter": figures(run(Conditioned, Clipping(pair))),
            "clipped, integrators rest": figures(run(SuperTwisting, Clipping(pair))),
            "allocated, conditioned to the letter": figures(run(Conditioned, Limits(pair))),
            "allocated, integrators rest (the library)": figures(run(SuperTwisting, Limits(pair))),
        },
        "elbow of 4 N m against 5.88 N m of gravity, shoulder's abs(e1) from 3 s on [rad]": {
            name: float(np.abs(result.e1[result.t >= 3.0, 0]).max())
            for name, result in (
                ("clipped", run(SuperTwisting, Clipping(elbow), 6.0)),
                ("allocated", run(SuperTwisting, Limits(elbow), 6.0)),
            )
        },
        "overshoot from random postures [rad]": random_starts(arguments.seed),
        "torque rate": rates(),
    }
    tell(report, arguments.out)


if __name__ == "__main__":
    main()
