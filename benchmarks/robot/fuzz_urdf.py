"""Spoil real robot descriptions at random and load them: a typed error or a sound arm must come out, nothing else.

    python -m benchmarks.robot.fuzz_urdf [--seconds 60] [--seed 0] [--first 0] [--save out/fuzz] [--corpus FOLDER]

The descriptions of example-robot-data, some that are built here and, if it is there, a corpus are spoiled in numbers,
attributes, elements, structure and bytes. Each case follows from the seed and its number alone. Batches are loaded in
forked processes under limits of time and memory; where one ends badly, its cases are loaded again one by one. What must
not be is saved, with the number that makes it again (`--first N --seconds 0`), and the exit code is 1.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from example_robot_data.robots_loader import ROBOTS
from example_robot_data.utils import getModelPath
from lxml import etree

import rbimpedance as rbi
from benchmarks.pages import ROOT
from benchmarks.robot.spoiled import Case, case
from tests.arms import mimic_urdf, spinner_urdf
from tests.hostile.case import ARM, chain
from tests.isolation import Verdict, isolated, judged

BATCH = 40
SECONDS = 5  # of processor time for one case
MEGABYTES = 2000
LARGEST_SEED = 60_000  # characters


def verdict_on(spoiled: Case) -> Verdict:
    """Load a case, and once more in the way that a refusal of joints proposes."""
    try:
        text = spoiled.content.decode()
    except UnicodeDecodeError:
        text = spoiled.content.decode("latin-1")
    verdict = load(text, spoiled.repair, ())
    if verdict["outcome"] == "UnsupportedJointError" and not verdict["fault"]:
        verdict = load(text, spoiled.repair, tuple(verdict["joints"]))
    return verdict


def load(text: str, repair: bool, lock: tuple[str, ...]) -> Verdict:
    """Load a text and judge what comes out."""
    if not text.lstrip("\ufeff \t\r\n").startswith("<"):
        text = "<" + text
    refused: list[str] = []

    def loaded() -> rbi.ArmModel:
        try:
            return rbi.load_robot(text, repair=repair, lock=lock, armature=1e-3 if lock else None)
        except rbi.UnsupportedJointError as error:
            refused.extend(error.joints)
            raise

    return judged(loaded, None if repair else text, lock) | {"joints": refused}


def run_batch(batch: list[Case]) -> Iterator[tuple[Case, Verdict]]:
    """Load a batch in one process; one by one where that process ends badly or holds a fault."""

    def work() -> Verdict:
        verdicts = [verdict_on(spoiled) for spoiled in batch]
        fault = next((v["fault"] for v in verdicts if v["fault"]), "")
        return {"outcomes": [v["outcome"] for v in verdicts], "fault": fault}

    together = isolated(work, seconds=SECONDS * len(batch), megabytes=MEGABYTES)
    if not together["fault"]:
        for spoiled, outcome in zip(batch, together["outcomes"], strict=True):
            yield spoiled, {"outcome": outcome, "fault": ""}
        return
    for spoiled in batch:
        alone = isolated(
            lambda spoiled=spoiled: verdict_on(spoiled),  # type: ignore[misc]
            seconds=SECONDS,
            megabytes=MEGABYTES,
        )
        yield spoiled, alone


def seeds_of(corpus: Path) -> list[tuple[str, bytes]]:
    """The descriptions that are spoiled."""
    own = {
        "arm": ARM,
        "spinner": spinner_urdf(),
        "mimic": mimic_urdf(),
        "chain": chain(12),
        "two_link": "",
    }
    own["two_link"] = (ROOT / "urdf" / "two_link.urdf").read_text(encoding="utf-8")
    found = [(name, text.encode()) for name, text in own.items()]
    for name, loader in sorted(ROBOTS.items()):
        if loader.urdf_filename:
            file = Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
            found.append((name, Path(getModelPath(str(file)), file).read_bytes()))
    found += [(path.name, path.read_bytes()) for path in sorted(corpus.glob("*.urdf"))]
    parser = etree.XMLParser(remove_comments=True, remove_blank_text=True)
    plain = [(name, etree.tostring(etree.fromstring(text, parser))) for name, text in found]
    return [(name, text) for name, text in plain if len(text) <= LARGEST_SEED]


def main() -> int:
    """Spoil and load until the time is over."""
    parser = argparse.ArgumentParser(
        description="Spoil robot descriptions at random and load them."
    )
    parser.add_argument("--seconds", type=float, default=60.0, help="at least one batch is loaded")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--save", type=Path, default=ROOT / "out" / "fuzz", help="where faults go")
    parser.add_argument("--corpus", type=Path, default=ROOT.parent / "shared" / "urdf_corpus")
    options = parser.parse_args()
    seeds = seeds_of(options.corpus)
    rbi.load_robot(ARM)  # imports what loading needs, once
    start, number, faults = time.monotonic(), options.first, 0
    outcomes: Counter[str] = Counter()
    while number == options.first or time.monotonic() - start < options.seconds:
        batch = [case(options.seed, number + i, seeds) for i in range(BATCH)]
        number += BATCH
        for spoiled, verdict in run_batch(batch):
            outcomes[verdict["outcome"] or "died"] += 1
            if verdict["fault"]:
                faults += 1
                report(spoiled, verdict, options.save, options.seed)
    total, passed = sum(outcomes.values()), time.monotonic() - start
    told = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    print(
        f"{total} cases of {len(seeds)} descriptions in {passed:.0f} s ({total / passed:.0f}/s), seed {options.seed}: "
        f"{told}; {faults} faults"
    )
    return int(faults > 0)


def report(spoiled: Case, verdict: Verdict, folder: Path, seed: int) -> None:
    """Say what must not be, and save it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{seed}_{spoiled.number}.urdf"
    path.write_bytes(spoiled.content)
    repair = " with repair" if spoiled.repair else ""
    print(
        f"case {spoiled.number}, of {spoiled.seed_name}{repair}: {verdict['fault']} ({path})",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
