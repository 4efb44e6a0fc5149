"""A `HardwareController` as the tables that its compiled tick reads, and what that writes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array
from ...law.impedance import ImpedanceFilter
from ...robot.compiled.tables import ArmTables, Workspace, workspace

# Rows of `HardwareTables.joints`.
QUIET, ALERT, THRESHOLD, FALLS, DECAY, MEAN, K2, EFFORT, TORQUE_STEP = range(9)

# Entries of `HardwareTables.numbers`.
DT, RATIO, FORGETTING, STARTS = range(4)  # the last: ticks before friction is learned

# Rows of `TickOutput.rows`.
OUT_TAU, OUT_V_R, OUT_A_R, OUT_E1, OUT_E2, OUT_S, OUT_U, OUT_Q_E, OUT_V_E = range(9)
OUT_ROWS = 9


class HardwareTables(NamedTuple):
    """Everything of a controller.

    Attributes:
        arm: Its arm.
        joints: What there is of every joint, shape (9, nv).
        filter: What takes (q_e, v_e, tau_ext) to a_e and the next q_e and v_e, one row a joint, shape (nv, 9).
        numbers: Period, ratio of bandwidths, forgetting, and when learning starts, shape (4,).
    """

    arm: ArmTables
    joints: Array
    filter: Array
    numbers: Array


class TickMemory(NamedTuple):
    """The state, which a tick overwrites; see `HardwareState`."""

    q: Array
    rows: Array
    pending: Array


class TickOutput(NamedTuple):
    """What a tick computes, shape (`OUT_ROWS`, nv), and q_r, shape (nq,)."""

    rows: Array
    q_r: Array


class TickSpace(NamedTuple):
    """Work space: nothing in it outlives a tick."""

    recursions: Workspace
    M: Array
    factor: Array
    rows: Array
    q: Array


def tick_space(nq: int, nv: int) -> TickSpace:
    """Return work space for arms of this size."""
    M, factor = np.zeros((2, nv, nv))
    return TickSpace(workspace(nv), M, factor, np.zeros((8, nv)), np.zeros(nq))


def tick_output(nq: int, nv: int) -> TickOutput:
    """Return a place for what a tick computes."""
    return TickOutput(np.empty((OUT_ROWS, nv)), np.empty(nq))


def hardware_tables(controller: Any, arm: ArmTables) -> HardwareTables | None:
    """Return a controller as tables; None where its filter couples the joints, or is not linear.

    Args:
        controller: A `HardwareController`.
        arm: Tables of its arm.
    """
    target, nv = controller._filter, controller.arm.nv
    if type(target) is not ImpedanceFilter:
        return None
    maps = target.maps().reshape(3, nv, 3, nv)
    diagonal = np.einsum("ijkj->jik", maps)
    if np.count_nonzero(maps) != np.count_nonzero(diagonal):
        return None
    gate, lag, limits = controller.gate, controller.observer._lag, controller.limits
    none = np.full(nv, np.inf)
    effort, step = (none, none) if limits is None else (limits.effort, limits.rate * controller.dt)
    joints = np.array(
        [
            *(gate.low, gate.high, gate.threshold, gate.falls, *lag, controller.k2),
            *(np.broadcast_to(effort, nv), np.broadcast_to(step, nv)),
        ]
    )
    starts = controller.learning_starts
    numbers = np.array([controller.dt, gate.ratio, controller.learner.forgetting, starts])
    return HardwareTables(arm, joints, np.ascontiguousarray(diagonal.reshape(nv, 9)), numbers)
