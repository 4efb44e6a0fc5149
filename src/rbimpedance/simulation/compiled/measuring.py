"""What a controller is given instead of the plant's own motion, in compiled code: a part of the loop.

Encoders on the rotors, a momentum observer in place of a force sensor, encoders that count, noise and delay;
`DrivenPlant.measured`, `MomentumObserver.step`, `QuantizedEncoders` and `ImperfectController` specify it.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import inline, routine
from ..._numba.layouts.tables import Held, hold, opened
from ..._numba.parts import compiled_part
from ...control.compiled.block import TAU
from ...control.compiled.manifold import add_step, difference
from ...control.encoders import QuantizedEncoders
from ...control.imperfect import ImperfectController
from ...interaction import Perfect
from ...robot.compiled import rigid_body
from ...robot.compiled.dynamics import CompiledDynamics
from ...robot.compiled.rigid_body import friction, place_joints
from ...robot.compiled.tables import ArmTables, Workspace, workspace
from .loop import LoopWorkspace, Memory, own_type

# Rows of `Instruments.joints`.
RESOLUTION, POSITION_NOISE, VELOCITY_NOISE, SHARE = range(4)

# Entries of `Instruments.choices`.
AT_ROTORS, OBSERVES, COUNTS, DIFFERENTIATES, SMOOTHS, IS_NOISY, FIRST = range(7)

# Entries of `Instruments.numbers`: control period, the low-pass's share of a new velocity, the observer's period.
DT, NEW_SHARE, OBSERVER_DT = range(3)


class Instruments(NamedTuple):
    """What does not change.

    Attributes:
        arm: The controller's arm.
        model: The observer's.
        neutral: Configuration from which counts go, shape (nq,).
        joints: Resolution, noise of position and velocity, share of the observer's new estimate, shape (4, nv).
        numbers: See above.
    """

    arm: ArmTables
    model: ArmTables
    neutral: Array
    joints: Array
    numbers: Array


class Readings(NamedTuple):
    """What is passed from one tick to the next.

    Attributes:
        q: Position that the encoders gave at the tick before, shape (nq,).
        v: Their velocity, shape (nv,).
        late_q: Configurations on their way, shape (delay + 1, nq).
        late: Velocities and torques on their way, shape (delay + 1, 2·nv).
        observer: v and bias of the tick before, and the estimate, shape (3, nv).
        mass: M(q) of the tick before, and room for that of this one, shape (2·nv, nv).
    """

    q: Array
    v: Array
    late_q: Array
    late: Array
    observer: Array
    mass: Array


class MeasuringWords(NamedTuple):
    """All that the part reads and writes.

    Attributes:
        instruments: What does not change.
        readings: What is remembered.
        memory: Motion of the plant, and the ticks before.
        ahead: How far the rotors are ahead of the links, and how fast they turn, shape (2, nv).
        desk: Where the measurement goes.
        space: Work space of the observer's recursions.
        noise: Of a block, a row for each tick, shape (·, 2·nv).
        choices: See above.
    """

    instruments: Instruments
    readings: Readings
    memory: Memory
    ahead: Array
    desk: LoopWorkspace
    space: Workspace
    noise: Array
    choices: NDArray[np.int64]


class Measuring:
    """The instruments of one run.

    Args:
        controller: The controller with what is around it.
        sensor: Measurement of tau_ext: exact, or a `MomentumObserver`.
        at_rotors: Whether encoders are on rotors that turn relative to the links.
    """

    def __init__(self, controller: Any, sensor: Any, at_rotors: bool) -> None:
        arm, nq, nv = controller.arm, controller.arm.nq, controller.arm.nv
        observes, counts = type(sensor) is not Perfect, type(controller) is QuantizedEncoders
        distorts = type(controller) is ImperfectController
        delay = controller.delay if distorts else 0
        joints, numbers = np.zeros((4, nv)), np.array([controller.dt, 1.0, controller.dt])
        choices = np.zeros(7, dtype=np.int64)
        choices[[AT_ROTORS, OBSERVES, COUNTS, IS_NOISY]] = at_rotors, observes, counts, distorts
        if observes:
            joints[SHARE] = -np.expm1(-sensor.gain * sensor.dt)
            numbers[OBSERVER_DT] = sensor.dt
        if counts:
            joints[RESOLUTION] = controller.resolution
            choices[DIFFERENTIATES] = controller.velocity == "differentiated"
            choices[SMOOTHS] = controller.bandwidth is not None
            if controller.bandwidth is not None:
                numbers[NEW_SHARE] = 1.0 - np.exp(
                    -2.0 * np.pi * controller.bandwidth * controller.dt
                )
        if distorts:
            joints[POSITION_NOISE] = controller.position_noise
            joints[VELOCITY_NOISE] = controller.velocity_noise
        self._seed = controller.seed if distorts else 0
        own = CompiledDynamics(arm).tables
        model = CompiledDynamics(sensor.arm).tables if observes else own
        self._fixed = Instruments(own, model, np.array(arm.neutral), joints, numbers)
        self._choices, self._space = choices, workspace(nv)
        self._readings = Readings(
            *(np.zeros(nq), np.zeros(nv), np.zeros((delay + 1, nq)), np.zeros((delay + 1, 2 * nv))),
            *(np.zeros((3, nv)), np.zeros((2 * nv, nv))),
        )

    def part(
        self, block: range, memory: Memory, ahead: Array, desk: LoopWorkspace
    ) -> tuple[int, Any]:
        """Return the address of the part, and its words for a block of ticks.

        Args:
            block: The ticks.
            memory: Of the world.
            ahead: See `MeasuringWords`.
            desk: Work space of the loop.
        """
        nv = len(memory.motion.v)
        is_noisy = bool(self._fixed.joints[[POSITION_NOISE, VELOCITY_NOISE]].any())
        noise = _noise(self._seed, block, nv) if is_noisy else np.zeros((len(block), 2 * nv))
        choices = self._choices.copy()
        choices[FIRST] = block.start
        words = MeasuringWords(
            self._fixed, self._readings, memory, ahead, desk, self._space, noise, choices
        )
        return _address(own_type(words)), hold(words)


@functools.cache
def _address(kind: Any) -> int:
    return compiled_part(_part, Held(kind))


@functools.lru_cache(maxsize=64)  # controllers that are compared see the same noise
def _noise(seed: int, block: range, nv: int) -> Array:
    """The noise of `ImperfectController` at some ticks."""
    rows = [np.random.default_rng((seed, k)).standard_normal((2, nv)) for k in block]
    return np.reshape(rows, (len(block), 2 * nv))


def _part(held: Any, k: int) -> int:
    """Write the measurement of tick k to the desk."""
    words = opened(held)
    choices = words.choices
    _look(words, choices[AT_ROTORS] != 0)
    if choices[OBSERVES] != 0:
        _observe(words, k)
    if choices[COUNTS] != 0:
        _count(words, k)
    if choices[IS_NOISY] != 0:
        _disturb(words, k)
    return 0


@inline
def _look(words: MeasuringWords, at_rotors: bool) -> None:
    """The motion of links or rotors."""
    motion, desk, ahead = words.memory.motion, words.desk, words.ahead
    for i in range(len(motion.q)):
        desk.seen_q[i] = motion.q[i]
    for j in range(len(motion.v)):
        desk.seen_v[j], desk.seen_tau_ext[j] = motion.v[j], motion.tau_ext[j]
        if at_rotors:
            add_step(words.instruments.arm, j, motion.q, ahead[0, j], desk.seen_q)
            desk.seen_v[j] = ahead[1, j]


@routine
def _observe(words: MeasuringWords, k: int) -> None:
    """The momentum observer's estimate in place of tau_ext."""
    fixed, own, desk, n = words.instruments, words.readings, words.desk, len(words.desk.seen_v)
    model, v, r = fixed.model, own.observer[0], own.observer[2]
    sent = words.memory.even if k % 2 == 0 else words.memory.odd
    before, M, bias = own.mass[:n], own.mass[n:], desk.e_im
    place_joints(model, words.space, desk.seen_q)
    rigid_body.mass_matrix(model, words.space, M)
    _write_bias(model, words.space, desk, bias)
    for i in range(n):
        inertial = 0.0
        for j in range(n):
            inertial += (M[i, j] + before[i, j]) * (desk.seen_v[j] - v[j])
        w = inertial / (2.0 * fixed.numbers[OBSERVER_DT]) + (bias[i] + own.observer[1, i]) / 2.0
        if k > 0:
            r[i] += fixed.joints[SHARE, i] * (w - sent[i, TAU] - r[i])
    for i in range(n):
        desk.seen_tau_ext[i], own.observer[1, i] = r[i], bias[i]
        for j in range(n):
            before[i, j] = M[i, j]
    for j in range(n):
        v[j] = desk.seen_v[j]


@inline
def _write_bias(model: ArmTables, space: Workspace, desk: LoopWorkspace, bias: Array) -> None:
    """C v + g + friction at what is seen."""
    for j in range(len(bias)):
        desk.rest[j] = 0.0
    rigid_body.inverse_dynamics(model, space, desk.seen_v, desk.rest, bias)
    for j in range(len(bias)):
        bias[j] += friction(model.joints, j, desk.seen_v[j])


@inline
def _count(words: MeasuringWords, k: int) -> None:
    """Whole counts, and velocities from their differences."""
    fixed, own, desk, choices = words.instruments, words.readings, words.desk, words.choices
    arm = fixed.arm
    for j in range(len(desk.seen_v)):
        count = fixed.joints[RESOLUTION, j]
        turned = np.rint(difference(arm, j, fixed.neutral, desk.seen_q) / count) * count
        add_step(arm, j, fixed.neutral, turned, desk.seen_q)
        v = desk.seen_v[j]
        if choices[DIFFERENTIATES] != 0:
            moved = difference(arm, j, own.q, desk.seen_q) if k > 0 else 0.0
            v = moved / fixed.numbers[DT]
        if choices[SMOOTHS] != 0 and k > 0:
            v = own.v[j] + fixed.numbers[NEW_SHARE] * (v - own.v[j])
        desk.seen_v[j], own.v[j] = v, v
    for i in range(len(own.q)):
        own.q[i] = desk.seen_q[i]


@inline
def _disturb(words: MeasuringWords, k: int) -> None:
    """Noise, and measurements that come late; until the first one has arrived, that of the first tick stands."""
    fixed, own, desk, n = words.instruments, words.readings, words.desk, len(words.desk.seen_v)
    row, size = k - words.choices[FIRST], len(own.late)
    comes, goes = k % size, (k + 1) % size if k >= size - 1 else 0
    for j in range(n):
        on_q = fixed.joints[POSITION_NOISE, j] * words.noise[row, j]
        add_step(fixed.arm, j, desk.seen_q, on_q, desk.seen_q)
        own.late[comes, j] = (
            desk.seen_v[j] + fixed.joints[VELOCITY_NOISE, j] * words.noise[row, n + j]
        )
        own.late[comes, n + j] = desk.seen_tau_ext[j]
    for i in range(len(desk.seen_q)):
        own.late_q[comes, i] = desk.seen_q[i]
        desk.seen_q[i] = own.late_q[goes, i]
    for j in range(n):
        desk.seen_v[j], desk.seen_tau_ext[j] = own.late[goes, j], own.late[goes, n + j]
