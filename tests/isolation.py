"""Loading in a process of its own, bounded in time and memory, and the verdict on what came out of it."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

import rbimpedance as rbi

Verdict = dict[str, Any]
"""`outcome`: "sound" or the error's class; `message`: the error or the notes; `fault`: what must not be, or ""."""

_PAGE = resource.getpagesize()


def fresh_python(code: str) -> subprocess.CompletedProcess[str]:
    """Run some code in a Python of its own, which has loaded nothing yet; it has to succeed."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)


def isolated(work: Callable[[], Verdict], *, seconds: int, megabytes: int) -> Verdict:
    """Do some work in a forked process; a crash, a hang or hunger becomes a verdict with a fault."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _bound(seconds, megabytes)
        os.write(writing, json.dumps(work()).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        said = answer.read()
    _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    died = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    verdict: Verdict = (
        json.loads(said) if code == 0 else {"outcome": "", "message": "", "fault": died}
    )
    return verdict | {
        "seconds": usage.ru_utime + usage.ru_stime,
        "megabytes": usage.ru_maxrss // 1024,
    }


def _bound(seconds: int, megabytes: int) -> None:
    """Bound this process: processor time, waiting time, and memory beyond what it has (where the system does that)."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    signal.alarm(3 * seconds)  # its default action ends the process
    if sys.platform == "linux":
        with open("/proc/self/statm", encoding="ascii") as sizes:  # noqa: PTH123
            held = int(sizes.read().split()[0]) * _PAGE
        resource.setrlimit(resource.RLIMIT_AS, (held + megabytes * 2**20,) * 2)


def judged(
    load: Callable[[], rbi.ArmModel], document: str | None, lock: Collection[str]
) -> Verdict:
    """Load and judge: a typed, printable error, or a sound arm with every joint; silence on file descriptor 2."""
    with tempfile.TemporaryFile() as sink, warnings.catch_warnings():
        warnings.simplefilter("error")
        kept = os.dup(2)
        os.dup2(sink.fileno(), 2)
        try:
            arm = load()
            fault = unsound(arm, document, lock)
            verdict = {"outcome": "sound", "message": "; ".join(arm.notes), "fault": fault}
        except rbi.RBImpedanceError as error:
            verdict = {"outcome": type(error).__name__, "message": str(error), "fault": ""}
        except BaseException:
            told = traceback.format_exc(limit=-3)
            verdict = {"outcome": "untyped", "message": told, "fault": f"untyped: {told}"}
        finally:
            os.dup2(kept, 2)
            os.close(kept)
        sink.seek(0)
        noise = sink.read(500).decode(errors="replace")
    if noise:
        verdict["fault"] += f" noise on file descriptor 2: {noise!r}"
    if not verdict["message"].isprintable() and not verdict["fault"]:
        verdict["fault"] = "the message holds control characters"
    return verdict


def unsound(arm: rbi.ArmModel, document: str | None, lock: Collection[str]) -> str:
    """Why an arm that was accepted must not have been; empty where it is sound."""
    if arm.nv < 1:
        return "nothing moves"
    if document is not None:
        wanted = _movable(document, lock)
        if wanted is not None and set(arm.model.names[1:]) != wanted:
            return (
                f"the arm has the joints {list(arm.model.names[1:])}, the document {sorted(wanted)}"
            )
    rng = np.random.default_rng(0)
    for _ in range(4):
        q, v, tau = arm.random_configuration(rng), *rng.normal(size=(2, arm.nv))
        M = np.asarray(arm.mass_matrix(q))
        if not np.isfinite(M).all() or not np.allclose(M, M.T, rtol=1e-9, atol=0.0):
            return f"M is not finite and symmetric at {q.tolist()}"
        if np.linalg.eigvalsh(M)[0] <= 0.0:
            return f"M is not positive definite at {q.tolist()}"
        a = arm.forward_dynamics(q, v, tau)
        if not np.isfinite(a).all():
            return f"ABA is not finite at {q.tolist()}"
    return _unlike_pinocchio(arm, q)


def _unlike_pinocchio(arm: rbi.ArmModel, q: Any) -> str:
    """Hold M against Pinocchio's own on a fresh `Data`, where no joint mimics (its CRBA is wrong there)."""
    model = arm.model
    if len(model.mimicking_joints):
        return ""
    M = pin.crba(model, model.createData(), q)
    return "" if np.allclose(M, arm.mass_matrix(q), rtol=1e-9) else "M is not Pinocchio's"


def _movable(document: str, lock: Collection[str]) -> set[str] | None:
    """Names of the joints that move, those that follow a locked one left out, by a parser other than the library's.

    None where that one (expat) cannot read the document: it knows fewer letters in names of attributes (XML 1.0, 4th
    edition) than libxml2 (5th).
    """
    try:
        joints = ET.fromstring(document.lstrip("\ufeff \t\r\n").encode()).findall("joint")
    except ET.ParseError:
        return None
    kinds: Mapping[str, str] = {j.get("name", ""): j.get("type", "") for j in joints}
    rules = ((j.get("name", ""), j.find("mimic")) for j in joints)
    follows = {name: rule.get("joint", "") for name, rule in rules if rule is not None}
    held: set[str] = set()
    found = set(lock)
    while held != found:
        held = found
        found = held | {name for name, leader in follows.items() if leader in held}
    return {
        n for n, kind in kinds.items() if kind in ("revolute", "continuous", "prismatic")
    } - held
