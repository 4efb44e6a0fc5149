"""What `rbimpedance tune` shows of a proposal: tables and a figure."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from .._common.arrays import Array
from ..tuning import GainProposal
from .terminal import number, table

_COLUMNS = (
    *("k1", "k2", "margin", "mismatch [N m]", "inertia [kg m^2]", "rate [rad/s^3]"),
    *("error left [rad]", "noise [N m]"),
)


def gains_table(proposal: GainProposal) -> Table:
    """One row per joint: the gains, and the bounds that they come from."""
    mismatch = proposal.mismatch
    columns = (
        *(proposal.k1, proposal.k2, proposal.margin),
        *(mismatch.torque, mismatch.inertia, mismatch.disturbance_rate),
        *(proposal.error, proposal.noise_torque),
    )
    rows = [
        [name, *(number(float(column[i])) for column in columns)]
        for i, name in enumerate(proposal.nominal.joint_names)
    ]
    verdict = "proposed gains" if proposal.feasible else "REFUSED, the numbers behind it"
    title = f"{proposal.nominal.name}, dt = {proposal.dt:g} s: {verdict}"
    return table(title, ("joint", *_COLUMNS), rows)


def torque_table(proposal: GainProposal) -> Table | None:
    """One row per joint: what the motion needs of its limits; None where there are none."""
    demand = proposal.torque
    if demand is None:
        return None
    columns: tuple[Array, ...] = (demand.needed, demand.reserve, demand.limit, demand.lack)
    header = ["needs [N m]", "reserve wanted [N m]", "limit [N m]", "lacks [N m]"]
    if np.isfinite(demand.rate_limit).any():
        columns += (demand.rate_needed, demand.rate_limit, demand.rate_lack)
        header += ["needs [N m/s]", "limit [N m/s]", "lacks [N m/s]"]
    rows = [
        [name, *(number(float(column[i])) for column in columns)]
        for i, name in enumerate(proposal.nominal.joint_names)
    ]
    return table("torque, over all plants", ("joint", *header), rows)


def worst_table(proposal: GainProposal) -> Table:
    """One row per simulated worst sample."""
    rows = [
        [
            name,
            number(float(case.error.max())),
            number(float(case.variation.sum())),
            number(float(case.needed.sum())),
            case.reason or "ok",
        ]
        for name, case in zip(case_names(proposal), proposal.worst, strict=True)
    ]
    header = ("worst sample", "|e1| late [rad]", "variation [N m/s]", "needed [N m/s]", "")
    return table("simulated", header, rows)


def case_names(proposal: GainProposal) -> list[str]:
    """Labels of the worst samples."""
    return [
        f"{i}: {case.sample.payload:.3g} kg, links x{case.sample.inertia_scale:.3g}"
        + (", noise" if case.noisy else "")
        for i, case in enumerate(proposal.worst, 1)
    ]
