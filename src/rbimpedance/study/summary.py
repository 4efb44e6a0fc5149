"""What a study's table says: each controller for itself, and the first against each of the others, pair by pair."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import Array, BoolArray
from ..exceptions import ParameterError
from .table import arrow

if TYPE_CHECKING:
    import pyarrow as pa

COMPARED = ("deviation_rms", "e_im_rms", "tau_variation")
"""The figures that pairs are compared by."""

MEDIANS = ("deviation_rms", "deviation_max", "e_im_rms", "e1_rms", "tau_variation", "tau_peak")
"""The figures that each controller has its median of."""

ALIKE = 1.25
"""Torque variations that differ by no more than this factor count as equal."""

CONFIDENCE = 0.95
"""Of the intervals."""

RESAMPLES = 9999
"""Of the bootstrap."""

CELL = ["robot", "disturbance"]
"""Columns of what samples are alike in."""

_TINY = 1e-15  # figures below it count as it: ratios need no zero


def summarize(table: pa.Table) -> dict[str, Any]:
    """Return what a study says, as plain data.

    Ratios are those of the first controller in the table to another, over all pairs of runs of the same experiment
    that both came to their end: geometric means, with percentile intervals of a bootstrap that resamples robots ×
    disturbances, since the samples of one are alike. The others are counted: a run that diverged or failed where
    the other's did not is worse, and one where both did is neither.

    Args:
        table: From `run_study`.

    Returns:
        "study", "ours", "runs"; "controllers" with counts and medians by name; "compared" by the others' names.

    Raises:
        ParameterError: The table has no row.
    """
    if not table.num_rows:
        raise ParameterError("table", "no row", "the table of a study")
    ours, *others = table["controller"].unique().to_pylist()
    runs = {name: _runs(table, name) for name in (ours, *others)}
    return {
        "study": table["study"][0].as_py(),
        "ours": ours,
        "runs": table.num_rows,
        "controllers": {name: _alone(of_name) for name, of_name in runs.items()},
        "compared": {name: _compared(pairs(runs[ours], runs[name])) for name in others},
    }


def pairs(ours: pa.Table, other: pa.Table) -> pa.Table:
    """Return the experiments that two controllers were both put through, in the order of ours.

    Args:
        ours: Rows of the first controller.
        other: Rows of the other.

    Returns:
        By robot and disturbance: whether each run came to its end, "ended" and "other_ended"; the logarithms of the
        deviations, "ours" and "other", and those of the ratios, by `COMPARED`. They are null where one run did not.
    """
    pa = arrow()
    keys, figures = [*CELL, "sample"], ["status", *COMPARED]
    ours = ours.select([*keys, *figures]).append_column("place", pa.array(range(ours.num_rows)))
    found = ours.join(other.select([*keys, *figures]), keys, None, "inner", "", "_other")
    found = found.sort_by("place")
    ended, other_ended = (found[name].to_numpy() == "done" for name in ("status", "status_other"))
    logs = {
        name: np.log(np.maximum(found[name].to_numpy().astype(np.float64), _TINY))
        for figure in COMPARED
        for name in (figure, f"{figure}_other")
    }
    lost = ~(ended & other_ended)
    columns = {name: logs[name] - logs[f"{name}_other"] for name in COMPARED}
    columns |= {"ours": logs[COMPARED[0]], "other": logs[f"{COMPARED[0]}_other"]}
    return pa.table(
        {name: found[name] for name in CELL}
        | {"ended": ended, "other_ended": other_ended}
        | {name: pa.array(column, mask=lost) for name, column in columns.items()}
    )


def geometric_mean(sums: Array, counts: Array) -> dict[str, Any]:
    """Return exp(mean of all logarithms), and its confidence interval, resampling whole cells.

    Args:
        sums: Sum of the logarithms of each cell, a robot under a disturbance.
        counts: How many logarithms each has, at least one.
    """
    told: dict[str, Any] = {"pairs": int(counts.sum()), "cells": len(counts)}
    if not told["cells"]:
        return told | {"ratio": None, "low": None, "high": None}
    low, high = _interval(sums, counts) if told["cells"] > 1 else (None, None)
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


def _runs(table: pa.Table, controller: str) -> pa.Table:
    return table.filter(arrow().compute.equal(table["controller"], controller))


def _alone(runs: pa.Table) -> dict[str, Any]:
    """Counts and medians of one controller."""
    statuses = runs["status"].to_pylist()
    done = runs.filter(arrow().compute.equal(runs["status"], "done"))
    medians = {
        name: float(np.median(done[name].to_numpy())) if done.num_rows else None for name in MEDIANS
    }
    counts = {name: statuses.count(name) for name in ("done", "diverged", "failed")}
    return {"runs": runs.num_rows} | counts | {"median": medians}


def _compared(found: pa.Table) -> dict[str, Any]:
    """Ours against another."""
    ended, other_ended = found["ended"].to_numpy(), found["other_ended"].to_numpy()
    both, decided = ended & other_ended, int((ended | other_ended).sum())
    log_deviation, log_variation = (
        found[name].to_numpy() for name in (COMPARED[0], "tau_variation")
    )
    alike = both & (np.abs(log_variation) <= np.log(ALIKE))
    worse = int(np.where(both, log_deviation > 0.0, other_ended).sum())
    return {
        "pairs": found.num_rows,
        "only_ours_ended": int((ended & ~other_ended).sum()),
        "only_other_ended": int((other_ended & ~ended).sum()),
        "none_ended": found.num_rows - decided,
        "worse": worse,
        "share_worse": worse / decided if decided else None,
        "all": _ratios(found, both),
        "equal_torque_variation": _ratios(found, alike),
        "worse_cells": _worse_cells(found),
    }


def _ratios(found: pa.Table, counted: BoolArray) -> dict[str, Any]:
    """Geometric means over the pairs that count."""
    cells = found.filter(counted).group_by(CELL, use_threads=False)
    sums = cells.aggregate([(name, function) for name in COMPARED for function in ("sum", "count")])
    columns = {name: sums[name].to_numpy() for name in sums.column_names}
    return {
        name: geometric_mean(columns[f"{name}_sum"], columns[f"{name}_count"].astype(np.float64))
        for name in COMPARED
    }


def _worse_cells(found: pa.Table) -> list[dict[str, Any]]:
    """Where ours is worse, in the mean of a robot and a disturbance or in runs that came to their end; worst first.

    "lost": how many runs more of ours did not end.
    """
    asked = [("ended", "count"), ("ours", "mean"), ("other", "mean")]
    asked += [("ended", "sum"), ("other_ended", "sum")]
    cells = []
    for row in found.group_by(CELL, use_threads=False).aggregate(asked).to_pylist():
        ours, other = (
            None if row[name] is None else float(np.exp(row[name]))
            for name in ("ours_mean", "other_mean")
        )
        ratio = None if ours is None or other is None else ours / other
        lost = row["other_ended_sum"] - row["ended_sum"]
        told = {name: row[name] for name in CELL} | {"pairs": row["ended_count"]}
        if lost > 0 or (ratio or 0.0) > 1.0:
            cells.append(told | {"ours": ours, "other": other, "ratio": ratio, "lost": lost})
    return sorted(
        cells, key=lambda c: (-c["lost"], -(c["ratio"] or 0.0), c["robot"], c["disturbance"])
    )
