"""Whether a run lost its arm, and the one sentence why."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from .._common.arrays import Array, BoolArray
from .violations import Logged, excess, unit_of

LARGE, LARGEST = 0.05, 0.5
"""Error that is large where the reference is constant, and where it moves far [rad or m]."""

SHARE = 0.25
"""Part of the range of a joint's reference by which `LARGE` grows."""

FALLING = 0.8
"""An error falls if it is below this part of what it was a quarter of the run before."""

BEYOND = 0.01
"""Distance beyond a position limit that a joint may have, as on a stop that yields [rad or m]."""

_ROUNDING = 1e-6  # of torques at their limit, relative
_FEWEST_SAMPLES = 8  # in which an error can be said to fall


class Finding(NamedTuple):
    """One reason for which a run has lost its arm.

    Attributes:
        kind: "divergence", "position", "error" or "effort".
        joint: Name of the joint that is worst.
        time: When it began, for the error the end of the run [s].
        size: Speed, distance beyond the limit, error, or torque beyond the limit.
        words: The same as part of a sentence.
    """

    kind: Literal["divergence", "position", "error", "effort"]
    joint: str
    time: float
    size: float
    words: str


@dataclass(frozen=True)
class Verdict:
    """Whether a run lost its arm. As text it is one sentence.

    Attributes:
        findings: The reasons, the gravest first; none where the arm was not lost.
        error: Largest root-mean-square error of any joint in the last quarter of the run [rad or m].
    """

    findings: tuple[Finding, ...]
    error: float

    @property
    def lost(self) -> bool:
        """Whether there is a reason."""
        return bool(self.findings)

    def __str__(self) -> str:
        if not self.lost:
            return f"within its limits; its error is {self.error:.2g} rad or m in the last quarter"
        return "lost: " + " and ".join(finding.words for finding in self.findings)


def verdict_of(result: Logged) -> Verdict:
    """Return whether a run lost its arm; see `SimulationResult.verdict` for the definition."""
    sizes = _errors_by_quarter(result)
    findings = (*_divergence(result), *_position(result), *_error(result, sizes), *_effort(result))
    return Verdict(findings, float(sizes[-1].max()))


def growth(result: Logged) -> Array:
    """Return the error of the last quarter relative to that of the one before, shape (nv,); 1 where both are zero."""
    before, last = _errors_by_quarter(result)[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: Array = np.where(last == before, 1.0, last / before)
    return ratio


def _divergence(result: Logged) -> Iterator[Finding]:
    mark = result.provenance.get("diverged")
    if mark is not None:
        time, joint = float(mark["time"]), str(mark["joint"])
        speed = float(np.abs(result.v[-1]).max())
        words = f"joint '{joint}' left every sensible range after {time:.4g} s"
        yield Finding("divergence", joint, time, speed, words)


def _position(result: Logged) -> Iterator[Finding]:
    """A joint farther beyond its limit than `BEYOND`, and than it began."""
    beyond = excess(result).position
    over = beyond - BEYOND - np.maximum(beyond[0], 0.0)
    if over.max() > 0.0:
        joint = int(np.argmax(over.max(axis=0)))
        size, time = float(beyond[:, joint].max()), _first(result, over[:, joint] > 0.0)
        name, unit = result.joint_names[joint], unit_of(result, joint)
        words = f"joint '{name}' was {size:.3g} {unit} beyond its position limit, from {time:.3g} s"
        yield Finding("position", name, time, size, words)


def _error(result: Logged, sizes: Array) -> Iterator[Finding]:
    """An error that is large in the last quarter, and does not fall."""
    if len(result.t) < _FEWEST_SAMPLES:
        return
    large = np.minimum(LARGE + SHARE * _range_of_reference(result), LARGEST)
    stays = ~(sizes[-1] < FALLING * sizes[-2])  # NaN stays
    over = np.where(stays & ~(sizes[-1] <= large), sizes[-1] / large, 0.0)
    if over.max() > 0.0 or np.isnan(over).any():
        joint = int(np.argmax(over))
        size, name = float(sizes[-1, joint]), result.joint_names[joint]
        grows = "grows" if sizes[-1, joint] > 1.05 * sizes[-2, joint] else "stays"
        words = (
            f"joint '{name}' is {abs(result.e1[-1, joint]):.3g} {unit_of(result, joint)} from its reference, "
            f"and that {grows}"
        )
        yield Finding("error", name, float(result.t[-1]), size, words)


def _effort(result: Logged) -> Iterator[Finding]:
    """A torque beyond what the motor can give."""
    over = excess(result).effort
    limit = np.where(np.isfinite(over), np.abs(result.tau) - over, np.inf)[0]
    share = np.where(np.isfinite(over), over, 0.0) / limit
    if share.max() > _ROUNDING:
        joint = int(np.argmax(share.max(axis=0)))
        size, time = float(over[:, joint].max()), _first(result, share[:, joint] > _ROUNDING)
        name, force = result.joint_names[joint], "N" if unit_of(result, joint) == "m" else "N·m"
        words = (
            f"the torque of joint '{name}' passed its limit {limit[joint]:.4g} {force} by {size:.3g}, "
            f"from {time:.3g} s"
        )
        yield Finding("effort", name, time, size, words)


def _errors_by_quarter(result: Logged) -> Array:
    """Root-mean-square e1 of each quarter of the run, shape (4, nv)."""
    quarters = np.array_split(result.e1, 4)
    return np.array(
        [np.sqrt(np.mean((part if len(part) else result.e1) ** 2, axis=0)) for part in quarters]
    )


def _range_of_reference(result: Logged) -> Array:
    """How far the reference of each joint goes, shape (nv,), by its velocity v + e2."""
    way = np.cumsum((result.v + result.e2)[:-1] * np.diff(result.t)[:, None], axis=0)
    span: Array = np.maximum(way.max(axis=0), 0.0) - np.minimum(way.min(axis=0), 0.0)
    return span


def _first(result: Logged, happens: BoolArray) -> float:
    return float(result.t[np.argmax(happens)])
