"""The things that are timed in this process, each as an iterator that does one at every `next`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from time import perf_counter_ns as clock
from typing import Any

import pinocchio as pin

from ...control.controller import ImpedanceController
from ...robot.arm_model import ArmModel
from .cases import BACKENDS, Inputs, controller, inputs
from .timing import Ticks

RNEA = "pin.rnea"
STEP = {backend: f"step, {backend}" for backend in BACKENDS}
LEAN = {backend: f"lean torque, {backend}" for backend in BACKENDS}
READ = "step, compiled, torque read"


def of_arm(arm: ArmModel) -> dict[str, Ticks]:
    """Return the yardstick and every way to take a tick, by name."""
    given = inputs(arm)
    made = {backend: controller(arm, backend) for backend in BACKENDS}
    return {
        RNEA: rnea(arm, given),
        **{STEP[backend]: step(made[backend], given) for backend in BACKENDS},
        READ: step_and_read(made["compiled"], given),
        **{LEAN[backend]: realtime(made[backend], given) for backend in BACKENDS},
    }


def rnea(arm: ArmModel, given: Sequence[Inputs]) -> Ticks:
    """`pin.rnea` called from Python: the yardstick."""
    model, data = arm.model, arm.model.createData()
    return repeated(pin.rnea, [(model, data, x.q, x.v, x.reference.a) for x in given])


def aba(arm: ArmModel, given: Sequence[Inputs]) -> Ticks:
    """`pin.aba` called from Python: with `rnea`, the yardstick of a closed-loop step."""
    model, data = arm.model, arm.model.createData()
    return repeated(pin.aba, [(model, data, x.q, x.v, x.tau_ext) for x in given])


def step(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """`controller.step` with telemetry, one tick after the other."""
    state, tick = made.init(), made.step
    for q, v, reference, tau_ext in cycle(given):
        _, state = tick(state, q, v, reference, tau_ext)
        yield clock()


def step_and_read(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """The same, and the torque read from the output."""
    state, tick = made.init(), made.step
    for q, v, reference, tau_ext in cycle(given):
        output, state = tick(state, q, v, reference, tau_ext)
        output.tau  # noqa: B018 (made when it is asked for)
        yield clock()


def realtime(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """`RealtimeController.torque`, one tick after the other."""
    return repeated(made.realtime().torque, [tuple(x) for x in given])


def repeated(call: Callable[..., Any], rows: Sequence[tuple[Any, ...]]) -> Ticks:
    """Any call, over and over."""
    for arguments in cycle(rows):
        call(*arguments)
        yield clock()
