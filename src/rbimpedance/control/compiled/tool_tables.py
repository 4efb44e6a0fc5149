"""What the compiled tick at the tool reads and writes: its tables, its work space, and how they are made."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..._common.arrays import Array
from ...robot.compiled.dynamics import (
    ARM,
    OWN_INTEGERS,
    OWN_MATRIX,
    OWN_VECTOR,
    SPACE,
)
from ...robot.compiled.frame_motion import frame_tables
from ...robot.compiled.kinematics import POSE
from ...robot.compiled.tables import ArmTables, Workspace, workspace
from ..cartesian_tick import CartesianLaw
from .law import ROWS, LawTables
from .pack import can_pack, pack_sliding
from .tick import LAW
from .tool_block import SIX, null_size, rows

DT, LENGTH, THRESHOLD, STRENGTH = 0, 1, 2, 3  # in `ToolTables.numbers`
NUMBERS = 4

LOWER, UPPER, SPEED, EFFORT, TORQUE_STEP = 0, 1, 2, 3, 4  # columns of `ToolTables.joints`
COLUMNS = 5

TURNS, IS_BOUNDED = 0, 1  # columns of `ToolTables.choices`

POSTURE_ERROR, WANTED, ASKED, COMMAND, WITHHELD = 0, 1, 2, 3, 4  # rows of `ToolScratch.joints`
TORQUE, LEAST, LARGEST, APPLIED, DEFICIT, HELD = 5, 6, 7, 8, 9, 10
FREE = 11
JOINT_ROWS = 12

MISSING, SHARES, Y, ACCELERATION = 0, 1, 2, 3  # rows of `ToolScratch.tool`
VELOCITY, DRIFT, DEMAND, COLUMN = 4, 5, 6, 7
TOOL_ROWS = 8

ERROR_RATE, SPEED_ROW, RATE_V, Y_NULL = 0, 1, 2, 3  # rows of `ToolScratch.null`
NULL_ROWS = 4


class ToolTables(NamedTuple):
    """Everything of a controller at the tool.

    Attributes:
        frame: Pose of the frame in the axes of its joint, shape (1, `kinematics.POSE`).
        chain: Joints from the base to the frame, shape (m, 1).
        axes: Constant compliance axes, nine numbers, shape (1, 9).
        posture: Configuration for the null space, shape (nq,); empty where it is that of the first tick.
        numbers: Control period, length, threshold and strength of the damping, shape (`NUMBERS`,).
        joints: Limits of every joint, infinite where there are none, shape (nv, `COLUMNS`).
        choices: Whether the axes turn with the reference, and whether joint limits are kept, shape (1, 2).
        tool: Surface and reaching law of the six directions; its filter is that of the target, a column a result.
        null: Those of the null space.
    """

    frame: Array
    chain: NDArray[np.int64]
    axes: Array
    posture: Array
    numbers: Array
    joints: Array
    choices: NDArray[np.int64]
    tool: LawTables
    null: LawTables


class ToolScratch(NamedTuple):
    """What a tick writes.

    Attributes:
        block: Output and next state, see `tool_block`.
        poses: Joints in the world, shape (nv, `kinematics.POSE`).
        jacobian: Jᵀ, shape (nv, 6).
        rate: J̇ᵀ, shape (nv, 6).
        scaled: Jᵀ with its linear columns divided by the length, shape (nv, 6).
        inverse: J^#, shape (nv, 6).
        basis: V, shape (nv, n).
        basis_rate: V̇, shape (nv, n).
        gram: A symmetric matrix, shape (6, 6).
        factor: Its Cholesky factor, shape (6, 6).
        directions: Uᵀ, shape (6, 6): directions of the tool near a singularity.
        along: Uᵀ times the scaled Jacobian, orthogonal rows, shape (6, nv).
        overlap: VᵀV, shape (n, n).
        joints: Vectors of the joints, shape (`JOINT_ROWS`, nv).
        tool: Vectors of the tool, shape (`TOOL_ROWS`, 6).
        null: Vectors of the null space, shape (`NULL_ROWS`, n).
        at_tool: What surface and reaching law are given and give, shape (`law.ROWS`, 6).
        in_null: The same of the null space, shape (`law.ROWS`, n).
        filtered: ξ̈, next ξ and next ξ̇, shape (18,).
        mass: M(q), shape (nv, nv).
        mass_factor: Its Cholesky factor over the joints at their limits, shape (nv, nv).
        command: Joint acceleration for the RNEA, shape (nv,).
        torque: Torque of the model, shape (nv,).
    """

    block: Array
    poses: Array
    jacobian: Array
    rate: Array
    scaled: Array
    inverse: Array
    basis: Array
    basis_rate: Array
    gram: Array
    factor: Array
    directions: Array
    along: Array
    overlap: Array
    joints: Array
    tool: Array
    null: Array
    at_tool: Array
    in_null: Array
    filtered: Array
    mass: Array
    mass_factor: Array
    command: Array
    torque: Array


class ToolWords(NamedTuple):
    """What a kernel needs besides its arguments."""

    arm: ArmTables
    tables: ToolTables
    space: Workspace
    scratch: ToolScratch


_TABLES = types.NamedTuple(
    (
        *(OWN_MATRIX, OWN_INTEGERS, OWN_MATRIX, OWN_VECTOR, OWN_VECTOR, OWN_MATRIX, OWN_INTEGERS),
        *(LAW, LAW),
    ),
    ToolTables,
)
_SCRATCH = types.NamedTuple(
    (*[OWN_MATRIX] * 18, OWN_VECTOR, *[OWN_MATRIX] * 2, *[OWN_VECTOR] * 2), ToolScratch
)
WORDS = types.NamedTuple((ARM, _TABLES, SPACE, _SCRATCH), ToolWords)


def can_pack_tool(law: CartesianLaw) -> bool:
    """Whether there are compiled formulas of the law's surfaces and reaching laws."""
    return can_pack(*law.tool) and can_pack(*law.null)


def tool_tables(law: CartesianLaw, arm: ArmTables) -> ToolTables:
    """Return the tables of a law that `can_pack_tool` knows.

    Args:
        law: The law.
        arm: Tables of its arm.
    """
    nv, n, dt, damping = law.arm.nv, null_size(law.arm.nv), law.dt, law.damping
    joints = np.full((nv, COLUMNS), np.inf)
    joints[:, LOWER] = -np.inf
    if law.bounds is not None:
        limits = law.bounds.lower, law.bounds.upper, law.bounds.speed
        joints[:, : SPEED + 1] = np.transpose(limits)
    if law.limits is not None:
        joints[:, EFFORT], joints[:, TORQUE_STEP] = law.limits.effort, law.limits.rate * dt
    tool = pack_sliding(*law.tool, SIX, dt)
    return ToolTables(
        *frame_tables(law.arm, law.kinematics.frame, arm.topology),
        axes=law.target.constant_axes.reshape(1, 9).copy(),
        posture=np.zeros(0) if law.posture is None else law.posture.copy(),
        numbers=np.array([dt, damping.length, damping.threshold, damping.strength]),
        joints=joints,
        choices=np.array([[law.target.turns, law.bounds is not None]], dtype=np.int64),
        tool=tool._replace(filter=np.ascontiguousarray(law.target.maps().T)),
        null=pack_sliding(*law.null, n, dt),
    )


def tool_words(law: CartesianLaw, arm: ArmTables) -> ToolWords:
    """Return tables and a new work space.

    Args:
        law: A law that `can_pack_tool` knows.
        arm: Tables of its arm.
    """
    nv = law.arm.nv
    return ToolWords(arm, tool_tables(law, arm), workspace(nv), _scratch(nv))


def _scratch(nv: int) -> ToolScratch:
    n = null_size(nv)
    shapes = (
        *((rows(nv), SIX), (nv, POSE)),
        *[(nv, SIX)] * 4,
        *[(nv, n)] * 2,
        *[(SIX, SIX)] * 3,
        *((SIX, nv), (n, n)),
        *((JOINT_ROWS, nv), (TOOL_ROWS, SIX), (NULL_ROWS, n), (ROWS, SIX), (ROWS, n)),
        *((3 * SIX,), (nv, nv), (nv, nv), (nv,), (nv,)),
    )
    return ToolScratch(*map(np.zeros, shapes))
