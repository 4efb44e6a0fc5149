"""The command line, called from within a test."""

from __future__ import annotations

import sys

import pytest

from rbimpedance.cli import app as cli


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Run the command line in this process and return its exit code."""
    monkeypatch.setattr(sys, "argv", ["rbimpedance", *arguments])
    try:
        cli.main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0
