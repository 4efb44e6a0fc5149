"""Refuse files that should not be committed: too large, untidy text, notebooks with outputs.

Takes file names; without any, all files that git tracks.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

MAX_BYTES = 500_000
BINARY = {".png", ".npz", ".gif", ".pdf"}


def faults(path: Path) -> Iterator[str]:
    """Say what is wrong with one file."""
    content = path.read_bytes()
    if len(content) > MAX_BYTES:
        yield f"{len(content)} bytes, more than {MAX_BYTES}"
    if path.suffix in BINARY or not content:
        return
    if not content.endswith(b"\n") or content.endswith(b"\n\n"):
        yield "does not end with exactly one newline"
    if b"\r" in content:
        yield "has carriage returns"
    for i, line in enumerate(content.splitlines(), 1):
        if line != line.rstrip():
            yield f"line {i} ends in white space"
    if path.suffix == ".ipynb" and any(c.get("outputs") for c in json.loads(content)["cells"]):
        yield "is a notebook with outputs; clear them"


def main(names: list[str]) -> int:
    """Print every fault; return 1 if there is one."""
    if not names:
        listing = subprocess.run(["git", "ls-files", "-z"], capture_output=True, check=True)
        names = listing.stdout.decode().split("\0")[:-1]
    found = [f"{name}: {fault}" for name in names for fault in faults(Path(name))]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
