"""What each law makes of usual hardware.

    python -m benchmarks.control.hardware.compare [--arms panda ...] [--only laws] [--bits 17 19 24]

Writes docs/figures/hardware_laws.json, two figures, and the tables about it in docs/hardware-limits.md. Every linear
law is tuned per arm and encoder in twelve runs for the least error at no more than twice the torque variation of
perfect sensing; ours is what `propose_gains` proposes. `--only` measures some parts, `--bits` tunes the linear laws for
these encoders.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import rbimpedance as rbi
from benchmarks import pages
from benchmarks.arms import ARMS, load
from benchmarks.progress import bar
from rbimpedance.simulation.plants.elasticity import enough_substeps

from . import compare_figures, compare_page
from .linear_laws import DT, LAWS, TARGET, Law, Settings, around

LENGTH, SHORT, LATE = 6.0, 4.0, 2.0
"""Length of a run, of one in the search over a grid, and the time from which they are evaluated [s]."""
AMPLITUDE, PERIOD = 0.2, 6.0  # rad, s
ROTOR = 0.1  # kg·m²
COULOMB, VISCOUS = 2.0, 1.0
PUSH = rbi.interaction.Push([0.0, 10.0, 0.0, 0.0, 0.0, 0.0], start=0.5, duration=1.0)
CAP = 2.0  # times the torque variation of perfect sensing
BITS = (17, 19, 24)
USUAL: dict[str, Any] = {"torque_lag": 2e-3, "delay": 1, "ripple": 0.03, "stribeck": 0.2}

ROTORS = (0.1, 0.5)
SPRINGS: dict[str, Any] = {
    "joint_stiffness": 1e4,
    "torque_sensor": 0.02,
    "torque_bandwidth": 600.0,
    "torque_lag": 3e-4,
    "encoder_side": "link",
}
"""What is different on elastic joints: the lag is that of the current loop inside the torque loop."""

RANGES: dict[str, dict[str, Any]] = {
    "lag 1 ms": {"torque_lag": 1e-3},
    "lag 3 ms, 2 ticks": {"torque_lag": 3e-3, "delay": 2},
    "lag 5 ms, 4 ticks": {"torque_lag": 5e-3, "delay": 4},
    "16 bits": {"encoder_bits": 16},
    "18 bits": {"encoder_bits": 18},
    "20 bits": {"encoder_bits": 20},
    "22 bits": {"encoder_bits": 22},
    "no ripple": {"ripple": 0.0},
    "ripple 5 %": {"ripple": 0.05},
    "no friction": {"coulomb": 0.0},
    "friction 5 N·m": {"coulomb": 5.0},
    "friction 10 N·m": {"coulomb": 10.0},
}
"""Changes of the usual hardware with 19 bits, one at a time."""
MAP_BITS, MAP_LAGS = (16, 18, 20, 22, 24), (1e-3, 2e-3, 3e-3, 5e-3)  # s
DRAWN = "panda"
"""The arm of the figures."""
PARTS = ("ours", "standing", "laws", "springs", "ranges", "map")


@dataclass(frozen=True, eq=False)
class Case:
    """An arm with its heaviest plant, half of whose payload its model holds.

    Attributes:
        name: Of the arm.
        coulomb: Dry friction of the plant [N·m].
        rotor: Inertia of the rotors on the joints' side of the gears [kg·m²].
    """

    name: str
    coulomb: float = COULOMB
    rotor: float = ROTOR

    def arm(self) -> rbi.ArmModel:
        """The arm as it is modelled, without friction."""
        return load(self.name, self.rotor).with_friction(0.0, 0.0)

    def plant(self) -> rbi.ArmModel:
        """Links 10 % heavier, the whole payload, friction."""
        heavy = self.arm().with_scaled_inertia(1.1).with_payload(ARMS[self.name])
        return heavy.with_friction(VISCOUS, self.coulomb)

    def model(self) -> rbi.ArmModel:
        """The arm with half of the payload."""
        return self.arm().with_payload(ARMS[self.name] / 2.0)

    def unknown(self) -> rbi.Uncertainty:
        """What is not known."""
        return rbi.Uncertainty(
            payload=ARMS[self.name],
            inertia_scale=1.1,
            coulomb=(0.0, self.coulomb),
            viscous=(0.0, VISCOUS),
        )

    def motion(self) -> Callable[[float], rbi.Reference]:
        """All joints swing by 0.2 rad about neutral, where the arm starts."""
        arm, omega = self.arm(), 2.0 * np.pi / PERIOD
        one = AMPLITUDE * np.ones(arm.nv)

        def swing(t: float) -> rbi.Reference:
            c, s = np.cos(omega * t), np.sin(omega * t)
            q = arm.raw_dynamics.integrate(arm.neutral, c * one)
            return rbi.Reference(q, -omega * s * one, -(omega**2) * c * one)

        return swing

    def still(self) -> Callable[[float], rbi.Reference]:
        """The arm stays at neutral."""
        arm = self.arm()
        held = rbi.Reference(np.array(arm.neutral), np.zeros(arm.nv), np.zeros(arm.nv))
        return lambda _: held


def simulated(
    case: Case,
    controller: Any,
    hardware: rbi.Hardware,
    motion: Any,
    push: Any = PUSH,
    length: float = LENGTH,
) -> rbi.SimulationResult:
    """The heaviest plant on the hardware, under a controller that is behind its encoders already.

    Raises:
        DivergenceError: The arm is lost.
    """
    plant = case.plant()
    driven = rbi.DrivenPlant.for_(hardware, plant, DT)
    q0 = np.array(plant.neutral)
    return rbi.simulate(
        controller,
        driven,
        motion,
        environment=push,
        q0=q0,
        duration=length,
        substeps=enough_substeps(driven, q0, DT),
    )


def run(
    case: Case,
    controller: Any,
    hardware: rbi.Hardware,
    motion: Any,
    push: Any = PUSH,
    length: float = LENGTH,
) -> dict[str, Any]:
    """Error from 2 s on [rad], and torque variation [N·m/s], of a run."""
    plant = case.plant()
    try:
        result = simulated(case, controller, hardware, motion, push, length)
    except rbi.DivergenceError:
        return {"error": np.inf, "variation": np.inf}
    late = result.t >= LATE
    pairs = zip(result.q[late], result.q_r[late], strict=True)
    error = np.array([plant.raw_dynamics.difference(q, q_r) for q, q_r in pairs])
    steps = np.abs(np.diff(result.tau[late], axis=0)).sum()
    return {"error": float(np.abs(error).max()), "variation": float(steps / (length - LATE))}


def needed(case: Case, ripple: float, length: float = LENGTH) -> float:
    """Torque variation of computed torque with an integral, with perfect sensing and torque, on the rippling arm."""
    law = rbi.baselines.PIDImpedance(case.model(), TARGET, 150.0, DT)
    hardware = rbi.Hardware(ripple=ripple, stribeck=USUAL["stribeck"])
    return float(run(case, law, hardware, case.motion(), length=length)["variation"])


def ours(case: Case, hardware: rbi.Hardware, length: float = LENGTH) -> rbi.HardwareProposal:
    """What is proposed."""
    proposal = rbi.propose_gains(
        case.arm(),
        case.unknown(),
        case.motion(),
        DT,
        hardware=hardware,
        duration=length,
        q0=np.array(case.arm().neutral),
    )
    assert isinstance(proposal, rbi.HardwareProposal)
    return proposal


def our_run(case: Case, hardware: rbi.Hardware, length: float = LENGTH) -> dict[str, Any]:
    """What the proposal makes of the heaviest plant, in motion and at rest; the reason where it is refused."""
    proposal = ours(case, hardware, length)
    if not proposal.feasible:
        return {"refused": proposal.reason}
    law = rbi.QuantizedEncoders.for_(hardware, proposal.controller(TARGET))
    found = run(case, law, hardware, case.motion(), length=length) | {
        "quiet_bandwidth": proposal.bandwidths.quiet,
        "alert_bandwidth": proposal.bandwidths.alert,
    }
    if not hardware.is_elastic:
        found["still"] = run(case, law, hardware, case.still(), None)["variation"]
    return found


def tuned(case: Case, hardware: rbi.Hardware, law: Law, said: Callable[[], None]) -> dict[str, Any]:
    """The settings with the least error among the quiet ones, or the quietest: six coarse ones, six around the best.

    The search is done in short runs. What it finds is run in full, the best first, until one is quiet there, too.
    """
    model, found = case.model(), list[dict[str, Any]]()
    cap, whole = (CAP * needed(case, float(hardware.ripple), length) for length in (SHORT, LENGTH))

    def measured(at: Settings, length: float) -> dict[str, Any]:
        controller = law.build(model, hardware, at)
        return run(case, controller, hardware, case.motion(), length=length) | {"settings": at}

    def ranked(cap: float) -> list[dict[str, Any]]:
        quiet = [each for each in found if each["variation"] <= cap]
        quietest = min(found, key=lambda each: each["variation"])
        return sorted(quiet, key=lambda each: each["error"]) or [quietest]

    for settings in (lambda: law.coarse, lambda: around(ranked(cap)[0]["settings"])):
        for at in settings():
            found.append(measured(at, SHORT))
            said()
    tried = list[dict[str, Any]]()
    for each in ranked(cap):
        tried.append(measured(each["settings"], LENGTH))
        if tried[-1]["variation"] <= whole:
            return tried[-1]
    return min(tried, key=lambda each: each["variation"])


def laws(name: str, bits: int, said: Callable[[], None]) -> dict[str, Any]:
    """Every law on one arm with one encoder."""
    case, hardware = Case(name), rbi.Hardware(encoder_bits=bits, **USUAL)
    found: dict[str, Any] = {}
    usual = rbi.QuantizedEncoders.for_(hardware, rbi.ImpedanceController(case.model(), TARGET))
    found["default, differences"] = run(case, usual, hardware, case.motion())
    for label, law in LAWS.items():
        found[label] = tuned(case, hardware, law, said)
    return found


def ranges(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Ours over the range of usual hardware."""
    for label, changes in RANGES.items():
        case = Case(name, changes.get("coulomb", COULOMB))
        more = {key: value for key, value in changes.items() if key != "coulomb"}
        hardware = rbi.Hardware(**({"encoder_bits": 19, **USUAL} | more))
        yield label, our_run(case, hardware) | {"need": needed(case, float(hardware.ripple))}


def springs(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Ours on springs of 1e4 N·m/rad with an inner torque loop; short runs, since they are made in Python."""
    for rotor in ROTORS:
        case = Case(name, rotor=rotor)
        hardware = rbi.Hardware(**({"encoder_bits": 19, **USUAL} | SPRINGS))
        need = needed(case, USUAL["ripple"], SHORT)
        yield str(rotor), our_run(case, hardware, SHORT) | {"need": need}


def error_map(name: str) -> dict[str, Any]:
    """Ours over bits and lag; infinite where it is refused."""
    case = Case(name)
    errors = [
        [
            our_run(case, rbi.Hardware(**(USUAL | {"encoder_bits": b, "torque_lag": lag}))).get(
                "error", np.inf
            )
            for lag in MAP_LAGS
        ]
        for b in MAP_BITS
    ]
    return {"bits": MAP_BITS, "lags": MAP_LAGS, "errors": errors}


def before_and_after(name: str) -> dict[str, rbi.SimulationResult]:
    """Runs on 19 bits: the default law on differences, and ours."""
    case, hardware = Case(name), rbi.Hardware(encoder_bits=19, **USUAL)
    laws: dict[str, Any] = {
        "default, differences": rbi.ImpedanceController(case.model(), TARGET),
        "ours": ours(case, hardware).controller(TARGET),
    }
    return {
        label: simulated(case, rbi.QuantizedEncoders.for_(hardware, law), hardware, case.motion())
        for label, law in laws.items()
    }


def standing(name: str) -> dict[str, Any]:
    """At rest on 17 bits, with friction that rises by half and not by the fifth that the gains were made for."""
    case, hardware = Case(name), rbi.Hardware(**({"encoder_bits": 17, **USUAL}))
    law = rbi.QuantizedEncoders.for_(hardware, ours(case, hardware).controller(TARGET))
    return run(case, law, hardware.but(stribeck=0.5), case.still(), None)


def one_arm(
    name: str, bits: Sequence[int], parts: set[str], said: Callable[[], None]
) -> dict[str, Any]:
    """Everything of one arm."""
    found: dict[str, Any] = {"need": needed(Case(name), USUAL["ripple"])}
    if "ours" in parts:
        found["ours"] = {
            str(b): our_run(Case(name), rbi.Hardware(encoder_bits=b, **USUAL)) for b in BITS
        }
    if "standing" in parts:
        found["standing"] = standing(name)
    if "laws" in parts:
        found["laws"] = {str(b): laws(name, b, said) for b in bits}
    if "springs" in parts:
        found["springs"] = dict(springs(name))
    if "ranges" in parts:
        found["ranges"] = dict(ranges(name))
    if "map" in parts:
        found["map"] = error_map(name)
    return found


def main() -> None:
    """Measure, write, tabulate."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--arms", nargs="*", choices=ARMS, default=list(ARMS))
    parser.add_argument("--bits", nargs="*", type=int, default=[*BITS], help="of the linear laws")
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    parser.add_argument("--out", type=Path, default=pages.FIGURES)
    parser.add_argument("--docs", type=Path, default=pages.DOCS, help="folder of the page")
    parser.add_argument("--draw", action="store_true", help="only tabulate what is there")
    asked = parser.parse_args()
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    path = asked.out / "hardware_laws.json"
    rows = json.loads(path.read_text("utf-8")) if path.exists() else {}
    runs = len(asked.bits) * sum(2 * len(law.coarse) for law in LAWS.values())
    if not asked.draw:
        with bar() as progress:
            task = progress.add_task("runs", total=runs * len(asked.arms))
            for name in asked.arms:
                found = one_arm(name, asked.bits, set(asked.only), lambda: progress.advance(task))
                before = rows.get(name, {})
                rows[name] = before | pages.plain(found)
                if "laws" in found:  # those of other encoders stay
                    rows[name]["laws"] = before.get("laws", {}) | pages.plain(found["laws"])
                rows = {each: rows[each] for each in ARMS if each in rows}
                path.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    if not asked.draw and "map" in asked.only and DRAWN in asked.arms:
        compare_figures.draw_map(DRAWN, rows[DRAWN]["map"], asked.out)
        compare_figures.draw_noise(before_and_after(DRAWN), asked.out)
    pages.rewrite(asked.docs / "hardware-limits.md", compare_page.tables(rows))


if __name__ == "__main__":
    main()
