"""Identity of a study as plain data: to check whether a folder contains this one."""

from __future__ import annotations

import ast
import dataclasses
import functools
import hashlib
import inspect
import json
import re
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .chunk import versions
from .definition import Study

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_DEEPEST = 3  # levels of functions within functions


def identity(study: Study) -> dict[str, Any]:
    """Return what decides a study's rows: its numbers, its names with what is made for them, and what computes it.

    A maker that is a function counts with its name and code, its bound arguments and what it encloses; its layout and
    comments do not, and neither does what it calls in turn.

    Args:
        study: The study.
    """
    return {
        "name": study.name,
        "samples": study.samples,
        "duration": study.duration,
        "after": study.after,
        "seed": study.seed,
        "substeps": study.substeps,
        "robots": _makers(study.robots),
        "controllers": _makers(study.controllers),
        "disturbances": _makers(study.disturbances),
        "versions": versions(),
    }


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return the names of what two identities differ in.

    Args:
        one: From `identity`.
        other: Another.
    """
    return [name for name in {**one, **other} if one.get(name) != other.get(name)]


def _makers(makers: Mapping[str, Callable[..., Any]]) -> list[list[str]]:
    """Names and digests of makers, in their order."""
    digests = [
        (name, hashlib.sha256(json.dumps(_told(maker)).encode())) for name, maker in makers.items()
    ]
    return [[name, digest.hexdigest()[:16]] for name, digest in digests]


def _told(value: Any, depth: int = 0) -> Any:
    """Identity of a maker and its arguments, the same in every process."""
    if depth > _DEEPEST:
        return type(value).__qualname__
    if isinstance(value, functools.partial):
        parts = [value.func, *value.args, *sorted(value.keywords.items())]
        return [_told(part, depth + 1) for part in parts]
    if inspect.isfunction(value):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        defaults = [*(value.__defaults__ or ()), *sorted((value.__kwdefaults__ or {}).items())]
        enclosed = [_told(part, depth + 1) for part in (*cells, *defaults)]
        return [value.__module__, value.__qualname__, _source(value), enclosed]
    if isinstance(value, tuple | list):
        return [_told(part, depth + 1) for part in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [getattr(value, f.name) for f in dataclasses.fields(value) if f.name[0] != "_"]
        return [type(value).__qualname__, *(_told(field, depth + 1) for field in fields)]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, type):
        return [value.__module__, value.__qualname__]
    return _ADDRESS.sub("", repr(value))


def _source(function: Callable[..., Any]) -> str:
    """Source of a function, independent of layout and comments."""
    try:
        source = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError):  # typed at a prompt
        return ""
    try:
        return ast.dump(ast.parse(source))
    except SyntaxError:  # a lambda amid other lines
        return source
