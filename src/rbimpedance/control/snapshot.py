"""A controller's state as a file: bit-exact, versioned, checked, and never executed.

A snapshot is JSON. Its arrays are the bytes of their numbers in hexadecimal, so that what is restored is equal to the
bit, the signs of zeros included. The file says for which controller it is and has a checksum of what it holds; one that
is truncated, altered, foreign, of another version or for another controller is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._common.arrays import is_finite
from .._common.files import whole_file
from ..exceptions import RBImpedanceError
from ..robot.arm_model import ArmModel
from .compiled.block import Packed
from .guards.faults import Fault
from .imperfect import Measurement
from .protocol import Controller, StateT
from .provenance import provenance

FORMAT = "rbimpedance snapshot"
"""What every snapshot begins with."""

VERSION = 1
"""Version of the format that is written and read."""

MAX_BYTES = 64 * 1024 * 1024
"""Largest snapshot that is read; the state of a controller has some kilobytes."""

_KINDS = {"f8": "<f8", "i8": "<i8", "b1": "|b1"}


class SnapshotError(RBImpedanceError, ValueError):
    """A snapshot that cannot be taken or restored; the message says why."""


def save_snapshot(
    path: str | os.PathLike[str], controller: Controller[StateT], state: StateT
) -> Path:
    """Write a controller's state to a file; it appears whole or not at all.

    Args:
        path: Where to.
        controller: The controller, with all that is around it.
        state: Its state.

    Returns:
        The path that was written.

    Raises:
        SnapshotError: The state holds something else than numbers, text and tuples of the controller's own kinds.
    """
    target = Path(path)
    with whole_file(target) as file:
        file.write(dump(state, controller.init(), fingerprint(controller)))
    return target


def load_snapshot(path: str | os.PathLike[str], controller: Controller[StateT]) -> StateT:
    """Read a state that `save_snapshot` wrote, bitwise equal.

    Args:
        path: The file.
        controller: An equal controller: same arm, gains, limits, period, and guards around it.

    Raises:
        SnapshotError: No such file, or not a whole and unaltered snapshot of this version for this controller.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise SnapshotError(f"the snapshot '{path}' cannot be read: {error.strerror}") from error
    try:
        state: StateT = restore(content, controller.init(), fingerprint(controller))
        return state
    except SnapshotError as error:
        raise SnapshotError(f"'{path}' {error}") from None


def fingerprint(controller: Controller[Any], plant: ArmModel | None = None, **settings: Any) -> str:
    """Return the SHA-256 of all that makes a controller what it is; versions of libraries do not count.

    Args:
        controller: The controller, with all that is around it.
        plant: The arm that it controls; its own by default.
        **settings: What else counts, as plain data.
    """
    data = provenance(controller, plant or controller.arm, **settings)
    del data["versions"]
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def dump(state: Any, template: Any, identity: str) -> bytes:
    """Return a state as the content of a snapshot.

    Args:
        state: Numbers, text, arrays, and tuples of such things.
        template: A state of the same kind: its named tuples are the kinds that the state may hold.
        identity: `fingerprint` of what the state belongs to.

    Raises:
        SnapshotError: The state holds something else, or a number that is not finite.
    """
    kinds = {kind.__name__ for kind in _kinds(template)}
    if not is_finite(state):
        raise SnapshotError("a state with NaN or infinity cannot be saved")
    body = json.dumps(_encoded(state, kinds), allow_nan=False, separators=(",", ":"))
    header = {
        "format": FORMAT,
        "version": VERSION,
        "identity": identity,
        "checksum": _checksum(body),
    }
    return f"{json.dumps(header)}\n{body}\n".encode()


def restore(content: bytes, template: Any, identity: str) -> Any:
    """Return the state that `dump` made into the content of a snapshot.

    Args:
        content: Content of the file.
        template: As for `dump`; arrays that it has are of the same shape in the state.
        identity: As for `dump`.

    Raises:
        SnapshotError: Not a whole and unaltered snapshot of this version with this identity.
    """
    header, body = _parts(content)
    if header.get("version") != VERSION:
        raise SnapshotError(f"has version {header.get('version')!r}; this library reads {VERSION}")
    if header.get("checksum") != _checksum(body):
        raise SnapshotError("is damaged: its content does not have the checksum that it names")
    if header.get("identity") != identity:
        raise SnapshotError(
            "belongs to another controller: arm, gains, limits, period and guards must be those of the snapshot"
        )
    kinds = {kind.__name__: kind for kind in _kinds(template)}
    try:
        state = _decoded(json.loads(body), kinds)
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise SnapshotError(f"does not hold a state: {error}") from error
    if not (_is_alike(state, template) and is_finite(state)):
        raise SnapshotError("does not hold a state of this controller")
    return state


def _parts(content: bytes) -> tuple[Mapping[str, Any], str]:
    """Header and body; an error where there are none."""
    if len(content) > MAX_BYTES:
        raise SnapshotError(f"has more than {MAX_BYTES} bytes: a snapshot is smaller")
    head, _, rest = content.partition(b"\n")
    try:
        header = json.loads(head)
        body = rest.decode("ascii")
    except (ValueError, RecursionError) as error:
        raise SnapshotError("is not a snapshot, or is cut short") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise SnapshotError("is not a snapshot of this library")
    if not body.endswith("\n"):
        raise SnapshotError("is cut short: the end of the snapshot is missing")
    return header, body[:-1]


def _checksum(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()


def _kinds(template: Any) -> Iterator[type]:
    """The classes of all named tuples that a state may hold: a guard has its fault, a delay its measurements."""
    yield from (Fault, Measurement)
    template = _plain(template)
    if isinstance(template, tuple):
        if hasattr(template, "_fields"):
            yield type(template)
        for item in template:
            yield from _kinds(item)


def _plain(state: Any) -> Any:
    return state.unpacked() if isinstance(state, Packed) else state


def _encoded(value: Any, kinds: set[str]) -> Any:
    value = _plain(value)
    if isinstance(value, tuple):
        items = [_encoded(item, kinds) for item in value]
        if not hasattr(value, "_fields"):
            return {"tuple": items}
        name = type(value).__name__
        if name not in kinds:
            raise SnapshotError(f"a state with a {name} in it cannot be saved")
        return {"named": name, "items": items}
    if isinstance(value, np.ndarray):
        kind = f"{value.dtype.kind}{value.dtype.itemsize}"
        if kind not in _KINDS:
            raise SnapshotError(f"a state with an array of {value.dtype} in it cannot be saved")
        return {"array": kind, "shape": list(value.shape), "hex": _bytes_of(value, kind).hex()}
    if isinstance(value, float):
        return {"float": float(value).hex()}
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    raise SnapshotError(f"a state with a {type(value).__name__} in it cannot be saved")


def _bytes_of(array: Any, kind: str) -> bytes:
    return np.ascontiguousarray(array, dtype=_KINDS[kind]).tobytes()


def _decoded(data: Any, kinds: Mapping[str, Any]) -> Any:
    if not isinstance(data, dict):
        if data is None or isinstance(data, bool | int | str):
            return data
        raise TypeError(f"{type(data).__name__} cannot be part of a state")
    if "array" in data:
        array = np.frombuffer(bytes.fromhex(data["hex"]), dtype=_KINDS[data["array"]])
        return array.reshape(data["shape"]).astype(array.dtype.newbyteorder("="))
    if "float" in data:
        return float.fromhex(data["float"])
    if "tuple" in data:
        return tuple(_decoded(item, kinds) for item in data["tuple"])
    return kinds[data["named"]](*(_decoded(item, kinds) for item in data["items"]))


def _is_alike(state: Any, template: Any) -> bool:
    """Return whether a state has the kinds of a template, and arrays of the same shape where that has arrays."""
    state, template = _plain(state), _plain(template)
    if isinstance(template, np.ndarray):
        return isinstance(state, np.ndarray) and state.shape == template.shape
    if isinstance(template, tuple) and hasattr(template, "_fields"):
        is_kind = isinstance(state, tuple) and type(state) is type(template)
        return is_kind and all(_is_alike(*pair) for pair in zip(state, template, strict=True))
    if isinstance(template, tuple) and template:  # an empty one may become any
        is_kind = isinstance(state, tuple) and len(state) == len(template)
        return is_kind and all(_is_alike(*pair) for pair in zip(state, template, strict=True))
    return True
