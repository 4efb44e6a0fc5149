"""The README's promises hold."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_example_tracks_within_a_milliradian_and_within_the_limits_of_the_arm(
    capsys: pytest.CaptureFixture[str],
) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(example, "README.md", "exec"), names)
    error = float(capsys.readouterr().out.split()[0])
    assert 0.0 < error < 1e-3
    arm, result = names["arm"], names["result"]
    assert (arm.lower < result.q).all()
    assert (result.q < arm.upper).all()
    assert (np.abs(result.v) < arm.velocity_limit).all()
    assert (np.abs(result.tau) < arm.effort_limit).all()


def test_first_paragraph_says_what_the_library_needs_and_what_it_is_without_a_force_sensor() -> (
    None
):
    first = " ".join(README.split("\n\n")[1].split())
    for needed in ("torque commands", "external joint torque", "`tau_ext = 0`", "rigid"):
        assert needed in first


def test_every_local_link_and_picture_exists() -> None:
    targets = re.findall(r"\]\((?!https?://|#)([^)#]+)", README)
    assert targets
    assert [target for target in targets if not (ROOT / target).exists()] == []


def test_both_commands_are_the_ones_that_ci_runs() -> None:
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert 'pip install -e ".[test]" && pytest' in README
    assert '".[test]"' in ci
    assert "pytest" in ci
