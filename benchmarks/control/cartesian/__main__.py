"""The tables of docs/tool.md: the law at the tool against what a user has today.

    python -m benchmarks.control.cartesian [--robots panda ...] [--laws NAME ...] [--jobs 1]

Writes docs/figures/cartesian.json and rewrites the tables of the page; what is left out keeps what it had.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from concurrent.futures import ProcessPoolExecutor

from benchmarks import pages
from benchmarks.progress import bar

from .measure import first_torque, measured
from .task import LAWS

ROBOTS = ("panda", "ur5", "gen3")
AWAY = (0.05, 0.2)  # m
PID = "PID on x_r, poles 100"
NOISY = (*list(LAWS)[:2], "PID on x_r, poles 40", PID, "Hogan, measured force")


def _one(run: tuple[str, str, bool]) -> dict[str, Any]:
    robot, law, noisy = run
    return measured(robot, law, noisy=noisy)


def _figure(row: dict[str, Any], kind: str) -> str:
    if "diverged" in row:
        return "diverged"
    return f"{pages.power(row[kind + '_position'])} / {pages.power(row[kind + '_rotation'])}"


def _ratio(row: dict[str, Any]) -> str:
    if "diverged" in row:
        return "–"
    return f"{row['variation'] / row['variation_needed']:.2f}"


def against_pid(found: Mapping[tuple[str, str], dict[str, Any]], robots: Sequence[str]) -> str:
    """Return the table of the PID's error over the law's, from the worst arm to the best."""
    laws = list(LAWS)[:2]
    kinds = [f"{when}_{what}" for when in ("free", "push") for what in ("position", "rotation")]
    lines = []
    for kind in kinds:
        cells = []
        for law in laws:
            ratios = [found[robot, PID][kind] / found[robot, law][kind] for robot in robots]
            cells.append(f"{min(ratios):.2g} to {max(ratios):.2g}")
        lines.append([kind.replace("_", ", "), *cells])
    return pages.markdown(["", *laws], lines)


def tables(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the tables of the page by name."""
    plain = [row for row in rows if not row["noisy"]]
    names = list(dict.fromkeys(row["law"] for row in plain))
    found = {(row["robot"], row["law"]): row for row in plain}
    robots = [robot for robot in ROBOTS if any(row["robot"] == robot for row in plain)]
    header = ["law", *(f"{robot} {kind}" for robot in robots for kind in ("free", "push"))]
    lines = [
        [
            name,
            *(_figure(found[robot, name], kind) for robot in robots for kind in ("free", "push")),
        ]
        for name in names
    ]
    torque = [[name, *(_ratio(found[robot, name]) for robot in robots)] for name in names]
    noisy = [
        [
            row["law"],
            pages.power(row.get("free_position_rms")),
            pages.power(row.get("push_position")),
            f"{row.get('variation', float('nan')):.0f}",
        ]
        for row in rows
        if row["noisy"]
    ]
    starts = [[law, *(f"{first_torque(law, away):.0f}" for away in AWAY)] for law in names]
    return {
        "start": pages.markdown(["law", *(f"{100 * away:.0f} cm" for away in AWAY)], starts),
        "against": against_pid(found, robots),
        "deviation": pages.markdown(header, lines),
        "torque": pages.markdown(["law", *robots], torque),
        "noise": pages.markdown(["law", "rms free [m]", "largest, push [m]", "N·m/s"], noisy),
    }


def main() -> None:
    """Measure, write and tabulate."""
    parser = pages.parser(__doc__, jobs=1)
    parser.add_argument("--robots", nargs="*", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--laws", nargs="*", choices=LAWS, default=list(LAWS))
    parser.add_argument("--without-noise", action="store_true", help="keep the noisy runs")
    parser.add_argument("--tabulate", action="store_true", help="only tabulate what is there")
    asked = parser.parse_args()
    path = asked.out / "cartesian.json"
    rows = json.loads(path.read_text("utf-8")) if path.exists() else []
    if not asked.tabulate:
        runs = [(robot, law, False) for robot in asked.robots for law in asked.laws]
        runs += [
            ("panda", law, True) for law in asked.laws if law in NOISY and not asked.without_noise
        ]
        rows = [row for row in rows if (row["robot"], row["law"], row["noisy"]) not in runs]
        with bar() as progress, ProcessPoolExecutor(asked.jobs) as pool:
            task = progress.add_task("runs", total=len(runs))
            for row in pool.map(_one, runs):
                rows.append(pages.plain(row))
                progress.advance(task)
        rows.sort(key=lambda row: (ROBOTS.index(row["robot"]), list(LAWS).index(row["law"])))
        asked.out.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    pages.rewrite(asked.docs / "tool.md", tables(rows))


if __name__ == "__main__":
    main()
