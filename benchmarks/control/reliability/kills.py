"""Runs that are killed at random moments and resumed."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rbimpedance as rbi

COMMAND = ("run", "two_link", "--duration", "20", "--substeps", "2", "--quiet")
ENTRY = """
import rbimpedance.simulation.checkpoint as c
c.Checkpoint.__init__.__kwdefaults__["every"] = 0.3
from rbimpedance.cli import main
main()
"""


def command(out: Path, *more: str) -> list[str]:
    """Return the command line of the run that is killed, with a checkpoint every 0.3 s instead of 2 s."""
    return [sys.executable, "-c", ENTRY, *COMMAND, "--out", str(out), *more]


def kill(times: int) -> str:
    """Kill runs at random moments, go on with --resume, compare, and return the verdict."""
    rng, counts = random.Random(5), {"before a checkpoint": 0, "after one": 0, "with a result": 0}
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        began = time.monotonic()
        subprocess.run(command(whole), check=True, capture_output=True)
        took = time.monotonic() - began
        expected = (whole / "result.npz").read_bytes()
        for i in range(times):
            out = Path(folder) / str(i)
            out.mkdir()
            shutil.copy(whole / "result.npz", out / "result.npz")
            counts[_killed(out, rng.uniform(0.0, took), expected)] += 1
            subprocess.run(command(out, "--resume"), check=True, capture_output=True)
            if (out / "result.npz").read_bytes() != expected:
                sys.exit(f"kill {i}: the resumed run has other bytes")
            shutil.rmtree(out)
            print(f"{i + 1} of {times}: {counts}", flush=True)
    found = ", ".join(f"{n} {words}" for words, n in counts.items())
    return f"{times} kills ({found}): {times} whole files, {times} times the same bytes."


def _killed(out: Path, after: float, old: bytes) -> str:
    """Kill a run after a time; the file that was there is whole, and still the old one or the new one."""
    process = subprocess.Popen(command(out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(after)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    if (out / "result.npz").read_bytes() != old:
        sys.exit("the file is neither the old one nor the new one")
    rbi.SimulationResult.load(out / "result.npz")
    if process.returncode == 0:
        return "with a result"
    return "after one" if (out / "result.checkpoint").exists() else "before a checkpoint"
