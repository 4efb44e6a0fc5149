"""MCAP files with the messages of ROS 2, which its tools and rosbags open."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from .._common.arrays import Array
from .._common.files import whole_file
from .joint_states import TYPE, with_numbers
from .ros_bags import EXTERNAL_TOPIC, WRENCH_TYPE
from .samples import BILLION, Samples, Stamps

_TYPES = get_typestore(Stores.ROS2_HUMBLE)
_NONE = np.zeros(0)


def write(path: Path, samples: Samples) -> None:
    """Write samples as an MCAP file."""
    with whole_file(path) as file:
        writer = Writer(file)
        writer.start(profile="ros2", library=f"rbimpedance {version('rbimpedance')}")
        joints = [getattr(samples, name) for name in ("position", "velocity", "effort")]
        _add_joints(writer, "/joint_states", samples, joints)
        if samples.external is not None:
            _add_joints(writer, EXTERNAL_TOPIC, samples, [None, None, samples.external])
        if samples.wrench is not None:
            _add(
                writer,
                "/wrench",
                WRENCH_TYPE,
                samples.stamps,
                _wrenches(samples.stamps, samples.wrench),
            )
        writer.finish()  # type: ignore[no-untyped-call]


def _add_joints(writer: Writer, topic: str, samples: Samples, arrays: list[Array | None]) -> None:
    whole = [np.zeros((len(samples.stamps), 0)) if array is None else array for array in arrays]
    example = _TYPES.types[TYPE](
        _header(0), list(samples.joint_names), *(array[0] for array in whole)
    )
    template = bytes(_TYPES.serialize_cdr(example, TYPE))
    _add(
        writer, topic, TYPE, samples.stamps, with_numbers(template, example, samples.stamps, whole)
    )


def _wrenches(stamps: Stamps, rows: Array) -> list[bytes]:
    vector, wrench = (
        _TYPES.types["geometry_msgs/msg/Vector3"],
        _TYPES.types["geometry_msgs/msg/Wrench"],
    )
    messages = []
    for stamp, row in zip(stamps.tolist(), rows.tolist(), strict=True):
        force, torque = vector(*row[:3]), vector(*row[3:])
        message = _TYPES.types[WRENCH_TYPE](_header(stamp), wrench(force, torque))
        messages.append(bytes(_TYPES.serialize_cdr(message, WRENCH_TYPE)))
    return messages


def _header(stamp: int) -> Any:
    time = _TYPES.types["builtin_interfaces/msg/Time"](*divmod(stamp, BILLION))
    return _TYPES.types["std_msgs/msg/Header"](stamp=time, frame_id="")


def _add(writer: Writer, topic: str, kind: str, stamps: Stamps, messages: list[bytes]) -> None:
    definition, _ = _TYPES.generate_msgdef(kind, ros_version=2)
    schema = writer.register_schema(kind, "ros2msg", definition.encode())
    channel = writer.register_channel(topic, "cdr", schema)
    for stamp, message in zip(stamps.tolist(), messages, strict=True):
        writer.add_message(channel, stamp, message, stamp)
