"""Every message that a test of the command line draws is in its own terms."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from rich.console import Console

from rbimpedance.cli import terminal

PYTHON = re.compile(
    r"(?<![\w/\\.:'\"-])[a-z_]\w*=(?!\w*\.)|np\.\w+\(|array\(|\.result\b|trajectory\(0|\bremedy_time\b|pinocchio\.Model"
)
"""What belongs into Python: keywords with values, and its objects."""


@pytest.fixture(autouse=True)
def messages(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Collect what goes to stderr, and find no Python in it at the end."""
    said: list[str] = []

    class Heard(Console):
        def print(self, *objects: object, **how: object) -> None:
            said.extend(map(str, objects))
            super().print(*objects, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(terminal, "stderr", Heard(stderr=True))
    yield said
    assert [words for words in said if PYTHON.search(words)] == []
