"""What a rollout leaves behind: chosen channels at every so many ticks, and figures of merit on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._common.arrays import Array
from ..._numba.compile import fused, inline
from ..._numba.lanes import select
from ...control.compiled.block import BIT_OF, E1, E2, FLAGS, OUTPUT, Q_R, Q_R_SIN, TAU
from ...control.telemetry import CHANNELS
from ...control.telemetry import FLAGS as FLAG_NAMES
from ...law import impedance as law
from ...robot.compiled.tables import CONTINUOUS, KIND, Q_INDEX, ArmTables
from .plant import PlantMotion

COLUMN_OF = {each.name: OUTPUT.index(each.name) for each in CHANNELS if each.name in OUTPUT}
"""Where a tick's block keeps the channels of the controller."""


class LogArrays(NamedTuple):
    """Channels of `SimulationResult`; one that is not wanted has no rows.

    Attributes:
        q: Shape (samples, nq), and so q_r; all others (samples, nv).
        v: Velocity.
        q_r: Impedance reference.
        e_im: Impedance error.
        tau_ext: Torque of the environment.
        columns: Channels that are columns of the block, in the order of `COLUMN_OF`.
        flags: Flags, in the order of the table of channels.
        column_of: Column of each of the former, shape (len(columns),).
        bit_of: Bit of each of the latter, 0 where none is ever set, shape (len(flags),).
        every: Ticks from one sample to the next, shape (1,).
    """

    q: Array
    v: Array
    q_r: Array
    e_im: Array
    tau_ext: Array
    columns: tuple[Array, ...]
    flags: tuple[NDArray[np.uint8], ...]
    column_of: NDArray[np.int64]
    bit_of: NDArray[np.int64]
    every: NDArray[np.int64]


def journal(channels: Mapping[str, Array], every: int = 1) -> LogArrays:
    """Return a journal that writes to the given arrays.

    Args:
        channels: Arrays (samples, nq or nv) by name of the channel; what is missing is not written.
        every: Ticks from one sample to the next.
    """
    unwanted, no_flag = np.zeros((0, 1)), np.zeros((0, 1), dtype=np.bool_)
    return LogArrays(
        q=channels.get("q", unwanted),
        v=channels.get("v", unwanted),
        q_r=channels.get("q_r", unwanted),
        e_im=channels.get("e_im", unwanted),
        tau_ext=channels.get("tau_ext", unwanted),
        columns=tuple(channels.get(name, unwanted) for name in COLUMN_OF),
        flags=tuple(channels.get(name, no_flag).view(np.uint8) for name in FLAG_NAMES),
        column_of=np.array(list(COLUMN_OF.values())),
        bit_of=np.array([BIT_OF.get(name, 0) for name in FLAG_NAMES]),
        every=np.array([every]),
    )


class MetricSums(NamedTuple):
    """Sums behind `SimulationResult.metrics`, kept up to date tick by tick.

    Attributes:
        table: One row a joint, shape (nv, `FIGURES`); no rows where no figures are wanted.
        tolerances: Errors whose settling times are wanted, shape (3,).
        after: First tick that enters all but the settling times, shape (1,).
    """

    table: Array
    tolerances: Array
    after: NDArray[np.int64]


# Columns of `MetricSums.table`.
LARGEST, SQUARES, LAST_OUTSIDE = 0, 3, 6  # 3 each: of e1, e2, e_im; of e1 for each tolerance
PEAK, VARIATION, TAU_BEFORE = 9, 10, 11
FIGURES = 12


_impedance_error: Any = fused(law.impedance_error)


@fused
def impedance_error(target: Array, block: Array, e3: Array, e_im: Array) -> None:
    """Write e_im.

    Args:
        target: M_d, D_d, K_d side by side: their diagonals, (nv, 3), or whole, (nv, 3·nv).
        block: Of the tick.
        e3: a_r - a, shape (nv,).
        e_im: Where it goes, shape (nv,).
    """
    n, is_diagonal = len(e3), target.shape[1] == 3
    for i in range(n):
        if is_diagonal:
            e_im[i] = _share(target, i, 0, 1, block, i, e3)
        else:
            e_im[i] = 0.0
            for j in range(n):
                e_im[i] += _share(target, i, j, n, block, j, e3)


@fused
def _share(target: Array, i: int, k: int, apart: int, block: Array, j: int, e3: Array) -> float:
    """What the errors of joint j give to e_im of joint i, whose entries begin at column k of the target."""
    m, d, s = target[i, k], target[i, k + apart], target[i, k + 2 * apart]
    return _impedance_error(m, d, s, block[j, E1], block[j, E2], e3[j])  # type: ignore[no-any-return]


@fused
def write(
    journal: LogArrays, arm: ArmTables, i: int, motion: PlantMotion, block: Array, e_im: Array
) -> None:
    """Write one sample.

    Args:
        journal: Where to.
        arm: The controller's arm.
        i: Which sample it is.
        motion: Of the plant.
        block: Of the tick.
        e_im: Impedance error.
    """
    _put_vector(journal.q, i, motion.q)
    _put_vector(journal.v, i, motion.v)
    _put_vector(journal.e_im, i, e_im)
    _put_vector(journal.tau_ext, i, motion.tau_ext)
    for c in range(len(journal.columns)):
        _put_column(journal.columns[c], i, block, journal.column_of[c])
    if len(journal.q_r):
        for j in range(len(block)):
            k = arm.topology[j, Q_INDEX]
            journal.q_r[i, k] = block[j, Q_R]
            if arm.topology[j, KIND] == CONTINUOUS:
                journal.q_r[i, k + 1] = block[j, Q_R_SIN]
    for c in range(len(journal.flags)):
        _put_flag(journal.flags[c], i, block, journal.bit_of[c])


@inline
def _put_vector(channel: Array, i: int, values: Array) -> None:
    if len(channel):
        for j in range(len(values)):
            channel[i, j] = values[j]


@inline
def _put_column(channel: Array, i: int, block: Array, column: int) -> None:
    if len(channel):
        for j in range(len(block)):
            channel[i, j] = block[j, column]


@inline
def _put_flag(channel: NDArray[np.uint8], i: int, block: Array, bit: int) -> None:
    if len(channel):
        for j in range(len(block)):
            channel[i, j] = (np.int64(block[j, FLAGS]) & bit) != 0


@fused
def note(figures: MetricSums, k: int, block: Array, e_im: Array) -> None:
    """Let tick k enter the figures of merit.

    Args:
        figures: The figures.
        k: The tick.
        block: Of the tick.
        e_im: Impedance error.
    """
    table = figures.table
    for j in range(len(table)):
        e1, tau = block[j, E1], block[j, TAU]
        for i in range(len(figures.tolerances)):
            is_outside = abs(e1) > figures.tolerances[i]
            table[j, LAST_OUTSIDE + i] = select(is_outside, k, table[j, LAST_OUTSIDE + i])
        if k < figures.after[0]:
            continue
        _note_size(table, j, 0, e1)
        _note_size(table, j, 1, block[j, E2])
        _note_size(table, j, 2, e_im[j])
        table[j, PEAK] = max(table[j, PEAK], abs(tau))
        if k > figures.after[0]:
            table[j, VARIATION] += abs(tau - table[j, TAU_BEFORE])
        table[j, TAU_BEFORE] = tau


@inline
def _note_size(table: Array, j: int, i: int, x: float) -> None:
    table[j, LARGEST + i] = max(table[j, LARGEST + i], abs(x))
    table[j, SQUARES + i] += x * x


def empty_figures(nv: int, tolerances: Array, after: int) -> MetricSums:
    """Return the figures before the first tick."""
    table = np.zeros((nv, FIGURES))
    table[:, LAST_OUTSIDE : LAST_OUTSIDE + 3] = -1.0
    return MetricSums(table, np.asarray(tolerances, dtype=np.float64), np.array([after]))


def no_figures() -> MetricSums:
    """Return figures that are not kept."""
    return MetricSums(np.zeros((0, FIGURES)), np.zeros(0), np.array([0]))


def figures_of_merit(figures: MetricSums, ticks: int, dt: float) -> list[Array]:
    """Return the figures after the last tick, in the order and with the meaning of `SimulationResult.metrics`.

    Args:
        figures: The sums.
        ticks: Number of the last tick.
        dt: Control period [s].
    """
    table, first = figures.table, int(figures.after[0])
    means = table[:, SQUARES : SQUARES + 3] / (ticks + 1 - first)
    merits = []
    for i in range(3):
        merits += [table[:, LARGEST + i], np.sqrt(means[:, i])]
    for i in range(len(figures.tolerances)):
        last = table[:, LAST_OUTSIDE + i]
        merits.append(np.where(last == ticks, np.inf, (last + 1.0) * dt))
    return [*merits, table[:, PEAK], table[:, VARIATION] / ((ticks - first) * dt)]
