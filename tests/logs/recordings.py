"""One recording in the forms that other programs write, none of them by this library."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rbimpedance._common.arrays import Array

JOINTS = ("shoulder", "elbow", "wrist")
RATE = 50
COUNT = 120
TYPES = get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"


def motion() -> dict[str, Array]:
    """A smooth motion with its velocity, and some torque, each of shape (COUNT, 3)."""
    t = np.arange(COUNT)[:, None] / RATE
    phase = np.array([0.0, 1.0, 2.0])
    rng = np.random.default_rng(7)
    return {
        "position": 0.4 * np.sin(2.0 * t + phase),
        "velocity": 0.8 * np.cos(2.0 * t + phase),
        "effort": rng.normal(size=(COUNT, 3)),
    }


def stamps() -> list[int]:
    """Times of the samples [ns]."""
    return [k * 1_000_000_000 // RATE for k in range(COUNT)]


def joint_state(
    ns: int, names: Sequence[str], position: Any, velocity: Any = (), effort: Any = ()
) -> Any:
    """A message."""
    time = TYPES.types["builtin_interfaces/msg/Time"](*divmod(ns, 1_000_000_000))
    header = TYPES.types["std_msgs/msg/Header"](stamp=time, frame_id="base")
    arrays = (np.asarray(array, dtype=float) for array in (position, velocity, effort))
    return TYPES.types[JOINT_STATE](header, list(names), *arrays)


def write_bag(path: Path, messages: Sequence[tuple[str, int, Any]], *, mcap: bool = False) -> Path:
    """Write topic, time of recording and message of each as a rosbag2 folder."""
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for topic, ns, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], ns, TYPES.serialize_cdr(message, kind))
    return path


def bag(path: Path, *, mcap: bool = False) -> Path:
    """The motion as a rosbag2 folder."""
    rows = zip(stamps(), *motion().values(), strict=True)
    return write_bag(
        path, [("/joint_states", ns, joint_state(ns, JOINTS, *row)) for ns, *row in rows], mcap=mcap
    )


def table(path: Path, changes: Mapping[str, Any] | None = None) -> Path:
    """The motion as a CSV file, by the standard library; changes replace or add whole columns."""
    columns: dict[str, Any] = {"time": [ns / 1e9 for ns in stamps()]}
    for channel, array in motion().items():
        columns |= {f"{channel}.{joint}": array[:, i].tolist() for i, joint in enumerate(JOINTS)}
    columns |= changes or {}
    names = [name for name in columns if columns[name] is not None]
    np.random.default_rng(3).shuffle(names)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(zip(*(columns[name] for name in names), strict=True))
    return path


def lerobot(path: Path, *, episodes: int = 2, names: Any = JOINTS) -> Path:
    """The motion as the last episode of a LeRobot data set of version 2.1; the others stand still."""
    features: dict[str, Any] = {
        "observation.state": {"dtype": "float64", "shape": [3], "names": list(names)},
        "observation.velocity": {"dtype": "float64", "shape": [3], "names": None},
        "observation.effort": {"dtype": "float64", "shape": [3], "names": None},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    (path / "meta").mkdir(parents=True)
    (path / "data" / "chunk-000").mkdir(parents=True)
    info = {"codebase_version": "v2.1", "fps": RATE, "features": features}
    (path / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    for episode in range(episodes):
        scale = 1.0 if episode == episodes - 1 else 0.0
        arrays = {name: (scale * array).tolist() for name, array in motion().items()}
        columns = {
            "observation.state": pa.array(arrays["position"], pa.list_(pa.float64(), 3)),
            "observation.velocity": pa.array(arrays["velocity"], pa.list_(pa.float64(), 3)),
            "observation.effort": pa.array(arrays["effort"], pa.list_(pa.float64(), 3)),
            "timestamp": pa.array(np.arange(COUNT, dtype=np.float32) / np.float32(RATE)),
            "frame_index": pa.array(np.arange(COUNT)),
            "episode_index": pa.array(np.full(COUNT, episode)),
        }
        file = path / "data" / "chunk-000" / f"episode_{episode:06d}.parquet"
        pyarrow.parquet.write_table(pa.table(columns), file)
    return path
