"""The npz file of a `SimulationResult`."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._common.files import whole_file
from ..control.telemetry import CHANNELS
from ..exceptions import ModelError
from . import tool_log

FORMAT = 2

UNITS = {channel.name: channel.unit for channel in CHANNELS} | {
    tool_log.PREFIX + name: unit for name, unit in tool_log.UNITS.items()
}
"""Unit of every channel."""


class Content(NamedTuple):
    """What a file holds.

    Attributes:
        arrays: Channels by name; those that the version which wrote it did not log are missing.
        provenance: What produced the result.
    """

    arrays: dict[str, Any]
    provenance: Mapping[str, Any]


def write(path: str | os.PathLike[str], content: Content) -> Path:
    """Write a result; the file appears whole or not at all.

    Args:
        path: Where to; ".npz" is appended where the name has no such ending.
        content: What to write.

    Returns:
        The path that was written.
    """
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    units = {name: UNITS[name] for name in content.arrays}
    header = {"format": FORMAT, "units": units, "provenance": content.provenance}
    with whole_file(target) as file:
        np.savez_compressed(file, header=np.array(json.dumps(header)), **content.arrays)
    return target


def read(path: str | os.PathLike[str]) -> Content:
    """Read a result.

    Raises:
        ModelError: The file is missing, damaged, or not a result of this library.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            if header["format"] != FORMAT:
                raise ModelError(
                    f"'{path}' has result format {header['format']}; this version reads {FORMAT}"
                )
            written = set(header["units"]) & set(UNITS)
            return Content({name: archive[name] for name in written}, header["provenance"])
    except FileNotFoundError as error:
        raise ModelError(f"no result file '{path}'") from error
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(
            f"'{path}' is not a complete result file written by SimulationResult.save"
        ) from error


def with_unknown(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Add the channels that a file does not hold: NaN, and False for flags.

    Args:
        arrays: What it holds.
    """
    samples, nq, nv = len(arrays["t"]), arrays["q"].shape[1], arrays["v"].shape[1]
    unknown = {c.name: c.empty(samples, nq, nv) for c in CHANNELS if c.name not in arrays}
    return dict(arrays) | {
        name: x if x.dtype == np.bool_ else np.full_like(x, np.nan) for name, x in unknown.items()
    }
