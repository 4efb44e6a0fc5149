"""A `HardwareController` as the tables that its compiled tick reads, and what that writes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array
from ...law.impedance import ImpedanceFilter
from ...robot.compiled.tables import ArmTables, Workspace, workspace
from ..estimation.friction_learning import PACKED

# Rows of `HardwareTables.joints`.
QUIET, ALERT, THRESHOLD, ACCURACY, FALLS, DECAY, MEAN, K2, LEAD, PERIODS, EFFORT, TORQUE_STEP = (
    range(12)
)
EXPECTED = 12  # 35 rows

# Entries of `HardwareTables.numbers`.
DT, RATIO, FORGOTTEN, STARTS, STRIBECK, SCALE_WEIGHT, LOAD_WEIGHT = range(7)

# Rows of `TickOutput.rows`.
OUT_TAU, OUT_V_R, OUT_A_R, OUT_E1, OUT_E2, OUT_S, OUT_U, OUT_Q_E, OUT_V_E = range(9)
OUT_ROWS = 9


class HardwareTables(NamedTuple):
    """Everything of a controller.

    Attributes:
        arm: Its arm.
        load: The same with one more kilogram.
        joints: What there is of every joint, shape (47, nv).
        filter: What takes (q_e, v_e, tau_ext) to a_e and the next q_e and v_e, one row a joint, shape (nv, 9).
        numbers: Period, ratio of bandwidths, share that is forgotten, ticks before friction is learned, rise of
            friction at rest, weights of what is expected of scale and load, shape (7,).
        neutral: The arm's neutral configuration, from which the angle of the ripple counts, shape (nq,).
    """

    arm: ArmTables
    load: ArmTables
    joints: Array
    filter: Array
    numbers: Array
    neutral: Array


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
    normal: Array
    q: Array


def tick_space(nq: int, nv: int) -> TickSpace:
    """Return work space for arms of this size."""
    M, factor = np.zeros((2, nv, nv))
    return TickSpace(
        workspace(nv), M, factor, np.zeros((14, nv)), np.zeros((PACKED, nv)), np.zeros(nq)
    )


def tick_output(nq: int, nv: int) -> TickOutput:
    """Return a place for what a tick computes."""
    return TickOutput(np.empty((OUT_ROWS, nv)), np.empty(nq))


def hardware_tables(controller: Any, arm: ArmTables, load: ArmTables) -> HardwareTables | None:
    """Return a controller as tables; None where its filter couples the joints, or is not linear.

    Args:
        controller: A `HardwareController`.
        arm: Tables of its arm.
        load: Tables of that with one more kilogram.
    """
    target, nv = controller._filter, controller.arm.nv
    if type(target) is not ImpedanceFilter:
        return None
    maps = target.maps().reshape(3, nv, 3, nv)
    diagonal = np.einsum("ijkj->jik", maps)
    if np.count_nonzero(maps) != np.count_nonzero(diagonal):
        return None
    gate, lag, limits = controller.gate, controller.observer._lag, controller.limits
    learner = controller.learner
    none = np.full(nv, np.inf)
    effort, step = (none, none) if limits is None else (limits.effort, limits.rate * controller.dt)
    joints = np.array(
        [
            *(gate.low, gate.high, gate.threshold, gate.accuracy, gate.falls, *lag),
            *(controller.k2, controller.lead, controller.ripple_periods),
            *(np.broadcast_to(effort, nv), np.broadcast_to(step, nv)),
            *learner.equations,
        ]
    )
    numbers = np.array(
        [
            *(controller.dt, gate.ratio, learner.forgotten, controller.learning_starts),
            *(learner.stribeck, *learner.shared_weights),
        ]
    )
    target_rows = np.ascontiguousarray(diagonal.reshape(nv, 9))
    return HardwareTables(arm, load, joints, target_rows, numbers, controller.arm.neutral.copy())
