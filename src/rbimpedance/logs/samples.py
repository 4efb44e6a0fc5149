"""Samples as a reader hands them on: one row a sample, one column a joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._common.arrays import Array

Stamps: TypeAlias = NDArray[np.int64]
"""Times of samples [ns]."""

JOINT_CHANNELS = ("position", "velocity", "effort", "external")
"""Channels with a column per joint."""

CHANNELS = (*JOINT_CHANNELS, "wrench")
"""All channels."""

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
"""Columns of `wrench`."""

BILLION = 1_000_000_000


class Samples(NamedTuple):
    """Samples of one recording; see `Log` for the channels.

    Attributes:
        stamps: Times, shape (N,) [ns].
        joint_names: Names of the n joints, in the order of the columns.
        position: Shape (N, n).
        velocity: Shape (N, n), or None where it was not measured; and so on.
        effort: Shape (N, n).
        external: Shape (N, n).
        wrench: Shape (N, 6).
    """

    stamps: Stamps
    joint_names: tuple[str, ...]
    position: Array
    velocity: Array | None = None
    effort: Array | None = None
    external: Array | None = None
    wrench: Array | None = None

    def channels(self) -> Iterator[tuple[str, Array]]:
        """Yield the channels that there are, by name."""
        for name in CHANNELS:
            array = getattr(self, name)
            if array is not None:
                yield name, array

    def columns(self, name: str) -> tuple[str, ...]:
        """Return what the columns of a channel are."""
        return WRENCH if name == "wrench" else self.joint_names

    def label(self, name: str, column: int) -> str:
        """Return a column of a channel in words."""
        of = "" if name == "wrench" else "of joint "
        return f"{name} {of}'{self.columns(name)[column]}'"

    def at(self, rows: Any) -> Samples:
        """Return some of the samples.

        Args:
            rows: Which: indices, a mask or a slice.
        """
        kept: dict[str, Any] = {name: array[rows] for name, array in self.channels()}
        return self._replace(stamps=self.stamps[rows], **kept)

    def of(self, columns: Sequence[int]) -> Samples:
        """Return some of the joints, in the order of their indices.

        Args:
            columns: Their indices.
        """
        names = tuple(self.joint_names[i] for i in columns)
        kept: dict[str, Any] = {
            name: np.ascontiguousarray(array[:, columns])
            for name, array in self.channels()
            if name in JOINT_CHANNELS
        }
        return self._replace(joint_names=names, **kept)


def to_stamps(t: Array) -> Stamps:
    """Return times in whole nanoseconds, the nearest ones.

    Args:
        t: Times [s].
    """
    stamps: Stamps = np.round(t * BILLION).astype(np.int64)
    return stamps


def to_seconds(stamps: Any) -> Any:
    """Return the numbers nearest to times in nanoseconds [s].

    Args:
        stamps: Times or their differences [ns].
    """
    return stamps / BILLION
