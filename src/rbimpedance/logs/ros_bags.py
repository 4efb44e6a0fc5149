"""MCAP files and bags of ROS 1 and 2: joint states, and a wrench."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from .._common.arrays import Array
from .._common.suggestions import suggest
from ..exceptions import LogError
from .findings import LogFinding
from .formats import Read, Wanted
from .joint_states import CHANNELS, TYPE, Block, blocks
from .samples import BILLION, Samples, Stamps, to_seconds

WRENCH_TYPE = "geometry_msgs/msg/WrenchStamped"
EXTERNAL_TOPIC = "/external_torque"
"""Topic of joint states whose effort is the environment's torque, as `Log.save` writes it."""

_ONE_CLOCK = 0.1  # s: stamps and times of recording differ by a latency that varies less than this


def read(path: Path, wanted: Wanted) -> Read:
    """Return the samples of a bag."""
    source = str(path)
    folder = (
        path.parent if path.suffix == ".db3" and (path.parent / "metadata.yaml").exists() else path
    )
    try:
        with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            return _read(reader, source, wanted)
    except LogError:
        raise
    except Exception as error:  # each storage has errors of its own
        remedy = (
            "it is truncated or no bag: record it again, or repair it by the tools of its format"
        )
        raise LogError(
            source, f"cannot be read as a bag ({error or type(error).__name__})", remedy
        ) from error


def _read(reader: AnyReader, source: str, wanted: Wanted) -> Read:
    findings: list[LogFinding] = []
    topics = _topics(reader, source, wanted)
    found = list(_blocks(reader, topics["joints"]))
    if not found:
        raise LogError(source, f"no message on '{topics['joints']}'", "record the joints' states")
    names = wanted.joints or _usual_names(found)
    joined = _joined(found, names, source, findings)
    stamps = _one_clock(joined, findings)
    channels = dict(joined.channels)
    if "position" not in channels:
        remedy = "a log needs the joints' positions"
        raise LogError(source, f"'{topics['joints']}' has no positions", remedy)
    if "external" in topics:
        external = _joined(list(_blocks(reader, topics["external"])), names, source, findings)
        torque = external.channels["effort"]
        channels["external"] = _held(stamps, external.stamps, torque, "external", findings)
    if "wrench" in topics:
        times, wrench = _wrenches(reader, topics["wrench"])
        channels["wrench"] = _held(stamps, times, wrench, "wrench", findings)
    return Samples(stamps, names, **channels), tuple(findings)


def _topics(reader: AnyReader, source: str, wanted: Wanted) -> dict[str, str]:
    """The topics to read, by what they hold."""
    by_type: dict[str, list[str]] = {TYPE: [], WRENCH_TYPE: []}
    for connection in reader.connections:
        topics = by_type.get(connection.msgtype, [])
        if connection.topic not in topics:
            topics.append(connection.topic)
    joints = [topic for topic in by_type[TYPE] if topic != EXTERNAL_TOPIC]
    chosen = dict(wanted.topics)
    for topic in chosen.values():
        if topic not in reader.topics:
            raise LogError(
                source, f"no topic '{topic}'", f"name another{suggest(topic, reader.topics)}"
            )
    if "joints" not in chosen and len(joints) != 1:
        problem = f"{len(joints)} topics with joint states"
        there = ", ".join(f"'{topic}'" for topic in joints or reader.topics)
        raise LogError(source, problem, f'choose by topics={{"joints": ...}}; there are: {there}')
    if "wrench" not in chosen and len(by_type[WRENCH_TYPE]) > 1:
        there = ", ".join(f"'{topic}'" for topic in by_type[WRENCH_TYPE])
        raise LogError(
            source,
            "several topics with wrenches",
            f'choose by topics={{"wrench": ...}}; there are: {there}',
        )
    usual = {"joints": joints[:1], "wrench": by_type[WRENCH_TYPE]}
    usual["external"] = [topic for topic in by_type[TYPE] if topic == EXTERNAL_TOPIC]
    return {kind: topics[0] for kind, topics in usual.items() if topics} | chosen


def _blocks(reader: AnyReader, topic: str) -> Iterator[Block]:
    connections = [c for c in reader.connections if c.topic == topic and c.msgtype == TYPE]
    if reader.is2:
        raws = ((time, raw) for _, time, raw in reader.messages(connections))
        yield from blocks(raws, lambda raw: reader.deserialize(raw, TYPE))
        return
    for _, time, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, TYPE)
        arrays = {name: np.array([getattr(message, name)], dtype=float) for name in CHANNELS}
        channels = {name: array for name, array in arrays.items() if array.size}
        stamps = np.array([_nanoseconds(message)])
        yield Block(tuple(message.name), stamps, np.array([time]), channels)


def _usual_names(found: list[Block]) -> tuple[str, ...]:
    """The joints that most messages have, in the order of the first of them."""
    counts: Counter[frozenset[str]] = Counter()
    for block in found:
        counts[frozenset(block.names)] += len(block.stamps)
    usual = counts.most_common(1)[0][0]
    return next(block.names for block in found if frozenset(block.names) == usual)


def _joined(
    found: list[Block], names: tuple[str, ...], source: str, findings: list[LogFinding]
) -> Block:
    """One block with the named joints in their order, of all messages that have them."""
    whole = [block for block in found if set(names) <= set(block.names)]
    if not whole:
        missing = sorted(set(names) - set(found[0].names))
        raise LogError(
            source,
            f"no message has '{missing[0]}'",
            f"name other joints{suggest(missing[0], found[0].names)}",
        )
    partial = sum(len(block.stamps) for block in found) - sum(len(block.stamps) for block in whole)
    if partial:
        findings.append(
            LogFinding("partial", f"{partial} message(s) without all of these joints: left out")
        )
    if any(block.names != whole[0].names for block in whole):
        findings.append(
            LogFinding("order", "messages have their joints in different orders: sorted by name")
        )
    there = {name for block in whole for name in block.channels}
    channels = {
        name: np.concatenate([_channel(block, name, names) for block in whole]) for name in there
    }
    stamps = np.concatenate([block.stamps for block in whole])
    return Block(names, stamps, np.concatenate([block.log_times for block in whole]), channels)


def _channel(block: Block, name: str, names: tuple[str, ...]) -> Array:
    """A channel of the named joints; NaN where these messages do not have it, but others do."""
    if name not in block.channels:
        return np.full((len(block.stamps), len(names)), np.nan)
    return block.channels[name][:, [block.names.index(joint) for joint in names]]


def _one_clock(joined: Block, findings: list[LogFinding]) -> Stamps:
    """The messages' own times; those of recording where they have none."""
    if not joined.stamps.any():
        findings.append(
            LogFinding("clocks", "messages have no time stamps: times of recording are used")
        )
        return joined.log_times
    latency = joined.log_times - joined.stamps
    spread = to_seconds(int(latency.max() - latency.min()))
    if spread > _ONE_CLOCK:
        words = (
            f"time stamps and times of recording drift apart by {spread:.3g} s: the stamps are used"
        )
        findings.append(LogFinding("clocks", words))
    return joined.stamps


def _wrenches(reader: AnyReader, topic: str) -> tuple[Stamps, Array]:
    times, rows = [], []
    connections = [c for c in reader.connections if c.topic == topic]
    for _, log_time, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, WRENCH_TYPE)
        force, torque = message.wrench.force, message.wrench.torque
        times.append(_nanoseconds(message) or log_time)
        rows.append((force.x, force.y, force.z, torque.x, torque.y, torque.z))
    return np.array(times, dtype=np.int64), np.array(rows, dtype=float).reshape(-1, 6)


def _nanoseconds(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * BILLION + int(stamp.nanosec)


def _held(
    stamps: Stamps, times: Stamps, rows: Array, name: str, findings: list[LogFinding]
) -> Array:
    """The latest row at each sample; the first one before there is any."""
    if len(times) == 0:
        return np.full((len(stamps), rows.shape[1]), np.nan)
    if np.array_equal(stamps, times):
        return rows
    latest = np.maximum(np.searchsorted(times, stamps, side="right") - 1, 0)
    age = to_seconds(int(np.abs(stamps - times[latest]).max()))
    findings.append(
        LogFinding(
            "held",
            f"{name} has times of its own: its latest value is held, at most {age:.3g} s old",
        )
    )
    return rows[latest]
