"""`sensor_msgs/JointState` messages as bytes: many of the same layout are read and written at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from .samples import BILLION, Stamps

TYPE = "sensor_msgs/msg/JointState"

CHANNELS = ("position", "velocity", "effort")
"""Arrays of a message, in their order."""

_PREAMBLE = 4  # bytes that say how the message is encoded; alignment counts from after them
_STAMP = 12  # bytes up to the end of the stamp


class Block(NamedTuple):
    """Successive messages with the same joints.

    Attributes:
        names: Names of the joints.
        stamps: Times in the messages, shape (N,) [ns].
        log_times: Times of recording, shape (N,) [ns].
        channels: Those of `CHANNELS` that the messages have, each of shape (N, n).
    """

    names: tuple[str, ...]
    stamps: Stamps
    log_times: Stamps
    channels: dict[str, Array]


class _Layout(NamedTuple):
    """Where in a message the stamps' and arrays' bytes are."""

    size: int
    head: bytes
    names: tuple[str, ...]
    starts: tuple[int, ...]
    lengths: tuple[int, ...]

    def fits(self, raw: bytes) -> bool:
        return len(raw) == self.size and raw[_STAMP : _STAMP + len(self.head)] == self.head


def blocks(
    messages: Iterator[tuple[int, bytes]], decode: Callable[[bytes], Any]
) -> Iterator[Block]:
    """Yield little-endian CDR messages as arrays.

    Args:
        messages: Time of recording [ns] and bytes of each message.
        decode: Makes a message from its bytes; called once per layout.
    """
    layout: _Layout | None = None
    times: list[int] = []
    same: list[bytes] = []
    for log_time, view in messages:
        raw = bytes(view)
        if layout is None or not layout.fits(raw):
            if layout is not None:
                yield _block(layout, times, same)
            layout, times, same = _layout(raw, decode(raw)), [], []
        times.append(log_time)
        same.append(raw)
    if layout is not None:
        yield _block(layout, times, same)


def _layout(raw: bytes, message: Any) -> _Layout:
    at = _STAMP + 4 + len(message.header.frame_id.encode()) + 1
    at = _aligned(at, 4) + 4
    for name in message.name:
        at = _aligned(at, 4) + 4 + len(name.encode()) + 1
    head = raw[_STAMP:at]
    starts = []
    lengths = tuple(len(getattr(message, name)) for name in CHANNELS)
    for length in lengths:
        at = _aligned(at, 4) + 4
        if length:
            at = _aligned(at, 8)
        starts.append(at)
        at += 8 * length
    return _Layout(len(raw), head, tuple(message.name), tuple(starts), lengths)


def _aligned(at: int, to: int) -> int:
    return at + (_PREAMBLE - at) % to


def _block(layout: _Layout, times: Sequence[int], same: Sequence[bytes]) -> Block:
    data = np.frombuffer(b"".join(same), dtype=np.uint8).reshape(len(same), layout.size)
    seconds, nanoseconds = _view(data, 4, 1, "<i4"), _view(data, 8, 1, "<u4")
    stamps = seconds[:, 0].astype(np.int64) * BILLION + nanoseconds[:, 0]
    channels = {
        name: _view(data, start, length, "<f8").astype(float)
        for name, start, length in zip(CHANNELS, layout.starts, layout.lengths, strict=True)
        if length
    }
    return Block(layout.names, stamps, np.array(times, dtype=np.int64), channels)


def _view(data: Any, start: int, count: int, kind: str) -> Any:
    size = count * np.dtype(kind).itemsize
    return np.ascontiguousarray(data[:, start : start + size]).view(kind).reshape(len(data), count)


def with_numbers(
    template: bytes, example: Any, stamps: Stamps, arrays: Sequence[Array]
) -> list[bytes]:
    """Return copies of one message with other stamps and numbers.

    Args:
        template: The message's bytes, little-endian CDR.
        example: The message.
        stamps: Times, shape (N,) [ns].
        arrays: Positions, velocities and efforts, each of shape (N, n) or (N, 0) as in the message.
    """
    layout = _layout(template, example)
    data = np.tile(np.frombuffer(template, dtype=np.uint8), (len(stamps), 1))
    data[:, 4:8] = (stamps // BILLION).astype("<i4")[:, None].view(np.uint8)
    data[:, 8:12] = (stamps % BILLION).astype("<u4")[:, None].view(np.uint8)
    for start, array in zip(layout.starts, arrays, strict=True):
        if array.size:
            raw = np.ascontiguousarray(array, dtype="<f8").view(np.uint8)
            data[:, start : start + raw.shape[1]] = raw
    return [row.tobytes() for row in data]
