"""What an energy tank does at the port between arm and environment."""

from __future__ import annotations

from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import DT, Array
from benchmarks.pages import markdown
from rbimpedance.control.guards.energy_tank import EnergyTank
from rbimpedance.interaction.estimators import MomentumObserver
from rbimpedance.trajectories import hold

from .guarded_arm import law, load


class Hand:
    """A hand on the tool that only resists its motion, with 5 N·s/m: it takes energy in and never gives any."""

    def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return tau_ext."""
        del t
        J = arm.jacobian(q)[:3]
        torque: Array = -5.0 * J.T @ (J @ v)
        return torque


def port(case: str, tank: bool) -> tuple[float, float]:
    """Least work of the environment on the arm so far [J], and the largest speed [rad/s], of panda in a case."""
    arm, center = load("panda")
    soft = rbi.Impedance(1.0, 4.0, 50.0)
    controller: Any = law(arm).with_impedance(soft)
    observer = MomentumObserver(arm, 200.0, DT)
    if tank:
        controller = EnergyTank(controller, observer=observer, capacity=1.0, start=0.2)
    stiff = controller.with_impedance(rbi.Impedance(1.0, 4.0, 250.0))
    where, state, q, v = hold(arm, center)(0.0), controller.init(), center, np.zeros(arm.nv)
    place = arm.frame_placement(center)[1]
    wall = rbi.Wall(place - np.array([0.0, 0.0, 0.01]), [0.0, 0.0, 1.0], 5e3, 20.0)
    push = rbi.interaction.Push([0, 0, -15, 0, 0, 0], 0.1, 0.5)
    environment = rbi.interaction.Sum(Hand() if case == "gains" else wall, push)
    work = least = fastest = 0.0
    for k in range(4000):
        felt = environment.torque(arm, k * DT, q, v)
        told = felt
        acting = controller
        if case == "gains":
            # stiff on the way back, soft on the way out: what a spring gives, it gets back with interest
            filtered = state.inner if tank else state
            acting = stiff if filtered.q_e @ filtered.v_e < 0.0 else controller
        elif case == "sign":
            told = -felt
        else:
            told = felt + 20.0 * (np.arange(arm.nv) == 1)
        output, state = acting.step(state, q, v, where, told)
        for i in range(4):
            acting_torque = environment.torque(arm, k * DT + i * DT / 4.0, q, v)
            v = v + DT / 4.0 * arm.raw_dynamics.forward_dynamics(q, v, output.tau + acting_torque)
            v = np.clip(v, -20.0, 20.0)
            q = arm.raw_dynamics.integrate(q, DT / 4.0 * v)
            work += DT / 4.0 * float(acting_torque @ v)
        least, fastest = min(least, work), max(fastest, float(np.abs(v).max()))
    return least, fastest


def passivity() -> str:
    """Measure the port of panda with and without a tank, and return the table."""
    words = {
        "gains": "K_d from 50 to 250 N·m/rad whenever the spring unloads, and back, in a hand that only resists",
        "sign": "tau_ext with the wrong sign, in contact with a wall of 5 kN/m",
        "bias": "tau_ext of joint 2 with an error of 20 N·m, at the same wall",
    }
    header = ("case", "energy given out, without [J]", "with the tank [J]", "peak speed [rad/s]")
    rows = []
    for case, said in words.items():
        without, tank = port(case, tank=False), port(case, tank=True)
        figures = [f"{-without[0]:.2f}", f"{-tank[0]:.2f}", f"{without[1]:.2g} → {tank[1]:.2g}"]
        rows.append([said, *figures])
        print(" | ".join(rows[-1]), flush=True)
    return markdown(header, rows)
