"""Tables and JSON that the command line prints about results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from rich.table import Table

from .._common.arrays import Array
from ..simulation.result import SimulationResult
from ..simulation.run_log import settling_time
from ..simulation.violations import unit_of
from .terminal import number, table
from .units import Units, kinds

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

TOOL_LEGEND = (
    "e1: distance of the tool from the motion that its target impedance makes, in world axes; rx, ry, rz: rotation; "
    "e2: the same in velocity; wrench: what pushes on the tool; tau: motor torque; rms: root mean square; variation: "
    "all ups and downs in a second; –: never"
)
"""What the names in the tables of runs at the tool mean."""

_TOOL_METRICS = {
    "e1_final": "|e1| at the end [{x}]",
    "e1_max": "|e1| largest [{x}]",
    "e1_rms": "|e1| rms [{x}]",
    "e2_rms": "|e2| rms [{x}/s]",
    "settling_1e-3": "|e1| below 1e-3 {x} from [s]",
    "wrench_max": "wrench, largest [{f}]",
}

_TOOL_AXES = (Units("m", "N", "kg", (0, 1, 2)), Units("rad", "N·m", "kg·m^2", (3, 4, 5)))

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
    metrics = _METRICS
    if result.tool is not None:
        yield from _tool_tables(title, result)
        title, metrics = "joints", {name: _METRICS[name] for name in ("tau_peak", "tau_variation")}
    figures, names = result_figures(result), result.joint_names
    for kind in kinds([unit_of(result, i) for i in range(len(names))]):
        rows = [
            [kind.write(label), *(number(float(figures[name][i])) for i in kind.joints)]
            for name, label in metrics.items()
        ]
        yield table(title, ("", *(names[i] for i in kind.joints)), rows)


def tool_figures(result: SimulationResult) -> dict[str, Array]:
    """Figures of merit of a run at the tool, each of shape (6,): x, y, z in m and their rotations in rad.

    Args:
        result: One that has a `tool`.
    """
    log = result.tool
    if log is None:
        raise TypeError("a run without a tool")
    e1 = np.abs(log.e1)
    return {
        "e1_final": e1[-1],
        "e1_max": e1.max(axis=0),
        "e1_rms": np.sqrt(np.mean(e1**2, axis=0)),
        "e2_rms": np.sqrt(np.mean(log.e2**2, axis=0)),
        "settling_1e-3": settling_time(result.t, e1, 1e-3),
        "wrench_max": np.abs(log.wrench).max(axis=0),
    }


def _tool_tables(title: str, result: SimulationResult) -> Iterator[Table]:
    """One table for the translation of the tool and one for its rotation."""
    figures = tool_figures(result)
    axes = zip(_TOOL_AXES, (title, "rotation"), (("x", "y", "z"), ("rx", "ry", "rz")), strict=True)
    for kind, title, names in axes:
        rows = [
            [kind.write(label), *(number(float(figures[name][i])) for i in kind.joints)]
            for name, label in _TOOL_METRICS.items()
        ]
        yield table(title, ("tool", *names), rows)


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
