"""A .xacro file becomes the text of a URDF: expanded by xacro in a process of its own, bounded in time and memory."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from ...exceptions import ModelError
from .strict_xml import MAX_CHARACTERS, has_doctype

MAX_SECONDS = 30
"""Longest that the expansion of one file may take."""

MAX_MEMORY = 2 * 1024**3
"""Most memory that it may take [bytes]."""

_EXPAND = """
import sys
sys.path[:] = sys.argv[2:]
import xacro
try:
    text = xacro.process_file(sys.argv[1]).toxml()
except BaseException as error:
    sys.exit(f"{type(error).__name__}: {error}")
sys.stdout.buffer.write(text.encode())
"""


def expand_xacro(path: Path, text: str) -> str:
    """Expand a xacro file. It is a program: only its time and memory are bounded, not what it reads and does.

    Args:
        path: The file.
        text: Its text.

    Returns:
        The text of the URDF.

    Raises:
        ModelError: It declares a DOCTYPE, xacro cannot expand it, or not within the bounds.
    """
    if has_doctype(text):
        raise ModelError(f"'{path.name}' declares a DOCTYPE; a xacro file needs none: remove it")
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as said:
        try:
            code = _expand(path, out.fileno(), said.fileno())
        except OSError as error:
            raise ModelError(f"xacro cannot be started for '{path.name}': {error}") from error
        said.seek(0)
        reason = said.read(4096).decode(errors="replace").strip()
        if code:
            raise ModelError(
                f"xacro cannot expand '{path.name}': {reason or _killed(code)}. Where it needs ROS packages or "
                f"arguments, expand it there with `xacro {path.name} > robot.urdf`"
            )
        out.seek(0)
        return out.read(MAX_CHARACTERS + 1).decode(errors="replace")


def _expand(path: Path, out: int, said: int) -> int:
    """Run xacro and return its exit code; that of `kill -9` where it took too long."""
    process = subprocess.Popen(
        [sys.executable, "-I", "-c", _EXPAND, str(path.absolute()), *filter(None, sys.path)],
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=said,
    )
    try:
        _bound(process.pid)
        return process.wait(MAX_SECONDS)
    except subprocess.TimeoutExpired:
        return -9
    finally:
        process.kill()
        process.wait()


def _bound(pid: int) -> None:
    """Bound a process's memory and output, where the system can do that from outside (Linux)."""
    if sys.platform != "linux":
        return
    for kind, most in (
        (resource.RLIMIT_AS, MAX_MEMORY),
        (resource.RLIMIT_FSIZE, 2 * MAX_CHARACTERS),
    ):
        _, hard = resource.prlimit(pid, kind)
        limit = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.prlimit(pid, kind, (limit, limit))


def _killed(code: int) -> str:
    return f"it takes more than {MAX_SECONDS} s or memory ({code})"
