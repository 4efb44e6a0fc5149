"""Drives between a tick and the links in compiled code: a part of the loop, which `DrivenPlant` specifies."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array
from ..._numba.compile import inline
from ..._numba.formulas import helper
from ..._numba.layouts.tables import Held, hold, opened
from ..._numba.parts import compiled_part
from ...control.compiled.manifold import difference
from ...law.lag import lag_of
from ...law.lag import lagged as lagged_formula
from ...robot.compiled.tables import ArmTables
from .loop import ARRIVED, SENT, own_type
from .plant import PlantMotion

lagged = helper(lagged_formula)

# Rows of `DriveWords.joints`.
LAGS, DECAY, MEAN, RIPPLE, COGGING, PERIODS, IS_ELASTIC, STIFFNESS, DAMPING, INERTIA = range(10)

# Rows of `DriveWords.state`; the first two are what encoders on the rotors see.
DELTA, ROTOR_VELOCITY, TORQUE, SENT_TORQUE, NET = range(5)


class DriveWords(NamedTuple):
    """All that the part reads and writes.

    Attributes:
        arm: The links.
        motion: Of the links; the torque on them is written.
        joints: See above, shape (10, nv).
        neutral: Configuration from which ripple goes, shape (nq,).
        h: Physics step, shape (1,) [s].
        state: See above, shape (5, nv).
        pending: Torques on their way, shape (·, nv).
        before: Configuration at the beginning of a step, shape (nq,).
    """

    arm: ArmTables
    motion: PlantMotion
    joints: Array
    neutral: Array
    h: Array
    state: Array
    pending: Array
    before: Array


class Drives:
    """The drives of one run.

    Args:
        engine: A `DrivenPlant` on rigid links without torque loop and friction of its rotors.
        links: Tables of its links.
        motion: Of the links.
        h: Physics step [s].

    Raises:
        ParameterError: See `DrivenPlant.begin`.
    """

    def __init__(self, engine: Any, links: ArmTables, motion: PlantMotion, h: float) -> None:
        begun, elastic = engine.begin(motion.q.copy(), motion.v.copy(), h), engine.elastic
        joints = np.array(
            [
                *(engine.time_constant > 0.0, *lag_of(engine.time_constant, h)),
                *(engine.ripple, engine.cogging, engine.ripple_periods, elastic),
                *(np.where(elastic, engine.stiffness, 0.0), engine.damping),
                np.where(elastic, engine.rotor_inertia, 1.0),
            ]
        )
        zero = np.zeros(len(motion.v))
        self.state = np.array([begun.delta, begun.rotor_velocity, begun.torque, zero, zero])
        words = DriveWords(
            *(links, motion, joints, np.array(engine.arm.neutral), np.array([h]), self.state),
            *(np.array(begun.pending), motion.q.copy()),
        )
        self.part: tuple[int, Any] = _address(own_type(words)), hold(words)

    @property
    def ahead(self) -> Array:
        """How far the rotors are ahead of the links, and how fast they turn, shape (2, nv)."""
        return self.state[: ROTOR_VELOCITY + 1]


@functools.cache
def _address(kind: Any) -> int:
    return compiled_part(_part, Held(kind))


def _part(held: Any, when: int) -> int:
    """Take the torque of a tick, or do what comes before or after a physics step of the links."""
    words = opened(held)
    if when == SENT:
        _take(words)
    elif when == ARRIVED:
        _turn_rotors(words)
    else:
        _give(words)
    return 0


@inline
def _take(words: DriveWords) -> None:
    """Keep the torque that is sent, and write what acts on the links now."""
    motion, joints, state, pending = words.motion, words.joints, words.state, words.pending
    for j in range(len(motion.v)):
        state[SENT_TORQUE, j] = motion.tau[j]
        sent = pending[0, j] if len(pending) else motion.tau[j]
        now = state[TORQUE, j] if joints[LAGS, j] != 0.0 else sent
        motion.tau[j] = _transmitted(words, j, _rippled(words, j, now))


@inline
def _give(words: DriveWords) -> None:
    """Write the torque on the links over a step, and keep the rest for the rotors."""
    motion, joints, state, pending = words.motion, words.joints, words.state, words.pending
    for i in range(len(motion.q)):
        words.before[i] = motion.q[i]
    for j in range(len(motion.v)):
        wanted = pending[0, j] if len(pending) else state[SENT_TORQUE, j]
        for i in range(len(pending)):
            pending[i, j] = pending[i + 1, j] if i + 1 < len(pending) else state[SENT_TORQUE, j]
        mean, state[TORQUE, j] = lagged(state[TORQUE, j], wanted, joints[DECAY, j], joints[MEAN, j])
        motor = _rippled(words, j, mean)
        motion.tau[j] = _transmitted(words, j, motor)
        state[NET, j] = motor - motion.tau[j]


@inline
def _turn_rotors(words: DriveWords) -> None:
    """Velocity and lead of the rotors after a step."""
    motion, joints, state, h = words.motion, words.joints, words.state, words.h[0]
    for j in range(len(motion.v)):
        if joints[IS_ELASTIC, j] == 0.0:
            state[ROTOR_VELOCITY, j], state[DELTA, j] = motion.v[j], 0.0
            continue
        state[ROTOR_VELOCITY, j] += h * (state[NET, j] / joints[INERTIA, j])
        moved = difference(words.arm, j, words.before, motion.q)
        state[DELTA, j] += h * state[ROTOR_VELOCITY, j] - moved


@inline
def _rippled(words: DriveWords, j: int, torque: float) -> float:
    """Torque on the rotor, with ripple and cogging."""
    joints = words.joints
    if joints[RIPPLE, j] == 0.0 and joints[COGGING, j] == 0.0:
        return torque
    turned = difference(words.arm, j, words.neutral, words.motion.q) + words.state[DELTA, j]
    wave = np.sin(joints[PERIODS, j] * turned)
    rippled: float = torque + (torque * joints[RIPPLE, j] + joints[COGGING, j]) * wave
    return rippled


@inline
def _transmitted(words: DriveWords, j: int, motor: float) -> float:
    """Torque on the link: that of the spring, or the motor's where the joint is rigid."""
    joints, state = words.joints, words.state
    if joints[IS_ELASTIC, j] == 0.0:
        return motor
    twist = state[ROTOR_VELOCITY, j] - words.motion.v[j]
    torque: float = joints[STIFFNESS, j] * state[DELTA, j] + joints[DAMPING, j] * twist
    return torque
