"""What is measured on one arm: default hardware, the bound of each imperfection alone, and slower laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import rbimpedance as rbi
from rbimpedance.control.default_gains import slope_at_zero

from .trials import (
    DT,
    PERFECT,
    USUAL,
    Hardware,
    Trial,
    arm_and_plant,
    boundary,
    fewest_bits,
    propose,
    resolution,
    with_bits,
)

SETS: dict[str, tuple[float, dict[str, Any]]] = {
    "default": (1e-3, {}),
    "delay=2": (2e-3, {"delay": 2}),
    "delay=10": (2e-2, {"delay": 10}),
}
"""Proposals: the accuracy that is asked for [rad] and what is said of the sensors."""
LAGS, RIPPLES = (8e-3, 128e-3), (0.02, 0.64)
SPRINGS = (0.25, 1.0, 4.0)
"""Factors on the usual stiffness; linear theory is asked for `STIFFER` ones too."""
STIFFER = (16.0, 64.0)
SURFACES = ((2.0, 3.0, 1e-2), (2.0, 3.0, 3e-2), (2.0, 3.0, 0.1), (2.0, 1.0, 0.1), (1.0, 0.3, 0.1))
"""Rate, gamma and smoothing of the surfaces of slower laws."""
MARGINS = np.geomspace(1.0, 300.0, 40)
HEADROOM = 1.3
FINE_BITS = 24  # 17 bits on the motor behind a gear of 100:1 are 23.6 to a turn of the joint

ROTORS = (0.1, 0.5, 2.0)
"""Inertia of the rotors on the joints' side of the gears [kg·m²]."""
DELAYS = (0, 2, 5, 10, 20)
"""Delays given to a proposal, in ticks, until its law is quiet on elastic joints."""

Said = Callable[[], None]


def measure(name: str, halvings: int, said: Said) -> dict[str, Any]:
    """Everything of one arm.

    Args:
        name: Of the arm.
        halvings: Steps of every bisection.
        said: Called whenever a bound or a run is done, `STEPS` times in all.
    """
    arm, plant = arm_and_plant(name)
    sets: dict[str, Any] = {}
    for label, (accuracy, sensors) in SETS.items():
        proposal = propose(arm, name, accuracy, **sensors)
        if not proposal.feasible:
            raise SystemExit(f"{name}, {label}: {proposal.reason}")
        trial = Trial(arm, plant, proposal.controller())
        sets[label] = _law_of(trial) | _bounds(trial, halvings, label == "default", said)
    default = propose(arm, name, 1e-3)
    return {
        "arm": name,
        "sets": sets,
        "honest": _honest(arm, plant, name, said),
        "slower": _slower(arm, plant, default, said),
        "rotors": [_rotors(name, rotor, said) for rotor in ROTORS],
    }


STEPS = len(SETS) * 5 + 4 + len(ROTORS)
"""How often `measure` says that something is done."""


def _law_of(trial: Trial) -> dict[str, Any]:
    law: Any = trial.controller
    return {
        "margin": float(np.max(law.reaching.margin)),
        "slope": float(slope_at_zero(law.surface, trial.arm.nv).max()),
    }


def _bounds(trial: Trial, halvings: int, is_default: bool, said: Said) -> dict[str, Any]:
    """Rigid and default hardware, and the last quiet value of each imperfection alone, with theory's word."""
    found: dict[str, Any] = {"rigid": trial.run(PERFECT)}
    found["usual"] = trial.run(USUAL)
    found["usual_link"] = trial.run(_on_link(USUAL))
    said()

    def lagging(T: float) -> Hardware:
        return Hardware(time_constant=T)

    found["lag"] = boundary(lambda T: trial.is_quiet(lagging(T)), *LAGS, halvings)
    found["lag_theory"] = boundary(
        lambda T: trial.linear(lagging(T)).is_stable(), LAGS[0] / 128.0, LAGS[1], 20
    )
    said()
    found["bits"] = fewest_bits(lambda bits: trial.is_quiet(Hardware(bits=bits)))
    said()
    for side in ("motor", "link"):
        kinds = {x: Hardware(stiffness=x, side=side) for x in (*SPRINGS, *STIFFER)}
        found[f"springs_{side}"] = [x for x in SPRINGS if trial.is_quiet(kinds[x])]
        found[f"springs_{side}_theory"] = [
            x for x, kind in kinds.items() if trial.linear(kind).is_stable()
        ]
        said()
    if is_default:
        found["ripple"] = boundary(lambda x: trial.is_quiet(Hardware(ripple=x)), *RIPPLES, halvings)
        found["alone"] = {
            "lag": trial.run(lagging(USUAL.time_constant)),
            "ripple": trial.run(Hardware(ripple=USUAL.ripple)),
            "encoders": trial.run(Hardware(bits=USUAL.bits)),
            "springs": trial.run(Hardware(stiffness=1.0)),
        }
        said()
    return found


def _honest(arm: rbi.ArmModel, plant: rbi.ArmModel, name: str, said: Said) -> dict[str, Any]:
    """A proposal for the noise of encoders of 19 bits and a delay for the lag, on hardware without springs."""
    hardware = Hardware(USUAL.time_constant, USUAL.ripple, USUAL.bits)
    told = rbi.QuantizedEncoders(
        propose(arm, name, 1e-3).controller(), resolution=resolution(USUAL.bits or 0)
    )
    noise = {
        "position_noise": float(told.position_noise.max()),
        "velocity_noise": float(told.velocity_noise.max()),
    }
    proposal = propose(arm, name, 5e-3, delay=2, **noise)
    found: dict[str, Any] = {"feasible": proposal.feasible, "reason": proposal.reason}
    if proposal.feasible:
        trial = Trial(arm, plant, proposal.controller())
        found |= _law_of(trial)
        found["run"] = trial.run(hardware)
        found["bits"] = fewest_bits(lambda bits: trial.is_quiet(with_bits(hardware, bits)))
    said()
    return found


def _slower(
    arm: rbi.ArmModel, plant: rbi.ArmModel, proposal: rbi.GainProposal, said: Said
) -> dict[str, Any]:
    """The law that linear theory calls for on the default hardware: of those that are stable, the least error."""
    found: dict[str, Any] = {}
    for side, hardware in (("motor", USUAL), ("link", _on_link(USUAL))):
        trial = _fastest_stable(arm, plant, proposal, hardware)
        if trial is not None:
            found[side] = _law_of(trial) | {"run": trial.run(with_bits(hardware, FINE_BITS))}
        said()
    return found


def _rotors(name: str, rotor: float, said: Said) -> dict[str, Any]:
    """The least delay that makes a proposal quiet on usual springs with rotors of that inertia, and its run."""
    arm, plant = arm_and_plant(name, rotor)
    hardware, found = with_bits(USUAL, FINE_BITS), {"rotor": rotor, "delay": None}
    for delay in DELAYS:
        proposal = propose(arm, name, 2e-2, delay=delay)
        if not proposal.feasible:
            break
        trial = Trial(arm, plant, proposal.controller())
        if trial.linear(hardware).is_stable() and trial.run(hardware)["quiet"]:
            found |= _law_of(trial) | {"delay": delay, "run": trial.run(hardware)}
            break
    said()
    return found


def _fastest_stable(
    arm: rbi.ArmModel, plant: rbi.ArmModel, proposal: rbi.GainProposal, hardware: Hardware
) -> Trial | None:
    """Least (margin·h)²/slope, which the error goes with, over surfaces and margins that are stable."""
    best, least = None, np.inf
    for rate, gamma, smoothing in SURFACES:
        surface = rbi.FastTerminalSurface(rate=rate, gamma=gamma, exponent=0.6, smoothing=smoothing)
        slope = float(slope_at_zero(surface, arm.nv).max())
        for margin in (HEADROOM * MARGINS).tolist():
            trial = Trial(arm, plant, _law(proposal, surface, margin))
            if margin**2 / slope < least and _is_stable_with_room(trial, hardware):
                best, least = trial, margin**2 / slope
    return best


def _is_stable_with_room(trial: Trial, hardware: Hardware) -> bool:
    """Whether the linear loop is stable with this margin and with the margin less its headroom."""
    loop = trial.linear(hardware)
    return loop.is_stable() and replace(loop, margin=loop.margin / HEADROOM).is_stable()


def _law(proposal: rbi.GainProposal, surface: Any, margin: float) -> rbi.ImpedanceController:
    reaching = rbi.SuperTwisting(proposal.k1, proposal.k2, "matched", margin)
    return rbi.ImpedanceController(
        proposal.arm, rbi.Impedance(1.0, 10.0, 20.0), surface, reaching, DT
    )


def _on_link(hardware: Hardware) -> Hardware:
    return replace(hardware, side="link")
