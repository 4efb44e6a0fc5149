"""Effort limits of the description switched on: how fast a motion may be, and whether the results are right."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.arms import ARMS, DT, GRIPPERS, load, motion
from benchmarks.pages import markdown, power
from rbimpedance.tuning import GainProposal, Uncertainty

from .common import Figures, Job, Options, Part
from .trials import propose, run, said, summary

PERIODS = tuple(6.0 * 0.8**k for k in range(16))
ACCURACY = 1e-2
CLOSE = 1.01
FASTER = (1.02, 1.1)
"""How much faster than the verge a motion is tested."""


def within_limits(name: str, locked: bool, plants: int, seed: int) -> Figures:
    """The usual motion: feasible or not, and the plants of a feasible proposal."""
    arm = load(name, lock=GRIPPERS.get(name, ()) if locked else ())
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=1.1)
    proposal = propose(arm, unknown, motion(arm), DT, seed=seed, limits=arm.effort_limit)
    row = _row(proposal) | {"locked": locked, "remedies": proposal.remedies}
    if proposal.feasible:
        samples = unknown.sample(arm, plants, seed=seed + 1)
        tests = [run(proposal, sample) for sample in samples]
        row |= summary(tests) | {"saturated": max(test["saturated"] for test in tests)}
    return row


def verge(name: str, plants: int, seed: int) -> Figures:
    """The shortest feasible period, and the same motion a little faster, which is infeasible."""
    arm = load(name, lock=GRIPPERS.get(name, ()))
    unknown = Uncertainty(payload=ARMS[name], inertia_scale=1.1)

    def at(period: float, limits: Any = arm.effort_limit) -> GainProposal:
        asked = motion(arm, period)
        return propose(arm, unknown, asked, DT, seed=seed, accuracy=ACCURACY, limits=limits)

    good, bad = _border(at)
    accepted, refused = at(good), at(bad)
    tests = [run(accepted, sample) for sample in unknown.sample(arm, plants, seed=seed + 1)]
    return (
        _row(accepted)
        | summary(tests)
        | {name: max(test[name] for test in tests) for name in ("last", "saturated")}
        | {"period": good, "no": _row(refused) | {"period": bad, "remedies": refused.remedies}}
        | {"faster": [_denied(at, good / factor, factor) for factor in FASTER]}
    )


def _border(at: Callable[[float], GainProposal]) -> tuple[float, float]:
    """The shortest feasible period, and a slightly shorter infeasible one."""
    good, bad = next(pair for pair in pairwise(PERIODS) if not at(pair[1]).feasible)
    while good / bad > CLOSE:
        middle = float(np.sqrt(good * bad))
        good, bad = (middle, bad) if at(middle).feasible else (good, middle)
    return good, bad


def _denied(at: Callable[..., GainProposal], period: float, factor: float) -> Figures:
    """A motion faster than the verge: the proposal's result, and the same law within the limits."""
    refused, free = at(period), at(period, None)
    row = _row(refused) | {"factor": factor, "period": period}
    if not free.feasible or refused.torque is None:
        return row | {"run": None}
    worst = int(np.argmax(refused.torque.share))
    return row | {"run": run(free, refused.torque.plants[worst], limits=refused.torque.limit)}


def _row(proposal: GainProposal) -> Figures:
    """What a proposal says of the limits."""
    demand = proposal.torque
    assert demand is not None
    worst = int(np.argmax(demand.share))
    return said(proposal) | {
        "tightest": proposal.nominal.joint_names[worst],
        "needed": float(demand.needed[worst]),
        "limit": float(demand.limit[worst]),
        "lack": float(demand.lack[worst]),
    }


def jobs(options: Options) -> list[Job]:
    """The usual motion, with and without talos_arm's gripper, and the verge of each arm."""
    usual = [(name, True) for name in options.arms]
    usual += [(name, False) for name in options.arms if name in GRIPPERS]
    plain = [Job(within_limits, (*case, options.few, options.seed)) for case in usual]
    return plain + [Job(verge, (name, options.few, options.seed)) for name in options.arms]


def collect(options: Options, answers: list[Any]) -> Figures:
    """Rows of the usual motion, and of the verge."""
    verges = len(options.arms)
    return {"rows": answers[:-verges], "verge": answers[-verges:]}


def tables(data: Mapping[str, Any]) -> dict[str, str]:
    """Both tables, and the remedies of the infeasible cases."""
    usual = [
        (
            row["arm"] if row["locked"] else f"{row['arm']}, its gripper moves, too",
            row["tightest"],
            f"{row['needed']:.3g} of {row['limit']:.3g}",
            "feasible" if row["feasible"] else f"infeasible: {row['lack']:.2g} N·m missing",
            power(row.get("error")),
            f"{row.get('diverged', '–')} of {row['plants']}" if "plants" in row else "–",
            f"{row['saturated']:.1%}" if "saturated" in row else "–",
        )
        for row in data["rows"]
    ]
    header = (
        *("arm", "tightest joint", "needs, of its limit [N·m]", "verdict"),
        *("error at 5 s, worst [rad]", "diverged", "time at a limit, worst"),
    )
    verges = [_verge_row(row) for row in data["verge"]]
    names = (
        *("arm", "shortest feasible period [s]", "error in the last second, worst [rad]"),
        *("infeasible at [s]", "reason"),
        *(f"{100.0 * (factor - 1.0):.0f} % faster: missing torque; error" for factor in FASTER),
    )
    refused = [row for row in data["rows"] if not row["feasible"]]
    refused += [row["no"] for row in data["verge"]]
    words = "\n".join(f"- {row['arm']}: {row['reason']}. {_ways(row)}" for row in refused)
    return {
        "limits": markdown(header, usual),
        "limits-verge": markdown(names, verges),
        "limits-words": words,
    }


def _verge_row(row: Mapping[str, Any]) -> tuple[str, ...]:
    no = row["no"]
    torque = f"{no['tightest']} needs {no['needed']:.3g} of {no['limit']:.3g} N·m"
    because = torque if no["lack"] > 0.0 else f"accuracy, not torque: {no['joint']}"
    return (
        *(row["arm"], f"{row['period']:.3g}", power(row["last"]), f"{no['period']:.3g}", because),
        *(_faster(case) for case in row["faster"]),
    )


def _faster(case: Mapping[str, Any]) -> str:
    if case["run"] is None:
        return f"{case['lack']:.2g} N·m; –"
    if case["run"]["diverged"]:
        return f"{case['lack']:.2g} N·m; diverges"
    return f"{case['lack']:.2g} N·m; {case['run']['last']:.1e} rad"


def _ways(row: Mapping[str, Any]) -> str:
    return "Remedies: " + "; ".join(row["remedies"]) + "."


PARTS = {"limits": Part(jobs, collect, tables)}
