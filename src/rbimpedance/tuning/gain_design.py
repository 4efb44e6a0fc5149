"""Gains from bounds: k1, k2 and the scheme's margin, and whether any gains tolerate the bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array, whole_number
from ..control.default_gains import (
    GAIN_HEADROOM,
    K1_OVER_ROOT_K2,
    K2_OVER_MISMATCH,
    slope_at_zero,
    usual_surfaces,
)
from ..control.protocol import Backend
from ..exceptions import ParameterError
from ..law.input_gain import LARGEST_MARGIN, gain_limit, needed_margin, tolerates
from ..law.limits import Limits
from ..law.surfaces import Surface
from ..robot.arm_model import ArmModel
from ..robot.units import FORCE
from ..trajectories import Trajectory
from .coupling import Coupling, coupling_of
from .mismatch import Mismatch, balanced_model, measure_with_gains
from .motions import MotionMargin, sample_motions
from .plant_sample import PlantSample
from .uncertainty import Uncertainty

TORQUE_FLOOR = 0.5
"""Smallest torque mismatch that gains are made for [N·m or N]: it lets a joint reach its surface without one, too."""

_K2_OVER_RATE = 1.5
_FAR_TOO_MUCH = 30.0
"""An error from the disturbance that is estimated at this many times what is allowed is refused without a simulation.
Estimates are too large by up to that much, those from noise are not."""
_LEAST_RATE = (
    1e-9  # of a disturbance [rad/s³]: without a margin there is no bound, even if it is constant
)
_JUMP = 2.0 / np.e
"""About s = 0 a disturbance w moves s by p/(p + 1/H)²: by H²·abs(ẇ) and by 2/e·H·abs(w) at most (norms in L1)."""

_LARGEST_ERROR = np.pi
_BISECTIONS = 40


@dataclass(frozen=True, eq=False, kw_only=True)
class Search:
    """How a proposal is searched for.

    Attributes:
        samples: Number of plants that the bounds are taken over, extremes first; as many more have every range at one
            of its ends, joint by joint.
        instants: Number of instants along the trajectory.
        seed: Of everything random.
        backend: Who computes the simulations; "compiled" is several times as fast once it is compiled, see `simulate`,
            and scans all samples, not the extreme ones alone.
        on_tick: Called with (ticks done, ticks in all) of every simulation, for a progress bar.
        remedy_time: Time after which no more remedies are tried for a task that is not feasible; 0 for none [s].

    Raises:
        ParameterError: A time below 0, a count that is not a whole number, or too small.
    """

    samples: int = 24
    instants: int = 25
    seed: int = 0
    backend: Backend = "compiled"
    on_tick: Callable[[int, int], None] | None = None
    remedy_time: float = 4.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not self.remedy_time >= 0.0:
            raise ParameterError("remedy_time", self.remedy_time, "a time in seconds, 0 or more")
        whole_number("samples", self.samples, 1)
        whole_number("instants", self.instants, 1)
        whole_number("seed", self.seed)


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignTask(Search):
    """Requirements of the gains, and how they are searched for.

    Attributes:
        arm: The arm as it is modelled.
        uncertainty: What is not known of it.
        trajectory: Desired motion.
        dt: Control period [s].
        surface: Sliding surface; None for a fast terminal one with the smoothing that suits best.
        duration: Length of the trajectory that counts [s].
        accuracy: Largest error abs(e1) allowed after the reaching phase [rad or m].
        spread: How far motions leave the trajectory.
        limits: Of the actuators; None for none.
    """

    arm: ArmModel
    uncertainty: Uncertainty
    trajectory: Trajectory
    dt: float
    surface: Surface | None = None
    duration: float = 5.0
    accuracy: float = 1e-3
    spread: MotionMargin = field(default_factory=MotionMargin)
    limits: Limits | None = None


class Measured(NamedTuple):
    """What the bounds of a design come from.

    Attributes:
        model: The controller's model.
        payload: Payload in that model [kg].
        samples: Plants that were measured.
        mismatch: How far they are from the model.
        coupling: Whether the joints' laws are stable together; None for the blocks of a tool.
    """

    model: ArmModel
    payload: float
    samples: Sequence[PlantSample]
    mismatch: Mismatch
    coupling: Coupling | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """Gains and what they rest on; arrays have shape (nv,).

    Attributes:
        measured: The model, the samples, and the bounds over them.
        surface: Sliding surface.
        k1: Gain of the root.
        k2: Gain of the integral.
        margin: Of the matched scheme, the same for all joints; infinite where there is none.
        gain_limit: Input gain that the scheme tolerates at this margin; 0 where there is none.
        error: Error e1 that the scheme leaves, from the largest rate of the disturbance [rad or m].
        noise_error: Error e1 caused by sensor noise [rad or m].
        noise_torque: Torque caused by sensor noise, about [N·m or N].
        joint: Joint that stands in the way, or None.
        reason: Why, or empty.
    """

    measured: Measured
    surface: Surface
    k1: Array
    k2: Array
    margin: float
    gain_limit: float
    error: Array
    noise_error: Array
    noise_torque: Array
    joint: int | None = None
    reason: str = ""


def foundations(task: DesignTask, measured: Measured) -> dict[str, Any]:
    """Return what every proposal names as its foundations, by field."""
    return {
        "nominal": task.arm,
        "arm": measured.model,
        "payload": measured.payload,
        "uncertainty": task.uncertainty,
        "dt": task.dt,
        "limits": task.limits,
    }


def measure_task(task: DesignTask) -> Measured:
    """Choose the model that the controller uses, and measure how far the plants are from it."""
    arm, uncertainty, dt = task.arm, task.uncertainty, task.dt
    motions = sample_motions(
        arm, task.trajectory, task.duration, dt, task.instants, task.seed, task.spread
    )
    model, payload = balanced_model(arm, uncertainty, motions, dt)
    samples = uncertainty.sample(arm, task.samples, seed=task.seed)
    samples += uncertainty.corners(arm, task.samples, seed=task.seed)
    mismatch, gains = measure_with_gains(model, samples, motions, dt)
    return Measured(model, payload, samples, mismatch, coupling_of(gains))


def design(
    task: DesignTask, measured: Measured, *, slower: float = 1.0, firmer: float = 1.0
) -> Design:
    """Return the gains that the bounds call for, and whether any gains tolerate them.

    Args:
        task: The requirements.
        measured: From `measure_task`.
        slower: Factor on the margin beyond what the input gain needs.
        firmer: Factor on k2 beyond what the mismatch needs; k1 follows.
    """
    surfaces = usual_surfaces() if task.surface is None else (task.surface,)
    k1, k2 = _k1_and_k2(task, measured.mismatch, surfaces[0], slower)
    k1, k2 = np.sqrt(firmer) * k1, firmer * k2
    designs = [_on_surface(task, measured, surface, k1, k2, slower) for surface in surfaces]
    best = min(designs, key=lambda found: float(found.error.max()))
    if best.noise_error.max() > 0.0 and np.isfinite(best.margin):
        least = (
            best.margin
        )  # a gentler surface is to lower the noise, not to leave room for a faster scheme
        designs = [_on_surface(task, measured, on, k1, k2, slower, least) for on in surfaces]
        precise = [found for found in designs if found.error.max() <= task.accuracy / 2.0]
        best = min(precise, key=lambda found: float(found.noise_torque.max()), default=best)
    return _checked_design(task, best)


def _on_surface(
    task: DesignTask,
    measured: Measured,
    surface: Surface,
    k1: Array,
    k2: Array,
    slower: float,
    least: float = 1.0,
) -> Design:
    """The design with one surface, not checked yet."""
    mismatch, uncertainty = measured.mismatch, task.uncertainty
    margin, limit = _margin(task, mismatch, surface, slower, least)
    s = _left_on_surface(mismatch, margin * task.dt)
    slope, zero = slope_at_zero(surface, task.arm.nv), np.zeros(task.arm.nv)
    return Design(
        measured=measured,
        surface=surface,
        k1=k1,
        k2=k2,
        margin=margin,
        gain_limit=limit,
        error=_error_on(surface, s),
        noise_error=uncertainty.position_noise
        + _error_on(surface, zero + uncertainty.velocity_noise),
        noise_torque=mismatch.inertia * _noise_acceleration(task, slope, k1, margin),
    )


def _left_on_surface(mismatch: Mismatch, horizon: float) -> Array:
    """Return the value of s that the disturbance leaves with H = margin·dt, shape (nv,)."""
    if not np.isfinite(horizon):
        return np.full(mismatch.disturbance.shape, np.inf)
    rate = np.maximum(mismatch.disturbance_rate, _LEAST_RATE)
    s: Array = horizon * np.minimum(horizon * rate, _JUMP * mismatch.disturbance)
    return s / mismatch.gain_low


def _noise_acceleration(task: DesignTask, slope: Array, k1: Array, margin: float) -> Array:
    """Noise in the feed-forward and in the reaching term, which is at most 2·s/H and k1·abs(s)^½."""
    on_q, on_v = task.uncertainty.position_noise, task.uncertainty.velocity_noise
    noise = on_v + slope * on_q
    u = np.minimum(2.0 * noise / (margin * task.dt), k1 * np.sqrt(noise))
    acceleration: Array = slope * on_v + u
    return acceleration


def _error_on(surface: Surface, s: Array) -> Array:
    """Return the e1 at rest for a value s of the surface, shape (nv,); infinite beyond half a turn."""
    below, above = np.zeros_like(s), np.full_like(s, _LARGEST_ERROR)
    beyond = surface.value(above, below) < s
    for _ in range(_BISECTIONS):
        middle = (below + above) / 2.0
        small = surface.value(middle, np.zeros_like(s)) < s
        below, above = np.where(small, middle, below), np.where(small, above, middle)
    return np.where(beyond, np.inf, above * (s > 0.0))


def _margin(
    task: DesignTask, mismatch: Mismatch, surface: Surface, slower: float, least: float = 1.0
) -> tuple[float, float]:
    """Margin of the scheme, and the largest input gain that it tolerates with it."""
    slope_step = float(slope_at_zero(surface, task.arm.nv).max()) * task.dt
    low, high = mismatch.gain_low / GAIN_HEADROOM, mismatch.gain_high * GAIN_HEADROOM
    delay = task.uncertainty.delay
    margin = max(slower * needed_margin(low, high, delay, slope_step), least)
    if not np.isfinite(margin) or not tolerates(margin, low, high, delay, slope_step):
        return np.inf, 0.0
    return margin, gain_limit(low, margin, delay, slope_step)


def _k1_and_k2(
    task: DesignTask, mismatch: Mismatch, surface: Surface, slower: float
) -> tuple[Array, Array]:
    """Gains of the root and the integral.

    k2 = 3·τ̄/m covers the mismatch with room for the transient, and k1 = 2.2·√(k2/g) keeps the effective gains g·k1,
    g·k2 well damped at the smallest input gain g. What is more than the certificate needs, 1.5 times the
    disturbance's rate, is given up with the root of how much slower a delayed loop has to be than a prompt one, and
    as far as the noise of s, η, would make an acceleration k1·√η of the mismatch's size.
    """
    g, uncertainty = mismatch.gain_low, task.uncertainty
    prompt = replace(task, uncertainty=uncertainty.but(delay=0))
    late, early = (_margin(t, mismatch, surface, slower)[0] for t in (task, prompt))
    slowness = min(late, LARGEST_MARGIN) / min(early, LARGEST_MARGIN)
    acceleration = np.maximum(mismatch.torque, TORQUE_FLOOR) / mismatch.inertia
    slope = slope_at_zero(surface, task.arm.nv)
    noise = uncertainty.velocity_noise + slope * uncertainty.position_noise
    k2 = K2_OVER_MISMATCH * acceleration / np.sqrt(slowness)
    share = K1_OVER_ROOT_K2 * np.sqrt(k2 / g * noise) / acceleration
    k2 = np.maximum(k2 / (1.0 + share) ** 2, _K2_OVER_RATE * mismatch.disturbance_rate / g)
    return K1_OVER_ROOT_K2 * np.sqrt(k2 / g), k2


def _checked_design(task: DesignTask, found: Design) -> Design:
    """Add the joint that stands in the way, and why, where there is one."""
    names, mismatch, units = task.arm.joint_names, found.measured.mismatch, task.arm.position_units
    if not np.isfinite(found.margin):
        joint = (
            mismatch.joint_high
            if mismatch.gain_high * mismatch.gain_low > 1.0
            else mismatch.joint_low
        )
        reason = (
            f"joint '{names[joint]}' responds with {mismatch.gain_low:.2g} to {mismatch.gain_high:.2g} times the "
            f"acceleration that the model expects; with a delay of {task.uncertainty.delay} ticks at dt = "
            f"{task.dt:g} s no margin up to {LARGEST_MARGIN:g} tolerates that"
        )
        return replace(found, joint=joint, reason=reason)
    excess = found.error / _FAR_TOO_MUCH + found.noise_error
    joint = int(np.argmax(excess))
    unit = units[joint]
    if excess[joint] > task.accuracy:
        reason = (
            f"joint '{names[joint]}' would have a remaining error of about {found.error[joint]:.2g} {unit} from the "
            f"disturbance and {found.noise_error[joint]:.2g} {unit} from noise, above the requested "
            f"{task.accuracy:g}: its disturbance changes at {mismatch.disturbance_rate[joint]:.3g} {unit}/s³, and an "
            "input gain of "
            f"{mismatch.gain_low:.2g} to {mismatch.gain_high:.2g} needs a margin of {found.margin:.3g}"
        )
        return replace(found, joint=joint, reason=reason)
    limit = task.arm.effort_limit
    if task.limits is not None:
        limit = np.broadcast_to(task.limits.effort, limit.shape)
    joint = int(np.argmax(found.noise_torque / limit))
    if found.noise_torque[joint] > limit[joint]:
        reason = (
            f"noise would take {found.noise_torque[joint]:.3g} {FORCE[units[joint]]} of joint '{names[joint]}', "
            f"which has {limit[joint]:g}"
        )
        return replace(found, joint=joint, reason=reason)
    return found
