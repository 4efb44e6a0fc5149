"""The suite itself: what is installed beside it changes nothing, and `--slow` adds the slow tests."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def _collected(*options: str, path: str = "") -> subprocess.CompletedProcess[str]:
    """Collect this file's tests in a process of its own."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-n", "0", *options]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([path, os.environ.get("PYTHONPATH", "")])
    }
    return subprocess.run(
        command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_a_plugin_that_warns_when_it_is_loaded_does_not_stop_the_suite(tmp_path: Path) -> None:
    (tmp_path / "stray.py").write_text("raise DeprecationWarning('stray')")
    installed = tmp_path / "stray-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: stray\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text("[pytest11]\nstray = stray\n")
    run = _collected("tests/test_exceptions.py", path=str(tmp_path))
    assert run.returncode == 0, run.stderr


@pytest.mark.slow
def test_slow_tests_wait_for_their_flag(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text("utf-8"))
    (tmp_path / "test_two.py").write_text(
        "import pytest\n\ndef test_fast(): pass\n\n@pytest.mark.slow\ndef test_patient(): pass\n"
    )
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    options = f"--rootdir={tmp_path}", f"--confcutdir={tmp_path}", str(tmp_path)
    assert "::test_patient" not in _collected(*options).stdout
    assert "::test_patient" in _collected("--slow", *options).stdout
