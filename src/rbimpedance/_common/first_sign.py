"""A line on stderr where the command line is slow to load; importing this module begins to wait."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

PATIENCE = 0.8
"""Time without a word [s]."""

_COMMANDS = {"rbimpedance", "rbimpedance.exe"}
_is_loaded = threading.Event()


def watch() -> None:
    """Begin to wait, in a process that is the command line."""
    if _is_command_line():
        _is_loaded.clear()
        threading.Thread(target=_wait, daemon=True).start()


def loaded() -> None:
    """Say nothing any more."""
    _is_loaded.set()


def _wait() -> None:
    if not _is_loaded.wait(PATIENCE):
        print("loading rbimpedance ...", file=sys.stderr, flush=True)


def _is_command_line() -> bool:
    """Whether this process is `rbimpedance` or `python -m rbimpedance`, and may say something."""
    if not {"--quiet", "--json"}.isdisjoint(sys.argv):
        return False
    if sys.argv[:1] == ["-m"]:  # not known yet, while Python looks for the module
        return "rbimpedance" in sys.orig_argv
    return bool(sys.argv) and Path(sys.argv[0]).name in _COMMANDS


watch()
