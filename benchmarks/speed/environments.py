"""Virtual environments in the user's cache folder, one for each peer, so that none disturbs another or this one."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from .workers import WorkerError


def cache_folder() -> Path:
    """Return the folder for environments and binaries: rbimpedance in `XDG_CACHE_HOME`, ~/.cache by default."""
    return (
        Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser().absolute() / "rbimpedance"
    )


def interpreter(name: str, module: str, requirements: Sequence[str]) -> str:
    """Return a Python that has a module: this one, or that of an environment made for it.

    Args:
        name: Of the environment.
        module: What has to be importable.
        requirements: What pip installs where it is not.

    Raises:
        WorkerError: pip could not install it.
    """
    return sys.executable if find_spec(module) else str(environment(name, requirements))


def environment(name: str, requirements: Sequence[str]) -> Path:
    """Return the Python of the environment of a name, made first where there is none.

    Raises:
        WorkerError: pip could not install the requirements.
    """
    folder = cache_folder() / "environments" / name
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    wanted, stamp = "\n".join(requirements), folder / "requirements.txt"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return python
    venv.create(folder, with_pip=True, clear=True)
    _install(python, requirements)
    stamp.write_text(wanted, encoding="utf-8")
    return python


def version(python: str | Path, distribution: str) -> str:
    """Return the version of a distribution that an interpreter has."""
    code = f"import importlib.metadata as m; print(m.version({distribution!r}))"
    run = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    return run.stdout.strip()


def _install(python: Path, requirements: Sequence[str]) -> None:
    """Install wheels only: what has to be built first would measure the builder's patience."""
    command = [
        str(python),
        "-m",
        "pip",
        "install",
        "--quiet",
        "--only-binary",
        ":all:",
        *requirements,
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        errors = [line for line in run.stderr.splitlines() if line.startswith("ERROR:")]
        reason = errors[-1].removeprefix("ERROR: ") if errors else "pip failed"
        raise WorkerError(f"does not install: {reason}")
