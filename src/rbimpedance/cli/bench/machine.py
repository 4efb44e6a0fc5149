"""What a benchmark ran on; neither host name nor path."""

from __future__ import annotations

import datetime
import os
import platform
import re
from importlib.metadata import version
from pathlib import Path

_LIBRARIES = ("rbimpedance", "pin", "numba", "numpy")


def describe() -> dict[str, str]:
    """Return date, processor, system, load and versions."""
    found = {
        "date": datetime.datetime.now(tz=datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {_number(platform.release())}, {platform.machine()}",
        "load at the start": _load(),
        "Python": platform.python_version(),
    }
    return found | {name: version(name) for name in _LIBRARIES}


def resident_bytes() -> int:
    """Return the memory that this process holds now; 0 where the system does not say."""
    pages = Path("/proc/self/statm")
    if not pages.exists():
        return 0
    return int(pages.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8") if info.exists() else ""
    found = re.search(r"^model name\s*: (.+)$", text, re.MULTILINE)
    return found[1] if found else platform.processor() or platform.machine()


def _number(release: str) -> str:
    return ".".join(release.split(".")[:2])


def _load() -> str:
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "not known"
