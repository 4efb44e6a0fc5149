"""The impedance that a panda shows on usual hardware with 19 bits: pushed by a chirp, and meeting a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

import rbimpedance as rbi
from benchmarks.arms import Array
from benchmarks.tuning.robustness import pushed
from benchmarks.tuning.robustness.achieved import WANTED, best_pose, chirp
from benchmarks.tuning.robustness.contact import WAY
from rbimpedance.interaction import impedance_for_wall, recommended_mass
from rbimpedance.trajectories import hold

from .cases import COULOMB, USUAL, VISCOUS, Case, swing
from .linear_laws import DT

BAND = 3.0
"""Motion and torque are compared below this frequency [Hz]; the chirp ends at 1.5 Hz.

Ripple moves the arm by less than 2 mrad, but at up to 10 Hz: its acceleration is as large as that of the chirp, and
least squares without a low-pass would take it for a smaller mass.
"""
HARDWARE = rbi.Hardware(encoder_bits=19, **USUAL)
CHIRP, SETTLED, CONTACT = 20.0, 3.0, 3.0  # s


def identified(result: rbi.SimulationResult, arm: rbi.ArmModel, q_d: Array) -> Array:
    """M, D and K of least squares of tau_ext = M a + D v + K (q - q_d) + c below `BAND`, shape (nv, 3)."""
    x = np.array([arm.difference(q_d, q) for q in result.q])[1:-1]
    a = (result.v[2:] - result.v[:-2]) / (2.0 * DT)
    low_pass = butter(4, BAND, fs=1.0 / DT, output="sos")
    kept = result.t[1:-1] >= SETTLED
    a, v, x, torque = (
        sosfiltfilt(low_pass, channel, axis=0)[kept]
        for channel in (a, result.v[1:-1], x, result.tau_ext[1:-1])
    )
    ones = np.ones(len(a))
    columns = [np.column_stack([a[:, i], v[:, i], x[:, i], ones]) for i in range(arm.nv)]
    return np.array(
        [np.linalg.lstsq(A, torque[:, i], rcond=None)[0][:3] for i, A in enumerate(columns)]
    )


def plants(case: Case, model: rbi.ArmModel) -> dict[str, rbi.ArmModel]:
    """What the controller's model is put to."""
    return {
        "its model, with friction": model.with_friction(VISCOUS, COULOMB),
        "the heaviest plant": case.plant(),
    }


def shown(name: str = "panda") -> dict[str, Any]:
    """Largest relative errors of M_d, D_d and K_d over the joints, plant by plant."""
    case = Case(name)
    q = best_pose(case.arm(), 0)
    proposal = proposed(case, q)
    rows = {}
    for label, plant in plants(case, proposal.arm).items():
        result = rbi.simulate(
            proposal.controller(rbi.Impedance(*WANTED)),
            plant,
            hold(plant, q),
            environment=chirp(CHIRP - 2.0, 2.0),
            hardware=HARDWARE,
            q0=q,
            duration=CHIRP,
        )
        errors = np.abs(identified(result, plant, q) / WANTED - 1.0).max(axis=0)
        rows[label] = dict(zip(("M_d", "D_d", "K_d"), errors, strict=True))
    return rows


def touched(place: str = pushed.FIRST) -> dict[str, Any]:
    """Peak and steady force, and number of contacts, at a wall of 1e4 N/m; and of the target impedance alone."""
    setting = pushed.SETTINGS[place]
    case, q = Case(setting.arm), setting.q
    arm = case.arm()
    wall = rbi.Wall(arm.frame_placement(q)[1], pushed.UP, pushed.WALL)
    target = impedance_for_wall(
        arm,
        q,
        pushed.UP,
        mass=recommended_mass(pushed.WALL, pushed.TOOL_STIFFNESS, DT),
        stiffness=pushed.TOOL_STIFFNESS,
        wall_stiffness=pushed.WALL,
    )
    motion = pushed.approach(arm, q, WAY)
    alone = pushed.target_alone(arm, target, motion, wall, round(CONTACT / DT) + 1)
    proposal, (q0, v0, _) = proposed(case, q), motion(0.0)
    rows = {"the target alone": _contact(alone)}
    for label, plant in plants(case, proposal.arm).items():
        result = rbi.simulate(
            proposal.controller(target),
            plant,
            motion,
            environment=wall,
            hardware=HARDWARE,
            q0=q0,
            v0=v0,
            duration=CONTACT,
        )
        rows[label] = _contact(pushed.forces(result, plant, wall))
    return rows


def proposed(case: Case, q: Array) -> rbi.HardwareProposal:
    """What is proposed around a posture."""
    motion = swing(case.arm(), q)
    found = rbi.propose_gains(case.arm(), case.unknown(), motion, DT, hardware=HARDWARE, q0=q)
    assert isinstance(found, rbi.HardwareProposal)
    return found


def _contact(force: Array) -> dict[str, Any]:
    return {"peak": force.max(), "steady": force[-1], "contacts": pushed.contacts(force)}
