"""The things that are timed in this process, each as an iterator that does one at every `next`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from time import perf_counter_ns as clock

import pinocchio as pin

from rbimpedance.cli import timing
from rbimpedance.cli.timing import BACKENDS, REALTIME, RNEA, STEP, Inputs, Ticks, controller, inputs
from rbimpedance.control.controller import ImpedanceController
from rbimpedance.robot.arm_model import ArmModel

READ = "step, compiled, torque read"


def of_arm(arm: ArmModel) -> dict[str, Ticks]:
    """Return the yardstick and every way to take a tick, by name."""
    given = inputs(arm)
    made = {backend: controller(arm, backend) for backend in BACKENDS}
    return {
        RNEA: timing.rnea(arm, given),
        **{STEP[backend]: timing.step(made[backend], given) for backend in BACKENDS},
        READ: step_and_read(made["compiled"], given),
        **{REALTIME[backend]: timing.realtime(made[backend], given) for backend in BACKENDS},
    }


def aba(arm: ArmModel, given: Sequence[Inputs]) -> Ticks:
    """`pin.aba` called from Python: with `rnea`, the yardstick of a closed-loop step."""
    model, data = arm.model, arm.model.createData()
    return timing.repeated(pin.aba, [(model, data, x.q, x.v, x.tau_ext) for x in given])


def step_and_read(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """The same, and the torque read from the output."""
    state, tick = made.init(), made.step
    for q, v, reference, tau_ext in cycle(given):
        output, state = tick(state, q, v, reference, tau_ext)
        output.tau  # noqa: B018 (made when it is asked for)
        yield clock()
