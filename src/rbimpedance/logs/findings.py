"""What is wrong with the samples of a log: an error where it would be a guess, a finding where it is known."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from ..exceptions import LogError
from .samples import Samples, Stamps, to_seconds

GAP = 2.5
"""Distance of two samples that is a gap, in median periods."""

DEGREE = 180.0 / np.pi
_NEAR_A_DEGREE = 0.1  # relative distance of a ratio from `DEGREE` that is the unit, not the robot
_MOVING = 1e-3  # rad/s or m/s: joints slower than this say nothing about units


class LogFinding(NamedTuple):
    """What a reader found and did, or left as it is.

    Attributes:
        kind: "gap", "duplicate", "missing", "order", "partial", "invalid", "clocks", "held", "unit", "limit" or
            "episode".
        words: What was found, where, and what was done.
    """

    kind: str
    words: str


def checked(
    samples: Samples, source: str, *, drop_invalid: bool = False
) -> tuple[Samples, tuple[LogFinding, ...]]:
    """Return the samples without duplicates and channels that were not measured, and what was found.

    Args:
        samples: As they were read.
        source: Where from, for messages.
        drop_invalid: Leave out samples that hold NaN or infinity, which are an error otherwise.

    Raises:
        LogError: Fewer than two samples, time that goes back, NaN or infinity, or units that do not fit together.
    """
    findings: list[LogFinding] = []
    samples = _without_empty_channels(samples, source, findings)
    samples = _without_invalid(samples, source, drop_invalid, findings)
    _check_clock(samples.stamps, source)
    samples = _without_duplicates(samples, findings)
    if len(samples.stamps) < 2:
        raise LogError(source, f"{len(samples.stamps)} sample(s)", "a log has at least two")
    _check_units(samples, source)
    findings += _gaps(samples.stamps)
    return samples, tuple(findings)


def _without_empty_channels(samples: Samples, source: str, findings: list[LogFinding]) -> Samples:
    empty: dict[str, Any] = {
        name: None for name, array in samples.channels() if array.size == 0 or np.isnan(array).all()
    }
    if "position" in empty:
        raise LogError(source, "no position in any sample", "a log needs the joints' positions")
    findings += [LogFinding("missing", f"{name} was not measured: left out") for name in empty]
    return samples._replace(**empty)


def _without_invalid(
    samples: Samples, source: str, drop_invalid: bool, findings: list[LogFinding]
) -> Samples:
    valid = np.ones(len(samples.stamps), dtype=bool)
    for name, array in samples.channels():
        is_finite = np.isfinite(array)
        if not drop_invalid and not is_finite.all():
            row, column = np.argwhere(~is_finite)[0]
            where = f"{samples.label(name, int(column))} at sample {row}"
            raise LogError(
                source,
                f"{where} is {array[row, column]}",
                "repair or cut the file, or give drop_invalid=True to leave such samples out",
            )
        valid &= is_finite.all(axis=1)
    if valid.all():
        return samples
    findings.append(
        LogFinding("invalid", f"{np.count_nonzero(~valid)} sample(s) with NaN or infinity left out")
    )
    return samples.at(valid)


def _check_clock(stamps: Stamps, source: str) -> None:
    steps = np.diff(stamps)
    back = np.flatnonzero(steps < 0)
    if len(back):
        size = to_seconds(-int(steps[back[0]]))
        raise LogError(
            source,
            f"time goes back by {size:g} s after sample {back[0]} ({len(back)} time(s) in all)",
            "cut the file there: it holds several recordings, or its clock was set",
        )


def _without_duplicates(samples: Samples, findings: list[LogFinding]) -> Samples:
    again = np.concatenate([[False], np.diff(samples.stamps) == 0])
    if not again.any():
        return samples
    rows = np.flatnonzero(again)
    differ = sum(
        any(not np.array_equal(array[k], array[k - 1]) for _, array in samples.channels())
        for k in rows
    )
    words = f"{len(rows)} sample(s) have the time of the one before: left out"
    if differ:
        words += f", although {differ} of them differ from it"
    findings.append(LogFinding("duplicate", words))
    return samples.at(~again)


def _gaps(stamps: Stamps) -> Iterator[LogFinding]:
    steps = np.diff(stamps)
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * median)
    if len(gaps):
        largest = int(np.argmax(steps))
        start = to_seconds(int(stamps[largest] - stamps[0]))
        words = (
            f"{len(gaps)} gap(s) of more than {GAP:g} periods; the largest is {to_seconds(int(steps[largest])):g} s, "
            f"from t = {start:g} s"
        )
        yield LogFinding("gap", words)


def _check_units(samples: Samples, source: str) -> None:
    """Positions and velocities in different units differ by a factor of 57.3."""
    if samples.velocity is None:
        return
    ratio = _slope(np.diff(samples.position, axis=0), samples)
    for unit, factor in (("positions", DEGREE), ("velocities", 1.0 / DEGREE)):
        wrong = np.abs(ratio / factor - 1.0) < _NEAR_A_DEGREE
        if wrong.any():
            joint = samples.joint_names[int(np.argmax(wrong))]
            raise LogError(
                source,
                f"{unit} look like degrees: joint '{joint}' moves by {ratio[wrong][0]:.3g} times the integral of its "
                "velocity",
                'convert them to rad, or give unit="deg" where positions and velocities both are in degrees',
            )


def _slope(moved: Array, samples: Samples) -> Array:
    """Least-squares ratio of what each joint moved by to the integral of its velocity, shape (n,); NaN at rest."""
    assert samples.velocity is not None
    periods = np.diff(samples.stamps)[:, None] * 1e-9
    integral = (samples.velocity[1:] + samples.velocity[:-1]) / 2.0 * periods
    moving = (np.abs(samples.velocity) > _MOVING).any(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope: Array = (moved * integral).sum(axis=0) / (integral**2).sum(axis=0)
    return np.where(moving, slope, np.nan)
