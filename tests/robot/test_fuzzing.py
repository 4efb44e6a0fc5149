"""A slice of the fuzzing of `benchmarks/robot/fuzz_urdf.py`; continuous integration runs a longer one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_spoiled_robots_are_refused_or_sound(tmp_path: Path) -> None:
    options = ("--seconds", "0", "--seed", "7", "--save", str(tmp_path), "--corpus", str(tmp_path))
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "benchmarks.robot.fuzz_urdf", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("40 cases")
    assert "; 0 faults" in run.stdout
