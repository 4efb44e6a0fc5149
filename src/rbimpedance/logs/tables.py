"""CSV and Parquet: one row a sample, one column a number; names of columns say what they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from .._common.arrays import Array
from .._common.files import whole_file
from ..exceptions import LogError
from .columns import Column, known
from .findings import DEGREE, LogFinding
from .formats import Read, Wanted
from .samples import JOINT_CHANNELS, WRENCH, Samples, Stamps

_NANOSECONDS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}


def read(path: Path, wanted: Wanted) -> Read:
    """Return the samples of a CSV or Parquet file."""
    return samples_of(open_table(path), str(path), wanted)


def open_table(path: Path) -> Any:
    """Return a file as an Arrow table.

    Raises:
        LogError: It is damaged.
    """
    try:
        if path.suffix == ".parquet":
            return pyarrow.parquet.read_table(path)
        return pyarrow.csv.read_csv(path)
    except (pa.ArrowException, OSError, ValueError) as error:
        problem = f"not a whole {path.suffix[1:]} file ({str(error).splitlines()[0]})"
        raise LogError(
            str(path), problem, "write it again, or cut it after its last whole row"
        ) from error


def samples_of(table: Any, source: str, wanted: Wanted) -> Read:
    """Return the samples of an Arrow table.

    Args:
        table: The table.
        source: Where it is from, for messages.
        wanted: What to look for.

    Raises:
        LogError: Columns are missing, ambiguous, or no numbers.
    """
    if "observation.state" in table.column_names:
        raise LogError(
            source, "a file of a LeRobot data set", "give its folder, which has meta/info.json"
        )
    if len(set(table.column_names)) < len(table.column_names):
        raise LogError(source, "two columns have the same name", "give each its own")
    columns = known(table.column_names)
    if not any(one.channel == "position" for one in columns.values()):
        remedy = 'name them "position.JOINT", "velocity.JOINT", "effort.JOINT"'
        raise LogError(
            source, f"no column is a position: {', '.join(table.column_names[:12])}", remedy
        )
    stamps = _stamps(table, columns, source)
    names = _joints(columns, source, wanted)
    findings: list[LogFinding] = []
    channels = {
        channel: _channel(table, columns, channel, names, source, findings)
        for channel in JOINT_CHANNELS
        if any(one.channel == channel for one in columns.values())
    }
    wrench = {one.part: name for name, one in columns.items() if one.channel == "wrench"}
    if wrench and set(wrench) != set(WRENCH):
        raise LogError(
            source,
            f"a wrench without {', '.join(sorted(set(WRENCH) - set(wrench)))}",
            "it has six columns",
        )
    if wrench:
        channels["wrench"] = np.stack(
            [_numbers(table, wrench[part], source) for part in WRENCH], axis=1
        )
    unknown = [name for name in table.column_names if name not in columns]
    if unknown:
        findings.append(LogFinding("missing", f"column(s) not read: {', '.join(unknown[:12])}"))
    return Samples(stamps, names, **channels), tuple(findings)


def write(path: Path, samples: Samples) -> None:
    """Write samples as a CSV or Parquet file."""
    arrays: dict[str, Any] = {"time_ns": samples.stamps}
    for name, array in samples.channels():
        arrays |= {f"{name}.{part}": array[:, i] for i, part in enumerate(samples.columns(name))}
    table = pa.table(arrays)
    with whole_file(path) as file:
        if path.suffix == ".parquet":
            pyarrow.parquet.write_table(table, file)
        else:
            pyarrow.csv.write_csv(table, file)


def _stamps(table: Any, columns: dict[str, Column], source: str) -> Stamps:
    times = {name: one.part for name, one in columns.items() if one.channel == "time"}
    if len(times) != 1:
        problem = (
            f"several columns are times: {', '.join(times)}" if times else "no column is the time"
        )
        raise LogError(
            source,
            problem,
            'one column is "t", "time" or "timestamp" in s, or ends in _ns, _us, _ms',
        )
    ((name, unit),) = times.items()
    column = table.column(name)
    if pa.types.is_timestamp(column.type):
        column, unit = column.cast(pa.timestamp("ns")).cast(pa.int64()), "ns"
    if column.null_count:
        row = int(np.argmax(column.is_null().to_numpy()))
        raise LogError(source, f"'{name}' is empty in row {row + 1}", "each row has a time")
    if pa.types.is_integer(column.type):
        return np.asarray(column.to_numpy(), dtype=np.int64) * _NANOSECONDS[unit]
    seconds = _numbers(table, name, source)
    stamps: Stamps = np.round(seconds * _NANOSECONDS[unit]).astype(np.int64)
    return stamps


def _joints(columns: dict[str, Column], source: str, wanted: Wanted) -> tuple[str, ...]:
    positions = [one for one in columns.values() if one.channel == "position"]
    if not any(one.is_number for one in positions):
        return tuple(one.part for one in positions)
    count = len(positions)
    if wanted.joints is None or len(wanted.joints) != count:
        raise LogError(
            source,
            f"{count} columns are numbered, not named",
            f"give joints=, {count} names in that order",
        )
    return wanted.joints


def _channel(
    table: Any,
    columns: dict[str, Column],
    channel: str,
    names: tuple[str, ...],
    source: str,
    findings: list[LogFinding],
) -> Array:
    found = {one.part: (name, one) for name, one in columns.items() if one.channel == channel}
    if all(one.is_number for _, one in found.values()):
        numbers = sorted(found, key=int)
        found = {joint: found[number] for joint, number in zip(names, numbers, strict=False)}
    if missing := [joint for joint in names if joint not in found]:
        raise LogError(
            source, f"{channel} of '{missing[0]}' is missing", "each channel has a column per joint"
        )
    arrays = []
    for joint in names:
        name, one = found[joint]
        array = _numbers(table, name, source)
        if one.unit.startswith("deg"):
            findings.append(LogFinding("unit", f"'{name}' converted from degrees"))
            array = array / DEGREE
        arrays.append(array)
    return np.stack(arrays, axis=1)


def _numbers(table: Any, name: str, source: str) -> Array:
    try:
        array: Array = table.column(name).cast(pa.float64()).to_numpy()
    except pa.ArrowException as error:
        raise LogError(
            source,
            f"column '{name}' is not of numbers ({table.schema.field(name).type})",
            "write numbers",
        ) from error
    return array
