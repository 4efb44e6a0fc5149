"""The stages of a compiled tick over and over inside compiled code, so that differences show what each takes."""

from __future__ import annotations

import functools
from collections.abc import Callable
from time import perf_counter_ns as clock
from typing import Any

import numpy as np
from numba import types

from rbimpedance._common.arrays import Array
from rbimpedance._numba.compile import kernel
from rbimpedance.cli.timing import Inputs
from rbimpedance.control.compiled.block import COLUMNS
from rbimpedance.control.compiled.law import LawTables, Scratch, TickInputs
from rbimpedance.control.compiled.pack import pack_law, scratch
from rbimpedance.control.compiled.tick import (
    LAW,
    SCRATCH,
    after_torque,
    before_torque,
    is_sound,
    model_torque,
)
from rbimpedance.control.controller import ImpedanceController
from rbimpedance.robot.compiled.dynamics import ARM, OWN_MATRIX, SPACE, VECTOR_IN, CompiledDynamics
from rbimpedance.robot.compiled.tables import ArmTables, Workspace, workspace

CHECK, LAW_STAGE, MODEL, AFTER = 1, 2, 4, 8
_CUMULATIVE = (LAW_STAGE, LAW_STAGE | MODEL, LAW_STAGE | MODEL | AFTER, 15)
_REPETITIONS = 2000


def stage_times(made: ImpedanceController, given: Inputs, rounds: int) -> tuple[float, ...]:
    """Return what law, model, the part after the torque and the check of the inputs take [µs]; medians.

    Args:
        made: A controller whose surface and reaching law have a compiled form.
        given: What every tick sees.
        rounds: How often everything is timed.
    """
    call = _prepared(made, given)
    times: Array = np.array(
        [[_time(call, stages) for stages in _CUMULATIVE] for _ in range(rounds)]
    )
    ends = np.median(times, axis=0)
    return tuple(float(x) for x in np.diff(ends, prepend=0.0))


def _time(call: Callable[[int], int], stages: int) -> float:
    start = clock()
    call(stages)
    return (clock() - start) / 1e3 / _REPETITIONS


def _prepared(made: ImpedanceController, given: Inputs) -> Callable[[int], int]:
    nv, law = made.arm.nv, pack_law(made._law)
    tables, state = CompiledDynamics(made.arm).tables, np.zeros((nv, COLUMNS))
    vectors = (given.q, given.v, *given.reference, given.tau_ext)
    return functools.partial(_kernel(), tables, workspace(nv), law, scratch(nv), state, *vectors)


@functools.cache
def _kernel() -> Callable[..., Any]:
    vectors = (VECTOR_IN,) * 6
    numbers = (types.int64,)
    return kernel(_stages, (ARM, SPACE, LAW, SCRATCH, OWN_MATRIX, *vectors, *numbers))


def _stages(
    arm: ArmTables,
    space: Workspace,
    law: LawTables,
    work: Scratch,
    state: Array,
    q: Array,
    v: Array,
    q_d: Array,
    v_d: Array,
    a_d: Array,
    tau_ext: Array,
    stages: int,
) -> int:
    given, done = TickInputs(q, v, q_d, v_d, a_d, tau_ext), 0
    for _ in range(_REPETITIONS):
        if stages & CHECK and is_sound(arm, given):
            done += 1
        if stages & LAW_STAGE:
            before_torque(arm, law, work, state, given, work.block)
        if stages & MODEL:
            model_torque(arm, space, law, work, given)
        if stages & AFTER:
            done += after_torque(arm, law, work.torque, v, tau_ext, state, work.block)
    return done
