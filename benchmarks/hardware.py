"""Every number of docs/hardware-limits.md: the closed loop on arms whose drives lag, ripple, yield and count.

    python benchmarks/hardware.py [--quick] [--arms panda ...] [--jobs 1]

Writes docs/figures/hardware.json and hardware.png, and rewrites the tables of the page. `--quick` bisects once;
arms that are left out keep what they had; `--out` and `--docs` say where it goes.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Iterator, Mapping
from multiprocessing import Manager
from pathlib import Path
from time import sleep
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import matplotlib as mpl

mpl.use("Agg")

from concurrent.futures import ProcessPoolExecutor

import numpy as np
from hardware_parts import page
from hardware_parts.measure import STEPS, measure
from hardware_parts.trials import ARMS
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from robustness_parts.common import rewrite

ROOT = Path(__file__).parents[1]
HALVINGS, QUICK = 3, 1


def one_arm(name: str, halvings: int, done: Any) -> dict[str, Any]:
    """What is measured on one arm, in a process of its own."""
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    return measure(name, halvings, lambda: done.append(name))


def measured(names: list[str], halvings: int, jobs: int) -> Iterator[dict[str, Any]]:
    """Everything of one arm after the other, with a progress bar."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with (
        Manager() as manager,
        Progress(*columns, console=Console(stderr=True)) as progress,
        ProcessPoolExecutor(jobs) as pool,
    ):
        done = manager.list()
        bar = progress.add_task("arms", total=STEPS * len(names))
        futures = [pool.submit(one_arm, name, halvings, done) for name in names]
        for future in futures:
            while not future.done():
                sleep(0.5)
                progress.update(bar, completed=len(done))
            yield future.result()


def plain(value: Any) -> Any:
    """Turn NumPy's numbers into JSON's, with six digits."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return float(f"{value:.6g}") if isinstance(value, float) else value


def main() -> None:
    """Measure, write, draw, tabulate."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--arms", nargs="*", choices=ARMS, default=list(ARMS))
    parser.add_argument("--quick", action="store_true", help="bounds by a factor of four only")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of the page")
    parser.add_argument("--draw", action="store_true", help="only draw and tabulate what is there")
    asked = parser.parse_args()
    path = asked.out / "hardware.json"
    rows = json.loads(path.read_text("utf-8"))["arms"] if path.exists() else {}
    if not asked.draw:
        halvings = QUICK if asked.quick else HALVINGS
        asked.out.mkdir(parents=True, exist_ok=True)
        for row in measured(asked.arms, halvings, asked.jobs):
            rows = rows | {row["arm"]: plain(row)}
            rows = {name: rows[name] for name in ARMS if name in rows}
            path.write_text(json.dumps({"arms": rows}, indent=1) + "\n", "utf-8")
    page.draw(rows, asked.out / "hardware.png")
    rewrite(asked.docs / "hardware-limits.md", page.tables(rows))


if __name__ == "__main__":
    main()
