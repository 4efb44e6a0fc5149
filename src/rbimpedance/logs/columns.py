"""Names of a table's columns: which channel, which joint, which unit."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from .samples import WRENCH

_CHANNELS = {
    "position": "positions position pos q",
    "velocity": "velocities velocity vel qdot dq qd v",
    "effort": "efforts effort torques torque tau_m tau",
    "external": "external tau_ext ext_torque external_torque",
}
_CHANNEL_OF = {word: name for name, words in _CHANNELS.items() for word in words.split()}
_WORDS = "|".join(sorted(_CHANNEL_OF, key=len, reverse=True))
_BEFORE = re.compile(
    rf"(?P<word>{_WORDS})[._/ ](?P<joint>.+)|(?P<word2>{_WORDS})\[?(?P<number>\d+)\]?",
    re.IGNORECASE,
)
_AFTER = re.compile(rf"(?P<joint>.+)[._/ ](?P<word>{_WORDS})", re.IGNORECASE)
_UNIT = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\])\d][^\])]*)[\])]")
_TIME = re.compile(r"(?:t|time|times|stamp|timestamp)(?:_(?P<unit>ns|us|ms|s))?", re.IGNORECASE)
_SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


class Column(NamedTuple):
    """What a column is.

    Attributes:
        channel: "time" or a channel.
        part: The joint, the component of the wrench, or for the time its unit: "ns", "us", "ms" or "s".
        is_number: Whether the joint is a number and no name.
        unit: The unit that stands in brackets; "" where there is none.
    """

    channel: str
    part: str
    is_number: bool = False
    unit: str = ""


def column(name: str) -> Column | None:
    """Return what a column of this name is, or None if it is none of a log's.

    Args:
        name: As "position.joint1", "joint1_velocity [rad/s]", "tau_3", "t_ns", "wrench.fx".
    """
    unit = ""
    if bracket := _UNIT.fullmatch(name):
        name, unit = bracket["name"], bracket["unit"]
    if time := _TIME.fullmatch(name):
        return Column("time", time["unit"] or (unit if unit in _SECONDS else "s"))
    if name.lower().removeprefix("wrench.") in WRENCH:
        return Column("wrench", name.lower().removeprefix("wrench."))
    if found := _BEFORE.fullmatch(name):
        word, joint = found["word"] or found["word2"], found["joint"] or found["number"]
        return Column(_CHANNEL_OF[word.lower()], joint, joint.isdigit(), unit)
    if found := _AFTER.fullmatch(name):
        return Column(_CHANNEL_OF[found["word"].lower()], found["joint"], unit=unit)
    return None


def known(names: Iterable[str]) -> dict[str, Column]:
    """Return what the columns of a table are, by name; those that are none of a log's are left out."""
    found = ((name, column(name)) for name in names)
    return {name: one for name, one in found if one is not None}
