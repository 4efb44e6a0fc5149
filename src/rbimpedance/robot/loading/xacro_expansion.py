"""A .xacro file becomes the text of a URDF: expanded by xacro in a process of its own, bounded in time and memory."""

from __future__ import annotations

import json
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ...exceptions import ModelError
from .strict_xml import MAX_CHARACTERS, has_doctype
from .wording import by_name, listed, shortened

MAX_SECONDS = 30
"""Longest that the expansion of one file may take."""

MAX_MEMORY = 2 * 1024**3
"""Most memory that it may take [bytes]."""

_MACRO = re.compile(r"<xacro:macro\s[^>]{0,500}?name\s*=\s*[\"']([^\"']{1,200})")


@dataclass(frozen=True)
class Reading:
    """What descriptions are read with.

    Attributes:
        folders: Folders in which packages are looked up.
        repair: Names of the `REPAIRS` to make; "encoding" is made here.
        xacro_args: Values of a xacro file's arguments.
        xacro_defaults: The same, where `xacro_args` says nothing; the file need not know them.
        packages: Folders of ROS packages by name.
    """

    folders: tuple[Path, ...] = ()
    repair: Collection[str] = ()
    xacro_args: Mapping[str, str] = field(default_factory=dict)
    xacro_defaults: Mapping[str, str] = field(default_factory=dict)
    packages: Mapping[str, str] = field(default_factory=dict)


def xacro_arguments(given: Mapping[str, object] | None) -> dict[str, str]:
    """Return the values that `xacro_args=` gives, as text: xacro knows nothing else.

    Raises:
        ModelError: No mapping of names to numbers, texts or truth values.
    """
    pairs = by_name("xacro_args", given, "values")
    for name, value in pairs.items():
        if not isinstance(name, str) or not isinstance(value, str | bool | int | float):
            raise ModelError(
                f"xacro_args: '{name}' takes a text, a number or a truth value, got {value!r}"
            )
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in pairs.items()
    }


def expand_xacro(path: Path, text: str, reading: Reading) -> str:
    """Expand a xacro file. It is a program: only its time and memory are bounded, not what it reads and does.

    Args:
        path: The file.
        text: Its text.
        reading: What it is expanded with.

    Returns:
        The text of the URDF.

    Raises:
        ModelError: It declares a DOCTYPE, only defines macros, does not know an argument, xacro cannot expand it, or
            not within the bounds.
    """
    if has_doctype(text):
        raise ModelError(f"'{path.name}' declares a DOCTYPE; a xacro file needs none: remove it")
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as said:
        try:
            code = _expand(
                _task(path, reading), path.absolute().parent, out.fileno(), said.fileno()
            )
        except OSError as error:
            raise ModelError(f"xacro cannot be started for '{path.name}': {error}") from error
        said.seek(0)
        reason = said.read(4096).decode(errors="replace").strip()
        if code:
            raise ModelError(f"xacro cannot expand '{path.name}': {reason or _killed(code)}")
        out.seek(0)
        expanded = out.read(MAX_CHARACTERS + 1).decode(errors="replace")
    if "<link" not in expanded and (macros := _MACRO.findall(text)):
        names = listed([shortened(macro) for macro in dict.fromkeys(macros)], 4)
        raise ModelError(
            f"'{path.name}' only defines macros ({names}) and builds no robot; load the file that calls them, "
            "most often a .urdf.xacro file of the same package"
        )
    return expanded


def _task(path: Path, reading: Reading) -> str:
    """The argument of `xacro_worker`."""
    return json.dumps(
        {
            "file": str(path.absolute()),
            "arguments": {**reading.xacro_defaults, **reading.xacro_args},
            "use": list(reading.xacro_args),
            "folders": [str(folder.absolute()) for folder in reading.folders],
            "packages": dict(reading.packages),
            "path": list(filter(None, sys.path)),
        }
    )


def _expand(task: str, folder: Path, out: int, said: int) -> int:
    """Run xacro and return its exit code; that of `kill -9` where it took too long."""
    worker = Path(__file__).with_name("xacro_worker.py")
    process = subprocess.Popen(
        [sys.executable, "-I", str(worker), task],
        cwd=folder,
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
