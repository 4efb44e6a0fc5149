"""Tables and JSON that the command line prints about results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from rich.table import Table

from .._common.arrays import Array
from ..simulation.result import SimulationResult
from ..simulation.violations import unit_of
from .terminal import number, table
from .units import kinds

_METRICS = {
    "e1_final": "|e1| at the end [{x}]",
    "e1_max": "|e1| largest [{x}]",
    "e1_rms": "|e1| rms [{x}]",
    "e2_rms": "|e2| rms [{x}/s]",
    "e_im_final": "|e_im| at the end [{f}]",
    "e_im_rms": "|e_im| rms [{f}]",
    "settling_1e-2": "|e1| below 1e-2 {x} from [s]",
    "settling_1e-3": "|e1| below 1e-3 {x} from [s]",
    "settling_1e-4": "|e1| below 1e-4 {x} from [s]",
    "tau_peak": "|tau| largest [{f}]",
    "tau_variation": "variation of tau [{f}/s]",
}

LEGEND = (
    "e1: distance from the motion that the target impedance makes; e2: the same in velocity; e_im: impedance error, "
    "the force that is missing (eq. 5); tau: motor torque; rms: root mean square; variation: all ups and downs "
    "in a second; –: never"
)
"""What the names in the tables of runs mean."""

_COMPARED = {
    "e1_max_second_half": "|e1| largest, second half [rad]",
    "e_im_final": "|e_im| at the end [N·m]",
    "settling_1e-3": "|e1| below 1e-3 rad from [s]",
    "tau_peak": "|tau| largest [N·m]",
    "tau1_variation_second_half": "variation of tau_1, second half [N·m/s]",
}


def result_figures(result: SimulationResult) -> dict[str, Array]:
    """Figures of merit of one run, per joint, each of shape (nv,)."""
    ends = {"e1_final": np.abs(result.e1[-1]), "e_im_final": np.abs(result.e_im[-1])}
    return result.metrics() | ends


def result_tables(title: str, result: SimulationResult) -> Iterator[Table]:
    """One table for the joints that turn and one for those that slide: one row per figure, one column per joint."""
    figures, names = result_figures(result), result.joint_names
    for kind in kinds([unit_of(result, i) for i in range(len(names))]):
        rows = [
            [kind.write(label), *(number(float(figures[name][i])) for i in kind.joints)]
            for name, label in _METRICS.items()
        ]
        yield table(title, ("", *(names[i] for i in kind.joints)), rows)


def comparison_figures(results: Mapping[str, SimulationResult]) -> dict[str, dict[str, float]]:
    """Figures of merit of several runs, the worst joint's each, by name."""
    return {name: _compared(result) for name, result in results.items()}


def comparison_table(title: str, results: Mapping[str, SimulationResult]) -> Table:
    """One row per run, one column per figure."""
    figures = comparison_figures(results)
    rows = [
        [name, *(number(values[column]) for column in _COMPARED)]
        for name, values in figures.items()
    ]
    return table(title, ("", *_COMPARED.values()), rows)


def _compared(result: SimulationResult) -> dict[str, float]:
    late: dict[str, Any] = result.metrics(after=result.t[-1] / 2.0)
    return {
        "e1_max_second_half": float(late["e1_max"].max()),
        "e_im_final": float(np.abs(result.e_im[-1]).max()),
        "settling_1e-3": float(result.settling_time(1e-3).max()),
        "tau_peak": float(np.abs(result.tau).max()),
        "tau1_variation_second_half": float(late["tau_variation"][0]),
    }
