"""The tick at the tool in compiled code: `cartesian_tick` of control/cartesian_tick.py specifies it.

`command` is what comes before the torque of the model, `finish` what comes after it. The equations are those of
`law.tool_formulas`.
"""

from __future__ import annotations

from typing import NamedTuple

from ..._common.arrays import Array
from ..._numba.compile import inline
from ..._numba.formulas import helper
from ...law.rotations import at
from ...law.tool_formulas import (
    FrameMotion,
    Six,
    error_rate,
    of_error,
    pulled_back,
    reference_in_constant_axes,
    reference_in_turning_axes,
    rotation_error,
    tool_acceleration,
)
from ...robot.compiled.frame_motion import frame_motion
from ...robot.compiled.rigid_body import place_joints
from ...robot.compiled.spatial import (
    Matrix,
    Vector,
    get_vector,
    product,
    put_vector,
    subtract,
    transposed,
)
from ...robot.compiled.tables import ArmTables
from ..cartesian_tick import LOST_DAMPING, LOST_STIFFNESS
from .law import TickInputs, _add_column
from .tick import is_sound
from .tool_block import (
    A_R,
    AXES,
    E1,
    E2,
    FIXED,
    HEAD,
    JOINTS,
    LENGTH,
    LOST,
    POSE,
    PULLED,
    REFERENCE,
    SIX,
    TICKS,
    V_R,
    WRENCH,
    XI,
    XI_BEFORE,
    XI_RATE,
    XI_RATE_BEFORE,
)
from .tool_block import ACCELERATION as JOINT_ACCELERATION
from .tool_inverse import fill_lost, invert, lost_shares
from .tool_joints import keep_joint_limits, put_flags
from .tool_null import move_null_space, posture_error
from .tool_sliding import slide_at_tool, slide_in_null, stop_at_tool, stop_in_null
from .tool_tables import (
    ACCELERATION,
    ASKED,
    COMMAND,
    DEFICIT,
    DEMAND,
    DRIFT,
    FREE,
    MISSING,
    POSTURE_ERROR,
    RATE_V,
    TURNS,
    VELOCITY,
    WANTED,
    WITHHELD,
    Y_NULL,
    ToolScratch,
    ToolTables,
    ToolWords,
    Y,
)
from .tool_tables import LENGTH as NUMBER_LENGTH

_at, _pulled_back, _rotation_error = helper(at), helper(pulled_back), helper(rotation_error)
_in_constant_axes = helper(reference_in_constant_axes)
_in_turning_axes = helper(reference_in_turning_axes)
_error_rate, _of_error = helper(error_rate), helper(of_error)
_tool_acceleration = helper(tool_acceleration)

_ORTHONORMAL = 0.9e-6  # a little inside the bound of `law.poses`


class ToolInputs(NamedTuple):
    """What a tick is given.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        rotation: Axes of the desired pose, shape (3, 3).
        translation: Its origin, shape (3,).
        v_d: Desired velocity, shape (6,).
        a_d: Desired acceleration, shape (6,).
        wrench: Wrench of the environment, shape (6,).
        tau_ext: Its torque on the joints, shape (nv,); empty for that of the wrench.
    """

    q: Array
    v: Array
    rotation: Array
    translation: Array
    v_d: Array
    a_d: Array
    wrench: Array
    tau_ext: Array


@inline
def are_sound(arm: ArmTables, given: ToolInputs) -> bool:
    """Whether all sizes are right, all numbers finite, and the rotation is one."""
    q, v, R, p, v_d, a_d, wrench, tau_ext = given
    torque = v if len(tau_ext) == 0 else tau_ext
    if not is_sound(arm, TickInputs(q, v, q, v, v, torque)):
        return False
    if R.shape != (3, 3) or len(p) != 3 or len(v_d) != SIX or len(a_d) != SIX:
        return False
    if len(wrench) != SIX:
        return False
    zero: float = 0.0  # NaN as soon as one number is not finite
    for i in range(SIX):
        zero += (v_d[i] + a_d[i] + wrench[i] + p[i // 2]) * 0.0
    return zero == 0.0 and _is_rotation(_rotation(R))


@inline
def _is_rotation(R: Matrix) -> bool:
    """Whether a matrix is orthonormal and right-handed."""
    S = product(transposed(R), R)
    off = max(abs(S[0] - 1.0), abs(S[4] - 1.0), abs(S[8] - 1.0), abs(S[1]), abs(S[2]), abs(S[5]))
    volume = (
        R[0] * (R[4] * R[8] - R[5] * R[7])
        - R[1] * (R[3] * R[8] - R[5] * R[6])
        + R[2] * (R[3] * R[7] - R[4] * R[6])
    )
    return off < _ORTHONORMAL and volume > 0.0


@inline
def _rotation(R: Array) -> Matrix:
    return (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2])


@inline
def _six(x: Array) -> Six:
    return (x[0], x[1], x[2]), (x[3], x[4], x[5])


@inline
def _get_six(block: Array, k: int) -> Six:
    return get_vector(block, k, 0), get_vector(block, k, 3)


@inline
def _put_six(block: Array, k: int, x: Six) -> None:
    put_vector(block, k, 0, x[0])
    put_vector(block, k, 3, x[1])


@inline
def _put_pose(block: Array, k: int, R: Matrix, p: Vector) -> None:
    _put_six(block, k, ((R[0], R[1], R[2]), (R[3], R[4], R[5])))
    _put_six(block, k + 1, ((R[6], R[7], R[8]), p))


@inline
def command(words: ToolWords, state: Array, given: ToolInputs) -> bool:
    """Write the joint acceleration that the torque is to bring about, and most of the block.

    Args:
        words: Tables and work space.
        state: Block of the tick before.
        given: Sound measurements.

    Returns:
        Whether it could: the null space has to be near that of the tick before.
    """
    arm, tables, space, work = words
    block, numbers, v = work.block, tables.numbers, given.v
    block[HEAD, TICKS], block[HEAD, JOINTS] = state[HEAD, TICKS] + 1.0, len(v)
    block[HEAD, LENGTH] = numbers[NUMBER_LENGTH]
    place_joints(arm, space, given.q)
    R, p = frame_motion(
        arm, space, work.poses, tables.frame, tables.chain, v, work.jacobian, work.rate
    )
    _put_pose(block, POSE, R, p)
    _put_rates(work, v)
    reference = _follow(tables, work, state, given)  # (T1), (T2)
    phi = _rotation_error(reference.rotation, R)
    k = _at(phi)
    velocity = _six(work.tool[VELOCITY])
    e2 = _error_rate(phi, k, reference.v, velocity)
    _put_six(block, E1, (subtract(reference.translation, p), phi))
    _put_six(block, E2, e2)  # (T3)
    is_whole = _invert(tables, work)
    posture_error(arm, tables, work, state, given.q)
    if not move_null_space(work, state, numbers, v, is_whole):
        return False
    slide_at_tool(tables.tool, work, state)
    slide_in_null(tables.null, work, state)
    y = _six(work.tool[Y])
    b = _tool_acceleration(phi, k, e2[1], reference, velocity[1], y)  # (T4)
    _put_six(work.tool, ACCELERATION, b)
    _resolve(work, numbers, v, is_whole)  # (T5)
    keep_joint_limits(arm, tables, work, given)
    for j in range(len(v)):
        work.command[j] = work.joints[COMMAND, j]
    return True


@inline
def _put_rates(work: ToolScratch, v: Array) -> None:
    """Write velocity and drift of the frame."""
    for i in range(SIX):
        work.tool[VELOCITY, i], work.tool[DRIFT, i] = 0.0, 0.0
    for j in range(len(v)):
        for i in range(SIX):
            work.tool[VELOCITY, i] += work.jacobian[j, i] * v[j]
            work.tool[DRIFT, i] += work.rate[j, i] * v[j]


@inline
def _follow(tables: ToolTables, work: ToolScratch, state: Array, given: ToolInputs) -> FrameMotion:
    """Write the target's next displacement, reference, axes and wrench; return the reference."""
    block, filtered = work.block, work.filtered
    desired = FrameMotion(
        _rotation(given.rotation),
        (given.translation[0], given.translation[1], given.translation[2]),
        _six(given.v_d),
        _six(given.a_d),
    )
    turns = tables.choices[0, TURNS] != 0
    R_c = desired.rotation if turns else _rotation(tables.axes.reshape(3, 3))
    xi, rate, wrench = _get_six(state, XI), _get_six(state, XI_RATE), _six(given.wrench)
    k = _at(xi[1])
    pulled = _pulled_back(R_c, xi[1], k, wrench)  # (T1)
    _put_six(block, PULLED, pulled)
    filtered[:] = 0.0
    for i in range(SIX):
        _add_column(tables.tool.filter, i, state[XI, i], filtered)
        _add_column(tables.tool.filter, SIX + i, state[XI_RATE, i], filtered)
        _add_column(tables.tool.filter, 2 * SIX + i, block[PULLED, i], filtered)
    for i in range(SIX):
        block[XI, i], block[XI_RATE, i] = filtered[SIX + i], filtered[2 * SIX + i]
        block[XI_BEFORE, i], block[XI_RATE_BEFORE, i] = state[XI, i], state[XI_RATE, i]
    acceleration = _six(filtered)
    if turns:
        reference = _in_turning_axes(R_c, k, xi, rate, acceleration, desired)  # (T2)
    else:
        reference = _in_constant_axes(R_c, k, xi, rate, acceleration, desired)
    _put_pose(block, REFERENCE, reference.rotation, reference.translation)
    _put_six(block, V_R, reference.v)
    _put_six(block, A_R, reference.a)
    _put_pose(block, AXES, R_c, (0.0, 0.0, 0.0))
    _put_six(block, WRENCH, wrench)
    return reference  # type: ignore[no-any-return]


@inline
def _invert(tables: ToolTables, work: ToolScratch) -> bool:
    """Write J and J^# to the block, and what is lost; whether nothing is."""
    block, nv, n = work.block, len(work.jacobian), work.basis.shape[1]
    free = work.joints[FREE]
    free[:] = 1.0
    is_whole: bool = invert(tables.numbers, work, work.jacobian, free)
    block[LOST, :] = 0.0
    if not is_whole:
        lost_shares(work, block[LOST])
    start = FIXED + nv + n
    for j in range(nv):
        for i in range(SIX):
            block[start + j, i] = work.jacobian[j, i]
            block[start + nv + j, i] = work.inverse[j, i]
    return is_whole


@inline
def _resolve(work: ToolScratch, numbers: Array, v: Array, is_whole: bool) -> None:
    """Write the joint acceleration that is wanted, J^#·(b - J̇·v) + V·(that of the null space), and what it misses."""
    tool, wanted, asked = work.tool, work.joints[WANTED], work.joints[ASKED]
    for i in range(SIX):
        tool[DEMAND, i], tool[MISSING, i] = tool[ACCELERATION, i] - tool[DRIFT, i], 0.0
    for j in range(len(v)):
        total = 0.0
        for i in range(SIX):
            total += work.inverse[j, i] * tool[DEMAND, i]
        for c in range(work.basis.shape[1]):
            total += work.basis[j, c] * (work.null[Y_NULL, c] - work.null[RATE_V, c])
        wanted[j] = total
    if not is_whole:
        for j in range(len(v)):
            asked[j] = LOST_STIFFNESS * work.joints[POSTURE_ERROR, j] - LOST_DAMPING * v[j]
        fill_lost(numbers, work, tool[DEMAND], asked, wanted, tool[MISSING])


@inline
def finish(tables: ToolTables, work: ToolScratch) -> None:
    """Write what the torque within the limits realises, and the memory of the reaching laws for the next tick."""
    put_flags(tables, work)
    block, joints, missing = work.block, work.joints, work.tool[MISSING]
    for j in range(joints.shape[1]):
        a = joints[COMMAND, j] - joints[DEFICIT, j]
        withheld = joints[WANTED, j] - a
        block[FIXED + j, JOINT_ACCELERATION], joints[WITHHELD, j] = a, withheld
        for i in range(SIX):
            missing[i] += work.jacobian[j, i] * withheld
    phi = get_vector(block, E1, 3)
    _put_six(work.tool, MISSING, _of_error(phi, _at(phi), _six(missing)))
    stop_at_tool(tables.tool, work, missing)
    stop_in_null(tables.null, work, joints[WITHHELD])
