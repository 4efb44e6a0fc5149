"""Output and state of a compiled tick at the tool: one block of numbers, from which named arrays are taken on demand.

A block has rows of six. The fixed ones come first, then one for each joint, one for each coordinate of the null space,
Jᵀ and J^# with a row for each joint, and the basis V of the null space, row by row, as far as it needs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._common.arrays import Array, BoolArray
from ...law.cartesian_impedance import Displacement
from ...law.poses import CartesianReference, Pose
from ...law.super_twisting import ReachingState
from ..cartesian_telemetry import CartesianOutput, CartesianState
from .block import Packed

SIX = 6
"""Columns of a block."""

# Fixed rows. Two rows hold a pose: nine numbers of the rotation, then the translation.
HEAD = 0  # see below
XI, XI_RATE, Z, X, A, PULLED = 1, 2, 3, 4, 5, 6  # for the next tick
XI_BEFORE, XI_RATE_BEFORE, Z_BEFORE = 7, 8, 9
POSE, REFERENCE, AXES = 10, 12, 14
V_R, A_R, WRENCH = 16, 17, 18
E1, E2, E3, S, U, LOST, HOLDS = 19, 20, 21, 22, 23, 24, 25
FIXED = 26

TICKS, JOINTS, LENGTH, IS_WHOLE = 0, 1, 2, 3  # in `HEAD`

TAU, ACCELERATION, FLAGS, POSTURE, POSTURE_SIN = 0, 1, 2, 3, 4  # in a joint's row
SATURATED, RATE_LIMITED, JOINT_LIMITED, PAIR = 1, 2, 4, 8
"""Bits of `FLAGS`; `PAIR`: the joint has two entries of q."""

Z_NULL, X_NULL, A_NULL, Z_NULL_BEFORE, E_NULL, S_NULL = (
    0,
    1,
    2,
    3,
    4,
    5,
)  # in a null coordinate's row


def null_size(nv: int) -> int:
    """Return the number of coordinates of the null space."""
    return max(nv - SIX, 0)


def rows(nv: int) -> int:
    """Return the number of a block's rows."""
    return FIXED + 3 * nv + null_size(nv) + -(-nv * null_size(nv) // SIX)


class PackedTool(Packed):
    """What output and state have in common."""

    __slots__ = ()

    @property
    def rows(self) -> Array:
        """The block, shape (n, 6), read-only."""
        return np.frombuffer(self.block).reshape(-1, SIX)

    def _size(self) -> tuple[int, int]:
        nv = int(self.rows[HEAD, JOINTS])
        return nv, null_size(nv)

    def _joint(self, column: int) -> Array:
        nv, _ = self._size()
        return self.rows[FIXED : FIXED + nv, column].copy()

    def _null(self, column: int) -> Array:
        nv, n = self._size()
        return self.rows[FIXED + nv : FIXED + nv + n, column].copy()

    def _matrix(self, k: int) -> Array:
        nv, n = self._size()
        start = FIXED + nv + n + k * nv
        return self.rows[start : start + nv]

    def _flag(self, bit: int) -> BoolArray:
        flags: BoolArray = (self._joint(FLAGS).astype(np.int64) & bit) != 0
        return flags

    @property
    def basis(self) -> Array:
        """V of the null space, shape (nv, n)."""
        nv, n = self._size()
        start = (FIXED + 3 * nv + n) * SIX
        return np.frombuffer(self.block)[start : start + nv * n].reshape(nv, n).copy()


def _row(k: int) -> Any:
    return property(lambda self: self.rows[k].copy())


def _pose(rows: Array, k: int) -> Pose:
    numbers = rows[k : k + 2].ravel()
    return Pose(numbers[:9].reshape(3, 3).copy(), numbers[9:].copy())


class PackedToolState(PackedTool):
    """A `CartesianState` in a block."""

    __slots__ = ()
    _plain = CartesianState

    ticks = property(lambda self: int(self.rows[HEAD, TICKS]))
    displacement = property(lambda self: Displacement(*self.rows[XI : XI_RATE + 1].copy()))
    tool = property(lambda self: ReachingState(*self.rows[Z : A + 1].copy()))
    null = property(lambda self: ReachingState(*map(self._null, (Z_NULL, X_NULL, A_NULL))))
    tau = property(lambda self: self._joint(TAU))
    pulled = _row(PULLED)
    displacement_before = property(
        lambda self: Displacement(*self.rows[XI_BEFORE : XI_RATE_BEFORE + 1].copy())
    )
    z_before = _row(Z_BEFORE)
    z_null_before = property(lambda self: self._null(Z_NULL_BEFORE))

    @property
    def posture(self) -> Array:
        """Configuration that the null space is drawn to, shape (nq,)."""
        nv, _ = self._size()
        pairs = self.rows[FIXED : FIXED + nv, POSTURE : POSTURE_SIN + 1]
        second = self._flag(PAIR)
        posture: Array = pairs[np.column_stack([np.ones_like(second), second])]
        return posture

    def at_late_tick(self, displacement: Displacement, z: Array, z_null: Array) -> PackedToolState:
        """Return the state at a tick that comes late; see `CartesianState.at_late_tick`."""
        nv, n = self._size()
        block = self.rows.copy()
        block[XI : XI_RATE + 1], block[Z] = displacement, z
        block[FIXED + nv : FIXED + nv + n, Z_NULL] = z_null
        return PackedToolState(block)

    @classmethod
    def pack(cls, state: CartesianState, pairs: BoolArray) -> PackedToolState:
        """Return a state with the same contents.

        Args:
            state: The state.
            pairs: Which joints have two entries of q, shape (nv,), bool.
        """
        nv, n = state.basis.shape
        block = np.zeros((rows(nv), SIX))
        block[HEAD, TICKS], block[HEAD, JOINTS] = state.ticks, nv
        block[XI : XI_RATE + 1], block[Z : A + 1] = state.displacement, state.tool
        block[PULLED], block[Z_BEFORE] = state.pulled, state.z_before
        block[XI_BEFORE : XI_RATE_BEFORE + 1] = state.displacement_before
        joints, null = block[FIXED : FIXED + nv], block[FIXED + nv : FIXED + nv + n]
        joints[:, TAU], joints[:, FLAGS] = state.tau, np.where(pairs, PAIR, 0)
        given = np.column_stack([np.ones_like(pairs), pairs])
        posture = np.zeros(given.shape)
        posture[given] = state.posture
        joints[:, POSTURE : POSTURE_SIN + 1] = posture
        null[:, : A_NULL + 1], null[:, Z_NULL_BEFORE] = (
            np.transpose(state.null),
            state.z_null_before,
        )
        block.reshape(-1)[(FIXED + 3 * nv + n) * SIX :][: nv * n] = state.basis.ravel()
        return cls(block)


class PackedToolOutput(PackedTool):
    """A `CartesianOutput` in a block; its arrays are copies."""

    __slots__ = ()
    _plain = CartesianOutput

    tau = property(lambda self: self._joint(TAU))
    pose = property(lambda self: _pose(self.rows, POSE))
    axes = property(lambda self: _pose(self.rows, AXES).rotation)
    wrench, e1, e2, e3, s, u, lost = map(_row, (WRENCH, E1, E2, E3, S, U, LOST))
    e_null = property(lambda self: self._null(E_NULL))
    s_null = property(lambda self: self._null(S_NULL))
    a = property(lambda self: self._joint(ACCELERATION))
    inverse = property(lambda self: self._matrix(1).copy())
    premise_holds = property(lambda self: self.rows[HOLDS] != 0.0)
    saturated = property(lambda self: self._flag(SATURATED))
    rate_limited = property(lambda self: self._flag(RATE_LIMITED))
    joint_limited = property(lambda self: self._flag(JOINT_LIMITED))

    @property
    def jacobian(self) -> Array:
        """J of the frame, shape (6, nv)."""
        return np.ascontiguousarray(self._matrix(0).T)

    @property
    def reference(self) -> CartesianReference:
        """Impedance reference x_r."""
        rows = self.rows
        return CartesianReference(_pose(rows, REFERENCE), rows[V_R].copy(), rows[A_R].copy())

    @property
    def sigma(self) -> float:
        """Smallest singular value of the scaled Jacobian."""
        scales = np.repeat([1.0 / self.rows[HEAD, LENGTH], 1.0], 3)
        return float(np.linalg.svd(self._matrix(0) * scales, compute_uv=False)[-1])
