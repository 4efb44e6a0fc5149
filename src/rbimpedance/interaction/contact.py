"""Environments that touch the arm: walls, still or moving, and a scripted push."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number, read_only, size, vector
from .._common.brief import brief_repr
from .._common.frozen import Converted, Gain, set_fields
from ..exceptions import ParameterError
from ..robot.arm_model import ArmModel
from .wrenches import AppliedWrench, FrameWrench

_RATE_STEP = 1e-6  # s: half the span of the central difference of a wall's displacement


def _point(name: str, value: ArrayLike) -> Array:
    return read_only(vector(name, value, 3, "x, y, z"))


def _unit_vector(name: str, value: ArrayLike) -> Array:
    direction = vector(name, value, 3, "x, y, z")
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise ParameterError(name, value, "a nonzero vector")
    return read_only(direction / length)


@brief_repr()
@dataclass(frozen=True, eq=False)
class Wall:
    """A flat, frictionless spring-damper surface that pushes on one point of the arm and never pulls.

    With x the frame's origin, n the normal and p a point of the surface, δ = nᵀ(p - x) is the penetration, and the arm
    feels the force

        f = n·max(0, k·δ + d·δ̇)    where δ > 0,    0 elsewhere.

    The surface is fixed, or moves along its normal.

    Attributes:
        point: A point of the surface, at displacement zero, shape (3,) [m].
        normal: Unit normal, out of the wall towards the free side, shape (3,).
        stiffness: k [N/m].
        damping: d [N·s/m].
        frame: Frame whose origin touches; the arm's tool frame by default.
        displacement: The surface's displacement along its normal as a function of time [m]; None for a still one. Its
            rate is taken by a central difference over 2 µs.

    Raises:
        DimensionError: A point or a normal that is not a vector of three numbers.
        NonFiniteError: One that holds NaN or infinity.
        ParameterError: A normal of length zero, a stiffness that is not positive, or a negative damping.
    """

    point: Gain = Converted(_point)
    normal: Gain = Converted(_unit_vector)
    stiffness: Converted[float, float] = Converted(
        partial(positive_number, meaning="stiffness in N/m")
    )
    damping: Converted[float, float] = Converted(size, 0.0)
    _: KW_ONLY
    frame: str | None = None
    displacement: Callable[[float], float] | None = None

    def penetration(self, arm: ArmModel, t: float, q: ArrayLike) -> float:
        """Return δ [m]: how deep the frame's origin is in the wall; negative while it is free.

        Args:
            arm: The arm.
            t: Time [s].
            q: Configuration, shape (nq,).
        """
        _, origin = arm.frame_placement(q, self.frame)
        travel, _ = self.travel(np.array([t]))[0]
        return float(self.normal @ (self.point - origin) + travel)

    def travel(self, times: Array) -> Array:
        """Return displacement [m] and speed [m/s] of the surface at n times, (n, 2), or (1, 2) if it is fixed.

        Args:
            times: The times, shape (n,) [s].
        """
        surface = self.displacement
        if surface is None:
            return np.zeros((1, 2))
        h = _RATE_STEP
        rows = [(surface(t), (surface(t + h) - surface(t - h)) / (2.0 * h)) for t in times.tolist()]
        return np.array(rows, dtype=np.float64)

    def force(self, arm: ArmModel, t: float, q: ArrayLike, v: ArrayLike) -> float:
        """Return how hard the wall pushes along its normal [N], never negative.

        Args:
            arm: The arm.
            t: Time [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """
        depth = self.penetration(arm, t, q)
        return 0.0 if depth <= 0.0 else self._push(depth, t, v, self._normal_row(arm, q))

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return Jᵀ n f; see `Interaction.torque`."""
        depth = self.penetration(arm, t, q)
        if depth <= 0.0:
            return np.zeros(arm.nv)
        row = self._normal_row(arm, q)
        torque: Array = row * self._push(depth, t, v, row)
        return torque

    def wrenches(self, arm: ArmModel, t: float, q: Array, v: Array) -> tuple[AppliedWrench, ...]:
        """Return the contact force, without moment; see `FrameInteraction.wrenches`."""
        force = self.force(arm, t, q, v) * self.normal
        return (AppliedWrench(self.frame or arm.tool_frame, np.append(force, np.zeros(3))),)

    def _normal_row(self, arm: ArmModel, q: ArrayLike) -> Array:
        """The row nᵀJ: how fast the frame leaves the wall at unit joint speeds, shape (nv,)."""
        row: Array = self.normal @ arm.jacobian(q, self.frame)[:3]
        return row

    def _push(self, depth: float, t: float, v: ArrayLike, row: Array) -> float:
        _, speed = self.travel(np.array([t]))[0]
        rate = speed - float(row @ np.asarray(v))
        return float(max(0.0, self.stiffness * depth + self.damping * rate))


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class Push:
    """A scripted push, as of a human hand: a wrench that swells, holds and fades.

    Its size is sin²(π/2·(t - start)/rise) of the whole while it rises and the mirror image while it fades: the
    force and its rate are continuous.

    Attributes:
        wrench: Force [N] and moment [N·m] at its largest, at the frame's origin, shape (6,).
        start: When it begins [s].
        duration: How long it lasts in all [s].
        rise: How long it takes to rise, and to fade, at most half of the duration [s]; half of it by default.
        frame: Frame that is pushed; the arm's tool frame by default.
        expressed_in: Axes of the wrench: "world", or "local" for the frame's own axes.

    Raises:
        DimensionError: The wrench is not a vector of six numbers.
        NonFiniteError: The wrench holds NaN or infinity.
        ParameterError: A time that is not a positive number, a rise longer than half of the duration, or unknown axes.
    """

    wrench: Array
    start: float
    duration: float
    rise: float
    frame: str | None
    expressed_in: str
    _acting: FrameWrench

    def __init__(
        self,
        wrench: ArrayLike,
        start: float,
        duration: float,
        rise: float | None = None,
        *,
        frame: str | None = None,
        expressed_in: str = "world",
    ) -> None:
        duration = positive_number("duration", duration, "length of the push in seconds")
        rise = positive_number("rise", duration / 2.0 if rise is None else rise, "time in seconds")
        if rise > duration / 2.0:
            raise ParameterError(
                "rise", rise, f"at most half of the duration, {duration / 2.0:g} s"
            )
        set_fields(
            self,
            wrench=read_only(vector("wrench", wrench, 6, "force, moment")),
            start=size("start", start),
            duration=duration,
            rise=rise,
            frame=frame,
            expressed_in=expressed_in,
            _acting=FrameWrench(lambda t: self.share(t) * self.wrench, frame, expressed_in),
        )

    def share(self, t: ArrayLike) -> Array:
        """Return the push's size as a share of the whole, from 0 to 1, of the shape of t.

        Args:
            t: Times [s].
        """
        since = np.asarray(t, dtype=np.float64) - self.start
        flank = np.clip(np.minimum(since, self.duration - since) / self.rise, 0.0, 1.0)
        return np.asarray(np.sin(np.pi / 2.0 * flank) ** 2)

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return Jᵀ(q) w(t); see `Interaction.torque`."""
        return self._acting.torque(arm, t, q, v)

    def wrenches(self, arm: ArmModel, t: float, q: Array, v: Array) -> tuple[AppliedWrench, ...]:
        """Return the wrench in world axes; see `FrameInteraction.wrenches`."""
        return self._acting.wrenches(arm, t, q, v)
