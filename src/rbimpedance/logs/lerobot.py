"""Data sets of LeRobot: a folder with meta/info.json and Parquet files, several episodes in it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.dataset

from .._common.arrays import Array
from ..exceptions import LogError
from .findings import LogFinding
from .formats import Read, Wanted
from .samples import BILLION, Samples, Stamps, to_stamps

_FEATURES = {
    "position": "observation.state",
    "velocity": "observation.velocity",
    "effort": "observation.effort",
}
_SAME = 0.01  # of a period: a float32 time stamp and the frame's number agree within this


def read(path: Path, wanted: Wanted) -> Read:
    """Return the samples of one episode."""
    source = str(path)
    try:
        info = json.loads((path / "meta" / "info.json").read_text(encoding="utf-8"))
        features: dict[str, Any] = info["features"]
        state = features["observation.state"]
    except (OSError, ValueError, KeyError) as error:
        raise LogError(
            source,
            f"meta/info.json is damaged ({error})",
            "a LeRobot data set has observation.state",
        ) from error
    names = _names(state, source, wanted)
    episode = wanted.episode or 0
    table, episodes = _episode(
        path, [f for f in _FEATURES.values() if f in features], episode, source
    )
    channels = {
        channel: _matrix(table, feature, len(names), source)
        for channel, feature in _FEATURES.items()
        if feature in table.column_names
    }
    findings = []
    if wanted.episode is None and episodes > 1:
        findings.append(LogFinding("episode", f"episode 0 of {episodes}; episode= reads another"))
    return Samples(_stamps(table, info.get("fps")), names, **channels), tuple(findings)


def _episode(path: Path, features: list[str], episode: int, source: str) -> tuple[Any, int]:
    try:
        data = pyarrow.dataset.dataset(path / "data", format="parquet")
        columns = [*features, "timestamp", "frame_index"]
        numbers = data.to_table(columns=["episode_index"]).column(0).unique()
        table = data.to_table(
            columns=columns, filter=pyarrow.dataset.field("episode_index") == episode
        )
    except (pa.ArrowException, OSError) as error:
        raise LogError(
            source,
            f"its Parquet files are damaged ({str(error).splitlines()[0]})",
            "copy the data set again",
        ) from error
    if table.num_rows == 0:
        raise LogError(
            source,
            f"no episode {episode}",
            f"it has {len(numbers)}, from {min(numbers.to_pylist(), default=0)} on",
        )
    return table.sort_by("frame_index"), len(numbers)


def _names(state: dict[str, Any], source: str, wanted: Wanted) -> tuple[str, ...]:
    """Names of the joints, from either form that data sets have them in."""
    names = state.get("names")
    if isinstance(names, dict):
        names = next(iter(names.values()))
    count = int(state["shape"][0])
    if not names or len(names) != count:
        names = wanted.joints
    if not names or len(names) != count:
        raise LogError(source, f"{count} joints without names", f"give joints=, {count} names")
    return tuple(str(name).removesuffix(".pos") for name in names)


def _matrix(table: Any, feature: str, columns: int, source: str) -> Array:
    flat = table.column(feature).combine_chunks().flatten()
    if len(flat) != table.num_rows * columns:
        raise LogError(
            source,
            f"'{feature}' has {len(flat) / table.num_rows:g} numbers a row",
            f"it has {columns}",
        )
    return np.asarray(flat.cast(pa.float64()), dtype=float).reshape(-1, columns)


def _stamps(table: Any, fps: float | None) -> Stamps:
    """Times by the frames' numbers where the stamps, which have seven digits only, agree with them."""
    seconds = np.asarray(table.column("timestamp"), dtype=float)
    if fps:
        frames = np.asarray(table.column("frame_index"), dtype=np.int64)
        if np.abs(seconds * fps - frames).max() < _SAME:
            exact: Stamps = np.round(frames * (BILLION / fps)).astype(np.int64)
            return exact
    return to_stamps(seconds)
