"""Whether a run failed, and the one sentence why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from .._common.arrays import Array, BoolArray
from .._common.deprecation import renamed_attribute
from ..robot.units import joined
from .chatter import chatters, ripple_of
from .run_log import RunLog
from .violations import excess, force_unit_of, unit_of

LARGE, LARGEST = {"rad": 0.05, "m": 0.01}, 0.5
"""Error that is large where the reference is constant, by unit, and where it moves far [rad or m]."""

SHARE = 0.1
"""Part of the range of a joint's reference by which `LARGE` grows."""

FALLING = 0.8
"""An error falls if it is below this part of what it was a quarter of the run before."""

BEYOND = 0.01
"""Distance beyond a position limit that a joint may have, as on a stop that yields [rad or m]."""

DEVIATION, SHARE_OF_DEVIATION = {"rad": 0.1, "m": 0.02}, 0.25
"""Deviation that may be passed through: this much where the reference rests, by unit, and a part of its range."""

AT_THE_START = 1.5, 0.5
"""Factors on the error at the start, and on its rate [s], by which `DEVIATION` grows."""

SATURATED = 0.1
"""Share of the ticks after the start in which a joint may be at its torque limit."""

_ARRIVED, _LATEST_START = 0.1, 0.5  # shares of the error at the start, and of the run
_ROUNDING = 1e-6  # of torques at their limit, relative
_FEWEST_SAMPLES = 8  # in which an error can be said to fall


Kind: TypeAlias = Literal[
    "divergence", "position", "error", "deviation", "effort", "saturation", "chatter"
]


class Finding(NamedTuple):
    """One reason for which a run has failed.

    Attributes:
        kind: "divergence", "position", "error", "deviation", "effort", "saturation" or "chatter".
        joint: Name of the joint that is worst; "tool" for an error of the pose.
        time: When it began; for the error the end of the run, for the deviation when it was largest [s].
        size: Speed, distance beyond the limit, error, largest error, torque beyond the limit, share of the ticks, or
            root-mean-square of the torque's ripple.
        words: The same as part of a sentence.
    """

    kind: Kind
    joint: str
    time: float
    size: float
    words: str


@dataclass(frozen=True)
class Verdict:
    """Whether a run failed. As text it is one sentence.

    Attributes:
        findings: The reasons, the gravest first; none where the run did not fail.
        error: Largest root-mean-square error of any joint in the last quarter of the run [rad or m].
        tool: That of the tool's translation and rotation [m, rad]; None for a run without `tool`.
        unit: Unit of `error`: "rad", "m", or "rad or m" for an arm with both kinds of joints.
    """

    findings: tuple[Finding, ...]
    error: float
    tool: tuple[float, float] | None = None
    unit: str = "rad or m"

    @property
    def failed(self) -> bool:
        """Whether there is a reason."""
        return bool(self.findings)

    def __bool__(self) -> bool:
        """Whether the run did not fail."""
        return not self.failed

    lost = renamed_attribute("lost", "failed")

    def __str__(self) -> str:
        if not self.failed:
            size = f"{self.error:.2g} {self.unit}"
            if self.tool is not None:
                size = "{:.2g} m and {:.2g} rad at the tool".format(*self.tool)
            return f"within its limits; its rms error is {size} in the last quarter"
        return "failed: " + " and ".join(finding.words for finding in self.findings)


def verdict_of(result: RunLog) -> Verdict:
    """Return whether a run failed; see `SimulationResult.verdict` for the definition."""
    sizes, start = _errors_by_quarter(result), _end_of_start(result)
    errors = tuple(_tool(result)) or tuple(_error(result, sizes)) or tuple(_deviation(result))
    findings = (
        *(*_divergence(result), *_position(result), *errors, *_effort(result)),
        *(*_saturation(result, start), *_chatter(result, start)),
    )
    unit = joined(unit_of(result, i) for i in range(len(result.joint_names)))
    return Verdict(findings, float(sizes[-1].max()), _tool_error(result), unit)


def growth(result: RunLog) -> Array:
    """Return the error of the last quarter relative to that of the one before, shape (nv,); 1 where both are zero."""
    before, last = _errors_by_quarter(result)[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: Array = np.where(last == before, 1.0, last / before)
    return ratio


def _divergence(result: RunLog) -> Iterator[Finding]:
    mark = result.provenance.get("diverged")
    if mark is not None:
        time, joint = float(mark["time"]), str(mark["joint"])
        speed = float(np.abs(result.v[-1]).max())
        words = f"joint '{joint}' left every sensible range after {time:.4g} s"
        yield Finding("divergence", joint, time, speed, words)


def _position(result: RunLog) -> Iterator[Finding]:
    """A joint farther beyond its limit than `BEYOND`, and than it began."""
    beyond = excess(result).position
    over = beyond - BEYOND - np.maximum(beyond[0], 0.0)
    if over.max() > 0.0:
        joint = int(np.argmax(over.max(axis=0)))
        size, time = float(beyond[:, joint].max()), _first(result, over[:, joint] > 0.0)
        name, unit = result.joint_names[joint], unit_of(result, joint)
        words = f"joint '{name}' was {size:.3g} {unit} beyond its position limit, from {time:.3g} s"
        if not {"joint_stops", "engine"} & result.provenance.keys():
            words += " (the simulated arm has no stops: joint_stops=True gives it some)"
        yield Finding("position", name, time, size, words)


def _error(result: RunLog, sizes: Array) -> Iterator[Finding]:
    """An error that is large in the last quarter, and does not fall."""
    if len(result.t) < _FEWEST_SAMPLES:
        return
    large = np.minimum(_by_unit(result, LARGE) + SHARE * _range_of_reference(result), LARGEST)
    large += _yields(result)
    stays = ~(sizes[-1] < FALLING * sizes[-2])  # NaN stays
    over = np.where(stays & ~(sizes[-1] <= large), sizes[-1] / large, 0.0)
    if over.max() > 0.0 or np.isnan(over).any():
        joint = int(np.argmax(over))
        size, name = float(sizes[-1, joint]), result.joint_names[joint]
        words = (
            f"joint '{name}' is {abs(result.e1[-1, joint]):.3g} {unit_of(result, joint)} from its reference, "
            "and that does not fall"
        )
        yield Finding("error", name, float(result.t[-1]), size, words)


def _tool(result: RunLog) -> Iterator[Finding]:
    """A pose error that is large in the last quarter, and does not fall; joints have none near a singularity."""
    if result.tool is None or len(result.t) < _FEWEST_SAMPLES:
        return
    for columns, unit in ((slice(0, 3), "m"), (slice(3, 6), "rad")):
        error = np.linalg.norm(result.tool.e1[:, columns], axis=1)
        before, last = (np.sqrt(np.mean(x**2)) for x in np.array_split(error, 4)[2:])
        if not (last <= LARGE["rad"] or last < FALLING * before):  # NaN is large, and does not fall
            words = f"the tool is {error[-1]:.3g} {unit} from its reference, and that does not fall"
            yield Finding("error", "tool", float(result.t[-1]), float(last), words)


def _tool_error(result: RunLog) -> tuple[float, float] | None:
    if result.tool is None:
        return None
    late = np.array_split(result.tool.e1, 4)[-1]
    m, rad = (float(np.sqrt(np.mean(np.sum(late[:, k : k + 3] ** 2, axis=1)))) for k in (0, 3))
    return m, rad


def _deviation(result: RunLog) -> Iterator[Finding]:
    """An error that was large at some time, though it fell afterwards; a law at the tool has none of joints."""
    if result.tool is not None:
        return
    often, seconds = AT_THE_START
    moving = _by_unit(result, DEVIATION) + SHARE_OF_DEVIATION * _range_of_reference(result)
    moving = np.minimum(moving, LARGEST) + _yields(result)
    start = often * np.abs(result.e1[0]).max() + seconds * np.abs(result.e2[0]).max()
    share = np.abs(result.e1) / (moving + start)
    k, joint = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[k, joint] > 1.0:
        size, time, unit = (
            float(abs(result.e1[k, joint])),
            float(result.t[k]),
            unit_of(result, int(joint)),
        )
        degrees = f" ({np.rad2deg(size):.0f} deg)" if unit == "rad" else ""
        name = result.joint_names[joint]
        words = f"joint '{name}' was {size:.3g} {unit}{degrees} from its reference at {time:.3g} s"
        yield Finding("deviation", name, time, size, words)


def _effort(result: RunLog) -> Iterator[Finding]:
    """A torque beyond what the motor can give."""
    over = excess(result).effort
    limit = np.where(np.isfinite(over), np.abs(result.tau) - over, np.inf)[0]
    share = np.where(np.isfinite(over), over, 0.0) / limit
    if share.max() > _ROUNDING:
        joint = int(np.argmax(share.max(axis=0)))
        size, time = float(over[:, joint].max()), _first(result, share[:, joint] > _ROUNDING)
        name, force = result.joint_names[joint], force_unit_of(result, joint)
        words = (
            f"the torque of joint '{name}' passed its limit {limit[joint]:.4g} {force} by {size:.3g}, "
            f"from {time:.3g} s"
        )
        yield Finding("effort", name, time, size, words)


def _saturation(result: RunLog, start: int) -> Iterator[Finding]:
    """A torque that is at its limit for long, after the arm has come to its reference."""
    late = result.saturated[start:]
    share = late.mean(axis=0)
    joint = int(np.argmax(share))
    if share[joint] > SATURATED:
        name, time = (
            result.joint_names[joint],
            float(result.t[start + int(np.argmax(late[:, joint]))]),
        )
        words = f"joint '{name}' was at its torque limit in {share[joint]:.0%} of the ticks, from {time:.3g} s"
        yield Finding("saturation", name, time, float(share[joint]), words)


def _chatter(result: RunLog, start: int) -> Iterator[Finding]:
    """A torque that shakes: much more variation than its slow part, and not by the noise of sensors."""
    ripple = ripple_of(result, start)
    if ripple is None or not (shaking := chatters(result, ripple)).any():
        return
    joint = int(np.argmax(np.where(shaking, ripple.share, 0.0)))
    name, force = result.joint_names[joint], force_unit_of(result, joint)
    words = (
        f"the torque of joint '{name}' chatters: it varies by {ripple.variation[joint]:.3g} {force}/s, "
        f"where its motion needs {ripple.needed[joint]:.3g}"
    )
    yield Finding("chatter", name, float(result.t[start]), float(ripple.size[joint]), words)


def _end_of_start(result: RunLog) -> int:
    """Number of the first sample at which the arm has come to its reference, at most the middle of the run."""
    size = np.abs(result.e1).max(axis=1)
    arrived = size <= _ARRIVED * size[0]
    latest = int(_LATEST_START * (len(size) - 1))
    return min(int(np.argmax(arrived)) if arrived.any() else latest, latest)


def _errors_by_quarter(result: RunLog) -> Array:
    """Root-mean-square e1 of each quarter of the run, shape (4, nv)."""
    quarters = np.array_split(result.e1, 4)
    return np.array(
        [np.sqrt(np.mean((part if len(part) else result.e1) ** 2, axis=0)) for part in quarters]
    )


def _by_unit(result: RunLog, sizes: Mapping[str, float]) -> Array:
    """The size of each joint by its unit, shape (nv,)."""
    return np.array([sizes[unit_of(result, joint)] for joint in range(result.v.shape[1])])


def _yields(result: RunLog) -> Array:
    """How far a spring without a force sensor gives way to what pushed, shape (nv,); it has no moving reference."""
    controller = result.provenance["controller"]
    if controller.get("type") != "CompliantController":
        return np.zeros(result.v.shape[1])
    stiffness = np.array(controller["stiffness"])
    given: Array = np.abs(np.linalg.inv(stiffness)) @ np.abs(result.tau_ext).max(axis=0)
    return given


def _range_of_reference(result: RunLog) -> Array:
    """How far the reference of each joint goes, shape (nv,), by its velocity v + e2."""
    way = np.cumsum((result.v + result.e2)[:-1] * np.diff(result.t)[:, None], axis=0)
    span: Array = np.maximum(way.max(axis=0), 0.0) - np.minimum(way.min(axis=0), 0.0)
    return span


def _first(result: RunLog, happens: BoolArray) -> float:
    return float(result.t[np.argmax(happens)])
