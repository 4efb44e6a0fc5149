"""Laws whose ticks are late or lost, on three arms with an unknown payload; a row of the table as soon as it is known.

Every law gets the best of its bandwidths: the smallest error among those whose torque steps from tick to tick stay
within `STEP_SHARE` of the effort limit rms; if there is none, the smallest steps.

    python -m benchmarks.hardware.losses --out out/losses.jsonl
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import ARMS, DT, load
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.control.losses import Losses, LossyController

STEP_SHARE = 0.01
DURATION, SETTLED = 3.0, 1.5  # s
BANDWIDTHS = (10.0, 20.0, 40.0)  # rad/s
RATE = 1000.0  # N·m/s, as of a Franka


class Disturbance(NamedTuple):
    """Delay in ticks, share of lost ticks, longest burst."""

    delay: int
    share: float
    burst: int


CASES = (
    *(Disturbance(delay, 0.0, 1) for delay in (0, 1, 2, 3, 5)),
    *(Disturbance(1, share, 5) for share in (0.05, 0.2)),
    *(Disturbance(1, 0.1, burst) for burst in (10, 20)),
    Disturbance(3, 0.2, 20),
)


def pd(arm: rbi.ArmModel, bandwidth: float, delay: int) -> Any:
    """Poles at the bandwidth, by inverse dynamics."""
    del delay
    impedance = rbi.Impedance(mass=1.0, damping=2.0 * bandwidth, stiffness=bandwidth**2)
    return rbi.baselines.ComputedTorqueImpedance(arm, impedance, DT)


def pid(arm: rbi.ArmModel, bandwidth: float, delay: int) -> Any:
    """The same with an integrator."""
    del delay
    limits = rbi.Limits(arm.effort_limit, RATE)
    return rbi.baselines.PIDImpedance(arm, _stiff(), bandwidth, DT, limits=limits)


def observer(arm: rbi.ArmModel, bandwidth: float, delay: int) -> Any:
    """The law for hardware, which knows the delay."""
    return rbi.HardwareController(
        arm,
        rbi.Hardware(delay=delay),
        _stiff(),
        bandwidths=(bandwidth, bandwidth),
        dt=DT,
        learns_friction=False,
        limits=rbi.Limits(arm.effort_limit, RATE),
    )


def default(arm: rbi.ArmModel, bandwidth: float, delay: int) -> Any:
    """The law with the gains that it brings along; they have no bandwidth."""
    del bandwidth, delay
    return rbi.ImpedanceController(arm, _stiff(), dt=DT, limits=rbi.Limits(arm.effort_limit, RATE))


def _stiff() -> rbi.Impedance:
    return rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)


LAWS: dict[str, Callable[[rbi.ArmModel, float, int], Any]] = {
    "PD": pd,
    "PID": pid,
    "observer": observer,
    "default": default,
}


class Measured(NamedTuple):
    """Error of the worst joint rms [rad], and its torque step as a share of the effort limit rms."""

    error: float
    step: float


def measured(arm: rbi.ArmModel, payload: float, law: Any, case: Disturbance) -> Measured:
    """Run a law under a disturbance."""
    link = LossyController(
        ImperfectController(law, delay=case.delay), Losses(case.share, case.burst, seed=1)
    )
    motion = rbi.trajectories.cosine(arm, center=arm.ready, amplitude=0.2, period=4.0)
    try:
        result = rbi.simulate(
            link, arm.with_payload(payload), motion, q0=motion(0.0).q, duration=DURATION, substeps=2
        )
    except rbi.DivergenceError:
        return Measured(np.inf, np.inf)
    late = result.t >= SETTLED
    wanted = motion.sample(result.t[late]).q
    e = np.array([arm.difference(q, w) for q, w in zip(result.q[late], wanted, strict=True)])
    steps = np.diff(result.tau[late], axis=0) / arm.effort_limit
    return Measured(_rms(e), _rms(steps))


def _rms(rows: Any) -> float:
    return float(np.sqrt((rows**2).mean(axis=0)).max())


def best(arm: rbi.ArmModel, payload: float, name: str, case: Disturbance) -> tuple[Measured, float]:
    """The best bandwidth of a law and what it does."""
    ladder = BANDWIDTHS if name != "default" else BANDWIDTHS[:1]
    found = []
    for bandwidth in ladder:
        law = LAWS[name](arm, bandwidth, case.delay)
        found.append((measured(arm, payload, law, case), bandwidth))
    calm = [each for each in found if each[0].step <= STEP_SHARE]
    return min(calm, key=lambda x: x[0].error) if calm else min(found, key=lambda x: x[0].step)


def main() -> None:
    """Measure all and write a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="*", default=["panda", "ur5", "kinova"])
    parser.add_argument("--out", type=Path, default=Path("out/losses.jsonl"))
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with options.out.open("a", encoding="utf-8") as file:
        for case in CASES:
            for name in options.arms:
                arm = load(name, armature=0.1)
                for law in LAWS:
                    (error, step), bandwidth = best(arm, ARMS[name], law, case)
                    row = {"arm": name, **case._asdict(), "law": law, "error": error}
                    row |= {"step": step, "bandwidth": bandwidth}
                    file.write(json.dumps(row) + "\n")
                    file.flush()
                    print(row, flush=True)


if __name__ == "__main__":
    main()
