"""The corpus of hostile sources, each loaded in a process of its own.

python -m tests.hostile_corpus            loads all; one line of JSON for each
python -m tests.hostile_corpus FOLDER     writes those that are texts into a folder, to look at them
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import tempfile
from pathlib import Path

import rbimpedance as rbi

from .hostile import documents, objects, places, texts
from .hostile.case import ARM, Case
from .isolation import Verdict, isolated, judged

SECONDS = 10
MEGABYTES = 1500


def cases() -> tuple[Case, ...]:
    """All cases, names unique."""
    modules = (documents, texts, places, objects)
    found = [case for module in modules for group in module.GROUPS for case in group()]
    assert len({case.name for case in found}) == len(found)
    return tuple(found)


def verdict_on(case: Case) -> Verdict:
    """Load the source of a case in a process of its own."""

    def work() -> Verdict:
        with tempfile.TemporaryDirectory() as folder:
            source = case.make(Path(folder))
            verdict = judged(
                lambda: rbi.load_robot(source, **case.arguments),
                case.text() if case.text and "joints" not in case.arguments else None,
                case.arguments.get("lock", ()) if case.outcome == "sound" else (),
            )
            os.seteuid(os.getuid())  # for cleaning up
            return verdict

    return isolated(work, seconds=SECONDS, megabytes=MEGABYTES)


def main() -> None:
    """Load the cases, or write those that are texts into a folder."""
    parser = argparse.ArgumentParser(description="The corpus of hostile sources.")
    parser.add_argument(
        "folder", type=Path, nargs="?", help="write the texts into it, load nothing"
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first case to load")
    parser.add_argument("--step", type=int, default=1, help="load every so many cases")
    options = parser.parse_args()
    if options.folder is not None:
        write(options.folder)
        return
    rbi.load_robot(ARM)  # imports what loading needs, once
    gc.freeze()  # so that no child copies pages only to collect garbage
    for case in cases()[options.first :: options.step]:
        print(json.dumps({"name": case.name} | verdict_on(case)), flush=True)


def write(folder: Path) -> None:
    """Write the cases that are texts, to look at them."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, case in enumerate(cases()):
        if case.text is not None:
            name = "".join(c if c.isalnum() else "_" for c in case.name[:60])
            content = case.text().encode(errors="surrogatepass")
            (folder / f"{i:03d}_{name}.urdf").write_bytes(content)


if __name__ == "__main__":
    main()
