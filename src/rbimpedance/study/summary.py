"""What a study's table says: each controller for itself, and the first against each of the others, pair by pair."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import Array
from ..exceptions import ParameterError
from .measures import Figures

if TYPE_CHECKING:
    import pyarrow as pa

COMPARED = ("deviation_rms", "e_im_rms", "tau_variation")
"""The figures that pairs are compared by."""

MEDIANS = ("deviation_rms", "deviation_max", "e_im_rms", "e1_rms", "tau_variation", "tau_peak")
"""The figures whose medians are told."""

ALIKE = 1.25
"""Torque variations that differ by no more than this factor count as equal."""

CONFIDENCE = 0.95
"""Of the intervals."""

RESAMPLES = 9999
"""Of the bootstrap."""

Cell = tuple[str, str]
"""Robot and disturbance."""


@dataclass(frozen=True)
class Pair:
    """What two controllers did in the same experiment.

    Attributes:
        cell: Robot and disturbance.
        ours: Row of the first controller.
        other: Row of the other.
    """

    cell: Cell
    ours: Figures
    other: Figures

    @property
    def is_whole(self) -> bool:
        """Whether both runs came to their end."""
        return bool(self.ours["status"] == self.other["status"] == "done")

    @property
    def is_alike(self) -> bool:
        """Whether both came to their end with equal variation of the torque, within `ALIKE`."""
        return self.is_whole and abs(self.log_ratio("tau_variation")) <= np.log(ALIKE)

    @property
    def is_worse(self) -> bool:
        """Whether ours has the larger deviation, or did not come to its end where the other did."""
        if self.is_whole:
            return self.log_ratio(COMPARED[0]) > 0.0
        return bool(self.other["status"] == "done")

    def log_ratio(self, figure: str) -> float:
        """Return the logarithm of ours over the other's, of two runs that came to their end.

        Args:
            figure: Name of the column.
        """
        ours, other = max(self.ours[figure], _TINY), max(self.other[figure], _TINY)
        return float(np.log(ours / other))


def summarize(table: pa.Table) -> dict[str, Any]:
    """Return what a study says, as plain data.

    Ratios are those of the first controller in the table to another, over all pairs of runs of the same experiment
    that both came to their end: geometric means, with percentile intervals of a bootstrap that draws robots ×
    disturbances anew, since the samples of one are alike. The others are counted: a run that diverged or failed where
    the other's did not is worse, and one where both did is neither.

    Args:
        table: From `run_study`.

    Returns:
        "study", "ours", "runs"; "controllers" with counts and medians by name; "compared" by the others' names.

    Raises:
        ParameterError: The table has no row.
    """
    rows: list[Figures] = table.to_pylist()
    if not rows:
        raise ParameterError("table", "no row", "the table of a study")
    names = list(dict.fromkeys(row["controller"] for row in rows))
    ours = names[0]
    return {
        "study": rows[0]["study"],
        "ours": ours,
        "runs": len(rows),
        "controllers": {
            name: _alone([row for row in rows if row["controller"] == name]) for name in names
        },
        "compared": {name: _compared(pairs(rows, ours, name)) for name in names[1:]},
    }


def pairs(rows: Iterable[Figures], ours: str, other: str) -> list[Pair]:
    """Return the runs of two controllers in the same experiments.

    Args:
        rows: Of the table.
        ours: Name of the one.
        other: Name of the other.
    """
    found: dict[tuple[str, str, int], dict[str, Figures]] = {}
    for row in rows:
        experiment = row["robot"], row["disturbance"], row["sample"]
        found.setdefault(experiment, {})[row["controller"]] = row
    return [
        Pair((robot, disturbance), runs[ours], runs[other])
        for (robot, disturbance, _), runs in found.items()
        if ours in runs and other in runs
    ]


def geometric_mean(logs: Mapping[Cell, Sequence[float]]) -> dict[str, Any]:
    """Return exp(mean of all logarithms), and its confidence interval, cells drawn anew with all that is in them.

    Args:
        logs: Logarithms of ratios, by robot and disturbance.
    """
    cells = [values for values in logs.values() if values]
    sums = np.array([sum(values) for values in cells])
    counts = np.array([len(values) for values in cells], dtype=np.float64)
    told: dict[str, Any] = {"pairs": int(counts.sum()), "cells": len(cells)}
    if not cells:
        return told | {"ratio": None, "low": None, "high": None}
    low, high = _interval(sums, counts) if len(cells) > 1 else (None, None)
    return told | {"ratio": float(np.exp(sums.sum() / counts.sum())), "low": low, "high": high}


def _interval(sums: Array, counts: Array) -> tuple[float, float]:
    from scipy.stats import bootstrap  # noqa: PLC0415 (takes a while to load)

    def mean(sums: Array, counts: Array, axis: int = -1) -> Array:
        return np.asarray(sums.sum(axis=axis) / counts.sum(axis=axis))

    found = bootstrap(
        (sums, counts),
        mean,
        paired=True,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    low, high = np.exp(found.confidence_interval)
    return float(low), float(high)


def _alone(rows: list[Figures]) -> dict[str, Any]:
    """Counts and medians of one controller."""
    done = [row for row in rows if row["status"] == "done"]
    counts = {
        status: sum(row["status"] == status for row in rows)
        for status in ("done", "diverged", "failed")
    }
    medians = {
        name: float(np.median([row[name] for row in done])) if done else None for name in MEDIANS
    }
    return {"runs": len(rows)} | counts | {"median": medians}


def _compared(found: list[Pair]) -> dict[str, Any]:
    """Ours against another."""
    decided = [pair for pair in found if "done" in (pair.ours["status"], pair.other["status"])]
    worse = sum(pair.is_worse for pair in decided)
    return {
        "pairs": len(found),
        "only_ours_ended": sum(_ended(pair) == (True, False) for pair in found),
        "only_other_ended": sum(_ended(pair) == (False, True) for pair in found),
        "none_ended": len(found) - len(decided),
        "worse": worse,
        "share_worse": worse / len(decided) if decided else None,
        "all": _ratios(found, lambda pair: pair.is_whole),
        "equal_torque_variation": _ratios(found, lambda pair: pair.is_alike),
        "worse_cells": _worse_cells(found),
    }


def _ended(pair: Pair) -> tuple[bool, bool]:
    return pair.ours["status"] == "done", pair.other["status"] == "done"


def _ratios(found: list[Pair], counts: Callable[[Pair], bool]) -> dict[str, Any]:
    """Geometric means over the pairs that count."""
    logs: dict[str, dict[Cell, list[float]]] = {name: {} for name in COMPARED}
    for pair in filter(counts, found):
        for name, of_cell in logs.items():
            of_cell.setdefault(pair.cell, []).append(pair.log_ratio(name))
    return {name: geometric_mean(of_cell) for name, of_cell in logs.items()}


def _worse_cells(found: list[Pair]) -> list[dict[str, Any]]:
    """Where ours is worse, in the mean of a robot and a disturbance or in runs that came to their end; worst first."""
    cells = []
    for cell, members in groupby(sorted(found, key=_cell_of), key=_cell_of):
        told = _cell(cell, list(members))
        if told["lost"] > 0 or (told["ratio"] or 0.0) > 1.0:
            cells.append(told)
    return sorted(cells, key=lambda told: (-told["lost"], -(told["ratio"] or 0.0)))


def _cell_of(pair: Pair) -> Cell:
    return pair.cell


def _cell(cell: Cell, members: list[Pair]) -> dict[str, Any]:
    """The deviations of both in one cell; "lost": how many runs more of ours did not end."""
    whole = [pair for pair in members if pair.is_whole]
    ours, other = (
        float(np.exp(np.mean([np.log(max(row[COMPARED[0]], _TINY)) for row in rows])))
        if rows
        else None
        for rows in ([pair.ours for pair in whole], [pair.other for pair in whole])
    )
    endings = np.array([_ended(pair) for pair in members])
    return {
        "robot": cell[0],
        "disturbance": cell[1],
        "pairs": len(members),
        "ours": ours,
        "other": other,
        "ratio": None if ours is None or other is None else ours / other,
        "lost": int(endings[:, 1].sum() - endings[:, 0].sum()),
    }


_TINY = 1e-15  # figures below it count as it: ratios need no zero
