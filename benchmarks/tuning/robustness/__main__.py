"""Every number of docs/robustness.md, and the measured ones of docs/interaction.md: one command, one seed.

    python -m benchmarks.tuning.robustness [--jobs 2] [--parts limits far ...] [--plants 200] [--few 12]

Writes docs/figures/robustness.json and the figures, and rewrites the tables of the two pages. A part that is left out
keeps what it had. `--plants` and `--few` are for a quick look; `--out` and `--docs` say where it goes.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from time import perf_counter
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import matplotlib as mpl

mpl.use("Agg")

from benchmarks import pages
from benchmarks.arms import ARMS
from benchmarks.pages import plain
from benchmarks.progress import bar

from . import PARTS, common

PAGES = ("robustness.md", "interaction.md")


def start_worker(simulation: dict[str, Any]) -> None:
    """Tell a new process how to simulate, and to be silent about what is left to Python."""
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    common.SIMULATION.update(simulation)


def answer(
    jobs: list[common.Job], processes: int, name: str, simulation: dict[str, Any]
) -> list[Any]:
    """Do all jobs, in any order, and return their answers in this one."""
    answers: list[Any] = [None] * len(jobs)
    with (
        bar() as progress,
        ProcessPoolExecutor(processes, initializer=start_worker, initargs=(simulation,)) as pool,
    ):
        task = progress.add_task(name, total=len(jobs))
        places: dict[Future[Any], int] = {
            pool.submit(job.function, *job.arguments): i for i, job in enumerate(jobs)
        }
        for done in as_completed(places):
            answers[places[done]] = done.result()
            progress.advance(task)
    return answers


def rewrite(folder: Path, tables: Mapping[str, str]) -> None:
    """Put tables into the pages that have a place for them, between <!-- name --> and <!-- end of name -->."""
    for name, table in tables.items():
        begin = f"<!-- {name} -->\n"
        places = [folder / page for page in PAGES if begin in (folder / page).read_text("utf-8")]
        if not places:
            raise SystemExit(f"no page has a place for the table '{name}'")
        for page in places:
            pages.rewrite(page, {name: table})


def main() -> None:
    """Measure, write, draw, tabulate."""
    parser = pages.parser(__doc__, jobs=os.cpu_count() or 1)
    parser.add_argument("--parts", nargs="*", choices=PARTS, default=list(PARTS))
    parser.add_argument("--arms", nargs="*", choices=ARMS, default=list(ARMS))
    parser.add_argument("--plants", type=int, default=200, help="sampled plants where many count")
    parser.add_argument("--few", type=int, default=12, help="sampled plants elsewhere")
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--backend", default="compiled", help="of the simulations")
    asked = parser.parse_args()
    options = common.Options(tuple(asked.arms), asked.plants, asked.few, asked.seed)
    simulation = {"backend": asked.backend}
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / "robustness.json"
    for name in asked.parts:
        begin = perf_counter()
        answers = answer(PARTS[name].jobs(options), asked.jobs, name, simulation)
        data = PARTS[name].collect(options, answers)
        draw = PARTS[name].draw
        if draw is not None:
            draw(data, asked.out)
        figures = {"seed": options.seed, "seconds": round(perf_counter() - begin)} | plain(data)
        measured = json.loads(path.read_text("utf-8")) if path.exists() else {}
        path.write_text(json.dumps(measured | {name: figures}, indent=1) + "\n", "utf-8")
        rewrite(asked.docs, PARTS[name].tables(figures))


if __name__ == "__main__":
    main()
