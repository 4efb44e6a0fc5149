"""Whatever a source holds, `load_robot` answers with a typed error that says so, or with a sound arm."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from ..hostile.case import Case
from ..hostile_corpus import cases
from ..isolation import Verdict

ROOT = Path(__file__).parents[2]
CASES = cases()


@pytest.fixture(scope="module")
def verdicts() -> dict[str, Verdict]:
    """What came of each case, loaded in a process of its own that was forked from one of two servers."""
    command = (
        sys.executable,
        "-W",
        "ignore",
        "-m",
        "tests.hostile_corpus",
        "--step",
        "2",
        "--first",
    )
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    servers = [
        subprocess.Popen(
            [*command, first], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
        )
        for first in ("0", "1")
    ]
    lines = [line for server in servers for line in server.communicate(timeout=300)[0].splitlines()]
    assert [server.returncode for server in servers] == [0, 0]
    found = [json.loads(line) for line in lines]
    return {verdict["name"]: verdict for verdict in found}


def test_corpus_is_large() -> None:
    assert len(CASES) >= 150


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_outcome_is_the_one_written_down(case: Case, verdicts: dict[str, Verdict]) -> None:
    verdict = verdicts[case.name]
    assert verdict["fault"] == ""
    assert verdict["outcome"] == case.outcome, verdict["message"]
    assert re.search(case.word, verdict["message"]), verdict["message"]
