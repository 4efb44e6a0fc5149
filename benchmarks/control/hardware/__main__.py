"""Every number of docs/hardware-limits.md: the closed loop on arms whose drives lag, ripple, yield and count.

    python -m benchmarks.control.hardware [--quick] [--arms panda ...] [--jobs 1]

Writes docs/figures/hardware.json and hardware.png, and rewrites the tables of the page. `--quick` bisects once;
arms that are left out keep what they had; `--out` and `--docs` say where it goes.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Iterator
from multiprocessing import Manager
from time import sleep
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import matplotlib as mpl

mpl.use("Agg")

from concurrent.futures import ProcessPoolExecutor

from benchmarks import pages
from benchmarks.arms import ARMS
from benchmarks.progress import bar

from . import page
from .measure import STEPS, measure

HALVINGS, QUICK = 3, 1


def one_arm(name: str, halvings: int, done: Any) -> dict[str, Any]:
    """What is measured on one arm, in a process of its own."""
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    return measure(name, halvings, lambda: done.append(name))


def measured(names: list[str], halvings: int, jobs: int) -> Iterator[dict[str, Any]]:
    """Everything of one arm after the other, with a progress bar."""
    with (
        Manager() as manager,
        bar() as progress,
        ProcessPoolExecutor(jobs) as pool,
    ):
        done = manager.list()
        task = progress.add_task("arms", total=STEPS * len(names))
        futures = [pool.submit(one_arm, name, halvings, done) for name in names]
        for future in futures:
            while not future.done():
                sleep(0.5)
                progress.update(task, completed=len(done))
            yield future.result()


def main() -> None:
    """Measure, write, draw, tabulate."""
    parser = pages.parser(__doc__, jobs=1)
    parser.add_argument("--arms", nargs="*", choices=ARMS, default=list(ARMS))
    parser.add_argument("--quick", action="store_true", help="bounds by a factor of four only")
    parser.add_argument("--draw", action="store_true", help="only draw and tabulate what is there")
    asked = parser.parse_args()
    path = asked.out / "hardware.json"
    rows = json.loads(path.read_text("utf-8"))["arms"] if path.exists() else {}
    if not asked.draw:
        halvings = QUICK if asked.quick else HALVINGS
        asked.out.mkdir(parents=True, exist_ok=True)
        for row in measured(asked.arms, halvings, asked.jobs):
            rows = rows | {row["arm"]: pages.plain(row)}
            rows = {name: rows[name] for name in ARMS if name in rows}
            path.write_text(json.dumps({"arms": rows}, indent=1) + "\n", "utf-8")
    page.draw(rows, asked.out / "hardware.png")
    pages.rewrite(asked.docs / "hardware-limits.md", page.tables(rows))


if __name__ == "__main__":
    main()
