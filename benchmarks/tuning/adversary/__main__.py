"""Try to break what proposed gains promise: python -m benchmarks.tuning.adversary [--first 5] [--plants 15].

Every task gets 15 and more plants within its ranges, the last of them by a search from the worst. Answers are appended
to `--answers`; tasks in that file are not repeated, so that a run can be stopped and taken up again. At the end the
tables of docs/robustness.md are rewritten, with `--write`.
"""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks import pages
from benchmarks.pages import plain
from benchmarks.progress import bar

from .cases import cases
from .runs import attack
from .tables import tables


def main() -> None:
    """Attack, one task after the other."""
    parser = pages.parser(__doc__)
    parser.add_argument("--answers", type=Path, default=Path("adversary.jsonl"))
    parser.add_argument("--first", type=int, help="only so many tasks")
    parser.add_argument("--plants", type=int, help="only so many plants, without a search")
    parser.add_argument("--only", default="", help="tasks with this in their name or family")
    parser.add_argument("--write", action="store_true", help="rewrite the page and its figures")
    asked = parser.parse_args()
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    wanted = [x for x in cases() if asked.only in f"{x.family}: {x.name}"][: asked.first]
    answers = _known(asked.answers)
    with bar() as progress, asked.answers.open("a", encoding="utf-8") as file:
        task = progress.add_task("tasks", total=len(wanted))
        for case in wanted:
            if case.name not in answers:
                answers[case.name] = plain(attack(case, asked.plants))
                file.write(json.dumps(answers[case.name]) + "\n")
                file.flush()
            progress.advance(task)
    found = tables([answers[case.name] for case in wanted])
    print("\n\n".join(f"{name}\n{table}" for name, table in found.items()))
    if asked.write:
        pages.rewrite(asked.docs / "robustness.md", found)


def _known(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text("utf-8").splitlines() if line]
    return {row["case"]: row for row in rows}


if __name__ == "__main__":
    main()
