"""What `rbimpedance tune` shows of a proposal: tables and a figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from .._common.arrays import Array
from ..control.default_gains import slope_at_zero
from ..tuning import CartesianGainProposal, GainProposal
from ..tuning.tool_proposal import BLOCKS
from .terminal import number, table
from .units import Units, kinds

_INSTANTS = 200  # at which the acceleration of a motion is taken

_COLUMNS = (
    *("k1", "k2", "margin", "mismatch [{f}]", "inertia [{m}]", "rate [{x}/s^3]"),
    *("error left [{x}]", "noise [{f}]"),
)

LEGEND = (
    "k1, k2: gains; margin: how many periods the scheme takes to respond; mismatch: largest torque that the model gets "
    "wrong; inertia: smallest that the motors move; rate: how fast the disturbance changes; error left: the largest "
    "error after convergence, from simulated worst cases with headroom; noise: torque that sensor noise causes"
)
"""What the columns of the table of gains mean."""

WORST_LEGEND = (
    "|e1| late: error at the end of the simulated motion. Beside the disturbance it has the coupling of the joints, "
    "the changes of the motion, and what the step of the simulation makes, up to {step:.2g}; variation: all ups "
    "and downs of the torque in a second; needed: those that the motion needs"
)
"""What the columns of the table of worst samples mean."""


def gains_tables(proposal: GainProposal) -> Iterator[Table]:
    """One row per joint: the gains, and the bounds that they come from."""
    mismatch = proposal.mismatch
    columns = (
        *(proposal.k1, proposal.k2, proposal.margin),
        *(mismatch.torque, mismatch.inertia, mismatch.disturbance_rate),
        *(proposal.error, proposal.noise_torque),
    )
    verdict = "proposed gains" if proposal.feasible else "REFUSED, the numbers behind it"
    title = f"{proposal.nominal.name}, dt = {proposal.dt:g} s: {verdict}"
    yield from _by_joint(title, proposal, _COLUMNS, columns)


def torque_tables(proposal: GainProposal) -> Iterator[Table]:
    """One row per joint: what the motion needs of its limits; none where there are no limits."""
    demand = proposal.torque
    if demand is None:
        return
    columns: tuple[Array, ...] = (demand.needed, demand.reserve, demand.limit, demand.lack)
    header = ["needs [{f}]", "reserve wanted [{f}]", "limit [{f}]", "lacks [{f}]"]
    if np.isfinite(demand.rate_limit).any():
        columns += (demand.rate_needed, demand.rate_limit, demand.rate_lack)
        header += ["needs [{f}/s]", "limit [{f}/s]", "lacks [{f}/s]"]
    yield from _by_joint("torque, over all plants", proposal, header, columns)


def _by_joint(
    title: str, proposal: GainProposal, header: Sequence[str], columns: Sequence[Array]
) -> Iterator[Table]:
    """A table for the joints that turn, and one for those that slide."""
    for kind in kinds(proposal.nominal.position_units):
        rows = [
            [proposal.nominal.joint_names[i], *(number(float(column[i])) for column in columns)]
            for i in kind.joints
        ]
        yield table(title, ("joint", *map(kind.write, header)), rows)


def step_error(proposal: GainProposal) -> float:
    """Largest error that the step h of the simulated plant makes: h/2·abs(a), over the slope of the surface at zero.

    Semi-implicit Euler moves by the velocity at the end of a step, which is h/2·a more than the mean that is measured.
    """
    times = np.linspace(0.0, proposal.worst[0].result.t[-1], _INSTANTS).tolist()
    a = np.max([np.abs(proposal.trajectory(t).a) for t in times], axis=0)
    h = proposal.dt / proposal.worst[0].result.provenance["substeps"]
    slope = slope_at_zero(proposal.surface, proposal.nominal.nv)
    return float((h / 2.0 * a / slope).max())


def worst_table(proposal: GainProposal) -> Table:
    """One row per simulated worst sample."""
    rows = [
        [
            name,
            number(float(case.error.max())),
            number(float(case.peak.max())),
            number(float(case.variation.sum())),
            number(float(case.needed.sum())),
            case.reason or "ok",
        ]
        for name, case in zip(case_names(proposal), proposal.worst, strict=True)
    ]
    units = Units("rad or m", "N·m or N", "", ())
    (kind,) = (
        found if len(found := tuple(kinds(proposal.nominal.position_units))) == 1 else (units,)
    )
    columns = ("|e1| late [{x}]", "largest [{x}]", "variation [{f}/s]", "needed [{f}/s]")
    header = ("worst sample", *map(kind.write, columns), "")
    return table("simulated", header, rows)


BLOCKS_LEGEND = (
    "k1, k2: gains of the tool's translation and rotation and of the joint motions that leave it where it is; "
    "mismatch: largest acceleration that the model gets wrong; error left, noise: the steady error under such a "
    "disturbance, and "
    "what sensor noise adds"
)
"""What the columns of the table of gains at the tool mean."""

WORST_AT_TOOL_LEGEND = (
    "late: distance of the tool from its reference at the end of the simulated motion; variation: all ups and downs of "
    "the torque in a second; needed: those that the motion needs"
)
"""What the columns of the table of worst samples at the tool mean."""


def blocks_table(proposal: CartesianGainProposal) -> Table:
    """One row per block: the gains, and the bounds that they come from."""
    verdict = "proposed gains" if proposal.feasible else "REFUSED, the numbers behind it"
    title = f"{proposal.nominal.name}, frame '{proposal.frame}', dt = {proposal.dt:g} s: {verdict}"
    columns = (proposal.k1, proposal.k2, proposal.missed, proposal.error, proposal.noise_error)
    rows = [
        [f"{block} [{unit}]", *(number(float(column[i])) for column in columns)]
        for i, (block, unit) in enumerate(zip(BLOCKS, ("m", "rad", "rad"), strict=True))
        if i < 2 or proposal.nominal.nv > 6
    ]
    header = ("", "k1", "k2", "mismatch [../s^2]", "error left [..]", "noise [..]")
    return table(f"{title}, margin {proposal.margin:.3g}", header, rows)


def worst_at_tool(proposal: CartesianGainProposal) -> Table:
    """One row per simulated worst sample."""
    rows = [
        [
            name,
            *(number(float(x)) for x in (*case.error, case.variation.sum(), case.needed.sum())),
            case.reason or "ok",
        ]
        for name, case in zip(case_names(proposal), proposal.worst, strict=True)
    ]
    columns = ("late [m]", "late [rad]", "variation [N·m/s]", "needed [N·m/s]", "")
    return table("simulated", ("worst sample", *columns), rows)


def case_names(proposal: GainProposal | CartesianGainProposal) -> list[str]:
    """Labels of the worst samples."""
    cases: tuple[Any, ...] = proposal.worst
    return [
        f"{i}: {case.sample.payload:.3g} kg, links x{case.sample.inertia_scale:.3g}"
        + (", noise" if case.noisy else "")
        for i, case in enumerate(cases, 1)
    ]
