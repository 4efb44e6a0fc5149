"""The compiled forms of the tick at the tool: around Pinocchio's RNEA, and with a compiled one."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numba import types

from ..._common.arrays import Array
from ..._numba.compile import kernel
from ..._numba.layouts.arrays import Borrowed
from ..._numba.layouts.objects import (
    NOTHING,
    OBJECTS,
    BlockArgument,
    PairResult,
    returner,
)
from ..._numba.layouts.tables import Held, hold, opened
from ...law.poses import CartesianReference, Pose
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import VECTOR_IN, CompiledDynamics
from ...robot.compiled.frame_motion import check_frame_motion
from ...robot.compiled.tables import CONTINUOUS, KIND, ArmTables, arm_tables
from ...robot.mimic_dynamics import pinocchio_dynamics
from ..cartesian_telemetry import CartesianState
from ..cartesian_tick import CartesianLaw
from .tool_block import POSE, SIX, PackedToolOutput, PackedToolState
from .tool_joints import EXCEEDED, allocate, put_torque
from .tool_tables import WORDS, ToolScratch, tool_words
from .tool_tick import ToolInputs, are_sound, command, finish

_OWN = Held(WORDS)
_STATE = BlockArgument(PackedToolState, SIX)
_RESULT = PairResult(PackedToolOutput, PackedToolState)
_MATRIX_IN = Borrowed(types.float64, 2, readonly=True)
_GIVEN = (VECTOR_IN, VECTOR_IN, _MATRIX_IN, *[VECTOR_IN] * 5)
_returned = returner(_RESULT)


def _before(
    own: Any,
    state: Array,
    q: Array,
    v: Array,
    R: Array,
    p: Array,
    v_d: Array,
    a_d: Array,
    wrench: Array,
    tau_ext: Array,
) -> int:
    words, given = opened(own), ToolInputs(q, v, R, p, v_d, a_d, wrench, tau_ext)
    if state.shape != words.scratch.block.shape or not are_sound(words.arm, given):
        return 1
    return 0 if command(words, state, given) else 1


def _after(
    own: Any,
    state: Array,
    torque: Array,
    q: Array,
    v: Array,
    R: Array,
    p: Array,
    v_d: Array,
    a_d: Array,
    wrench: Array,
    tau_ext: Array,
) -> Any:
    words, given = opened(own), ToolInputs(q, v, R, p, v_d, a_d, wrench, tau_ext)
    work = words.scratch
    for j in range(len(v)):
        work.torque[j] = torque[j]
    if put_torque(words.arm, words.tables, work, state, given) == EXCEEDED:
        return _returned(NOTHING, work.block)
    finish(words.tables, work)
    return _returned(OBJECTS, work.block)


def _limit(own: Any) -> Any:
    words = opened(own)
    allocate(words.scratch)
    finish(words.tables, words.scratch)
    return _returned(OBJECTS, words.scratch.block)


def _whole(
    own: Any,
    state: Array,
    q: Array,
    v: Array,
    R: Array,
    p: Array,
    v_d: Array,
    a_d: Array,
    wrench: Array,
    tau_ext: Array,
) -> Any:
    words, given = opened(own), ToolInputs(q, v, R, p, v_d, a_d, wrench, tau_ext)
    arm, tables, space, work = words
    if state.shape != work.block.shape or not are_sound(arm, given):
        return _returned(NOTHING, work.block)
    if not command(words, state, given):
        return _returned(NOTHING, work.block)
    rigid_body.inverse_dynamics(arm, space, v, work.command, work.torque)
    if put_torque(arm, tables, work, state, given) == EXCEEDED:
        rigid_body.mass_matrix(arm, space, work.mass)
        allocate(work)
    finish(tables, work)
    return _returned(OBJECTS, work.block)


@functools.cache
def before_kernel() -> Callable[..., Any]:
    """Compile what comes before the torque of the model, or load it from the disk."""
    return kernel(_before, (_OWN, _STATE, *_GIVEN))


@functools.cache
def after_kernel() -> Callable[..., Any]:
    """Compile what comes after it, or load it."""
    return kernel(_after, (_OWN, _STATE, VECTOR_IN, *_GIVEN), _RESULT)


@functools.cache
def limit_kernel() -> Callable[..., Any]:
    """Compile what comes then, where a limit is exceeded, or load it."""
    return kernel(_limit, (_OWN,), _RESULT)


@functools.cache
def whole_kernel() -> Callable[..., Any]:
    """Compile the whole tick, or load it."""
    return kernel(_whole, (_OWN, _STATE, *_GIVEN), _RESULT)


def compile_tick(*, whole: bool) -> None:
    """Compile the tick as one kernel, or as the two around the torque of the model."""
    if whole:
        whole_kernel()
    else:
        before_kernel()
        after_kernel()


class CompiledToolForm:
    """What the two forms have in common. Threads must not share one: they have one work space.

    Args:
        law: A law that `can_pack_tool` knows.

    Raises:
        UnsupportedJointError: A joint that the tables do not support.
        ModelError: The compiled motion of the frame is not Pinocchio's.
    """

    def __init__(self, law: CartesianLaw) -> None:
        arm = self._tables(law)
        self._pairs = arm.topology[:, KIND] == CONTINUOUS
        self._words = tool_words(law, arm)
        self._own, self._none = hold(self._words), np.empty(0)

    def _tables(self, law: CartesianLaw) -> ArmTables:
        return arm_tables(law.arm)

    def pack(self, state: CartesianState) -> CartesianState:
        """Return a state in the form that `step` takes."""
        given: Any = state
        if type(given) is PackedToolState:
            return state
        return cast("CartesianState", PackedToolState.pack(state, self._pairs))

    def step(self, state: Any, q: Any, v: Any, reference: Any, wrench: Any, tau_ext: Any) -> Any:
        """Return output and next state; None where this form cannot tell them, `TypeError` for no plain arrays."""
        raise NotImplementedError

    def check(self, law: CartesianLaw) -> None:
        """Compare the motion of the frame with Pinocchio's; a tick computes it before all else."""
        work, six, wanted = self._words.scratch, np.zeros(SIX), Pose(np.eye(3), np.zeros(3))
        state = PackedToolState(np.zeros(work.block.shape))

        def computed(q: Array, v: Array) -> tuple[Array, ...]:
            self.step(state, q, v, CartesianReference(wanted, six, six), six, None)
            pose = work.block[POSE : POSE + 2].ravel()
            return pose[:9].reshape(3, 3), pose[9:], work.jacobian.T, work.rate.T

        check_frame_motion(law.arm, law.kinematics.frame, computed)


class PinocchioToolTick(CompiledToolForm):
    """A tick with one kernel before Pinocchio's RNEA and one after it; see `CompiledToolForm`."""

    def __init__(self, law: CartesianLaw) -> None:
        super().__init__(law)
        self._before, self._after = before_kernel(), after_kernel()
        dynamics = pinocchio_dynamics(law.arm.raw_dynamics.model)
        self._rnea, self._mass_matrix = dynamics.rnea, dynamics.mass_matrix
        self._limit = None if law.limits is None else limit_kernel()
        self.check(law)

    def step(  # noqa: D102 (the base's docstring)
        self, state: Any, q: Any, v: Any, reference: Any, wrench: Any, tau_ext: Any
    ) -> Any:
        (R, p), v_d, a_d = reference
        given = q, v, R, p, v_d, a_d, wrench, self._none if tau_ext is None else tau_ext
        if self._before(self._own, state, *given):
            return None
        work: ToolScratch = self._words.scratch
        torque = self._rnea(q, v, work.command)
        answer = self._after(self._own, state, torque, *given)
        if answer is None and self._limit is not None:
            work.mass[:] = self._mass_matrix(q)
            answer = self._limit(self._own)
        return answer


class CompiledToolTick(CompiledToolForm):
    """A tick that is one kernel, RNEA included; see `CompiledToolForm`."""

    def __init__(self, law: CartesianLaw) -> None:
        super().__init__(law)
        self._whole = whole_kernel()
        self.check(law)

    def _tables(self, law: CartesianLaw) -> ArmTables:
        return CompiledDynamics(law.arm).tables

    def step(  # noqa: D102 (the base's docstring)
        self, state: Any, q: Any, v: Any, reference: Any, wrench: Any, tau_ext: Any
    ) -> Any:
        (R, p), v_d, a_d = reference
        ext = self._none if tau_ext is None else tau_ext
        return self._whole(self._own, state, q, v, R, p, v_d, a_d, wrench, ext)
