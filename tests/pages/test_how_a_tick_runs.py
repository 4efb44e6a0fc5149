"""The page on the tick names files that exist, and follows q in at most six of them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import rbimpedance

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-a-tick-runs.md").read_text(encoding="utf-8")
SOURCES = Path(rbimpedance.__file__).parent
NAMED = sorted(set(re.findall(r"`([\w/]+(?:\.py|/))`", PAGE)))
WAYS = re.findall(r'`backend="(\w+)"`:\n\n((?:\d\. .*\n)+)', PAGE)


@pytest.mark.parametrize("name", NAMED)
def test_named_file_exists(name: str) -> None:
    folder = ROOT if name.startswith("tests/") else SOURCES
    assert (folder / name).exists()


def test_both_ways_of_a_tick_pass_at_most_six_files() -> None:
    assert [backend for backend, _ in WAYS] == ["pinocchio", "compiled"]
    for _, way in WAYS:
        files = re.findall(r"^\d\. `([\w/]+\.py)`", way, flags=re.MULTILINE)
        assert len(files) == len(way.splitlines()) <= 6


@pytest.mark.parametrize("name", ["numpy_tick", "whole_tick", "tick_form", "PinocchioTick"])
def test_named_function_is_in_the_file_named_with_it(name: str) -> None:
    path = re.search(rf"`{name}` in `([\w/]+\.py)`", PAGE)
    assert path is not None
    text = (SOURCES / path[1]).read_text(encoding="utf-8")
    assert re.search(rf"^(def|class) {name}\b", text, flags=re.MULTILINE)
