"""Desired motions of a frame: a trajectory is a callable t -> `CartesianReference`.

All begin and end at rest. `waypoints` and `samples` are twice continuously differentiable splines through poses:
SciPy's cubic spline for the position and its rotation spline for the orientation, over a parameter that starts and
stops with a quintic law.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number, real, vector
from .._common.brief import shortly
from ..exceptions import DimensionError, ParameterError
from ..law.poses import CartesianReference, Pose, check_pose
from ..law.rotations import RotationVector, cross
from ..robot.arm_model import ArmModel

CartesianTrajectory: TypeAlias = Callable[[float], CartesianReference]
"""Maps a time [s] to the desired motion of a frame."""


def hold(
    at: ArmModel | Pose, q: ArrayLike | None = None, *, frame: str | None = None
) -> CartesianTrajectory:
    """Stay at a pose.

    Args:
        at: The pose; or an arm, for the pose of its frame in a configuration.
        q: That configuration, shape (nq,); `arm.ready` by default.
        frame: Name of the arm's frame; its tool frame by default.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ModelError: No such frame.
    """
    if isinstance(at, ArmModel):
        at = Pose(*at.frame_placement(at.ready if q is None else q, frame))
    return _Hold(_copied(check_pose("at", at)))


def line(
    start: Pose,
    displacement: ArrayLike,
    duration: float,
    *,
    rotation: ArrayLike = (0.0, 0.0, 0.0),
    begin: float = 0.0,
) -> CartesianTrajectory:
    """Move along a straight line, from rest to rest with minimum jerk, turning about a constant axis.

    Args:
        start: Pose at the beginning.
        displacement: Way of the origin in world axes, shape (3,) [m].
        duration: Time that it takes [s].
        rotation: Rotation vector of the turn in world axes, shape (3,), shorter than π [rad].
        begin: Time at which it begins [s].

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: A duration that is not positive, or half a turn or more.
    """
    start = check_pose("start", start)
    turn = vector("rotation", rotation, 3, "x, y, z")
    if np.linalg.norm(turn) >= np.pi:
        raise ParameterError("rotation", rotation, "shorter than π; take `waypoints` for more")
    way = vector("displacement", displacement, 3, "x, y, z")
    end = Pose(RotationVector(turn).matrix @ start.rotation, start.translation + way)
    duration = positive_number("duration", duration, "time in seconds")
    return waypoints((start, end), (begin, begin + duration))


def circle(
    start: Pose,
    radius: float,
    period: float,
    *,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    towards: ArrayLike = (1.0, 0.0, 0.0),
    ramp: float = 2.0,
) -> CartesianTrajectory:
    """Move on a circle with constant orientation, from rest, without end.

    Args:
        start: Pose at the beginning, on the circle.
        radius: Its radius [m].
        period: Time of a turn at full speed [s].
        normal: Axis about which the origin turns, in world axes, shape (3,).
        towards: Direction from the start to the centre, made normal to the axis, shape (3,).
        ramp: Time to full speed [s].

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: A number that is not positive, or a direction along the axis.
    """
    n = vector("normal", normal, 3, "x, y, z")
    inwards = cross(cross(n, vector("towards", towards, 3, "x, y, z")), n)
    if not np.linalg.norm(inwards) > 1e-9:
        raise ParameterError("towards", towards, "a direction that is not along the normal")
    inwards /= np.linalg.norm(inwards)
    return _Circle(
        _copied(check_pose("start", start)),
        positive_number("radius", radius, "length in m"),
        2.0 * np.pi / positive_number("period", period, "time in seconds"),
        (inwards, cross(inwards, n) / np.linalg.norm(n)),
        positive_number("ramp", ramp, "time in seconds"),
    )


def waypoints(poses: Sequence[Pose], times: Sequence[float]) -> CartesianTrajectory:
    """Pass smoothly through poses at given times, without a stop in between.

    Position, orientation, velocity and acceleration are continuous; before the first pose and after the last the
    frame rests. From one pose to the next it turns the short way.

    Args:
        poses: At least two poses.
        times: One time for each, strictly increasing [s].

    Raises:
        DimensionError: Wrong shape or kind, or not one time for each pose.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: Times that do not increase.
    """
    knots = [check_pose(f"poses[{i}]", pose) for i, pose in enumerate(poses)]
    instants = vector("times", times, None, "number of poses").copy()
    if len(knots) < 2 or len(knots) != len(instants):
        words = "one for each of at least two poses"
        raise DimensionError("times", words, f"{len(instants)} for {len(knots)}")
    if not (np.diff(instants) > 0.0).all():
        raise ParameterError("times", list(times), "strictly increasing")
    return _PoseSpline(knots, instants)


def samples(t: ArrayLike, positions: ArrayLike, quaternions: ArrayLike) -> CartesianTrajectory:
    """Pass smoothly through recorded poses; the motion is that of `waypoints`.

    Args:
        t: Times, strictly increasing, shape (n,) [s].
        positions: Origins, shape (n, 3) [m].
        quaternions: Orientations as unit quaternions (x, y, z, w), shape (n, 4).

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ParameterError: Times that do not increase.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 (SciPy is loaded when needed)

    times = vector("t", t, None, "n")
    rows = real("positions", positions, "shape (n, 3)"), real("quaternions", quaternions, "(n, 4)")
    for name, array, width in zip(("positions", "quaternions"), rows, (3, 4), strict=True):
        if array.shape != (len(times), width):
            raise DimensionError(name, f"shape ({len(times)}, {width})", f"shape {array.shape}")
    if not np.allclose(np.linalg.norm(rows[1], axis=1), 1.0, atol=1e-3):
        raise DimensionError("quaternions", "quaternions (x, y, z, w) of unit length", "others")
    rotations = Rotation.from_quat(rows[1]).as_matrix()
    return waypoints([Pose(*pair) for pair in zip(rotations, rows[0], strict=True)], times.tolist())


class _Hold:
    def __init__(self, pose: Pose) -> None:
        self._reference = CartesianReference(pose, np.zeros(6), np.zeros(6))

    def __repr__(self) -> str:
        return f"hold({shortly(self._reference.pose)})"

    def __call__(self, t: float) -> CartesianReference:
        del t
        return self._reference


class _Circle:
    def __init__(
        self,
        start: Pose,
        radius: float,
        speed: float,
        directions: tuple[Array, Array],
        ramp: float,
    ) -> None:
        self._start, self._radius, self._speed, self._ramp = start, radius, speed, ramp
        self._inwards, self._along = directions

    def __repr__(self) -> str:
        return f"circle(radius={self._radius:.4g} m, period={2.0 * np.pi / self._speed:.4g} s)"

    def __call__(self, t: float) -> CartesianReference:
        phase, rate, curvature = self._phase(t)
        cos, sin = np.cos(phase), np.sin(phase)
        out = (1.0 - cos) * self._inwards + sin * self._along
        tangent = sin * self._inwards + cos * self._along
        normal = cos * self._inwards - sin * self._along
        zero, r = np.zeros(3), self._radius
        return CartesianReference(
            Pose(self._start.rotation, self._start.translation + r * out),
            np.concatenate([r * rate * tangent, zero]),
            np.concatenate([r * (curvature * tangent + rate**2 * normal), zero]),
        )

    def _phase(self, t: float) -> tuple[float, float, float]:
        """Phase with its rates: at rest with continuous acceleration, at full speed after the ramp."""
        speed, T = self._speed, self._ramp
        x = min(max(t / T, 0.0), 1.0)
        phase = speed * (T * (x**3 - x**4 / 2.0) + max(t - T, 0.0))
        return phase, speed * x**2 * (3.0 - 2.0 * x), speed / T * 6.0 * x * (1.0 - x)


class _PoseSpline:
    """A path of positions and rotations over a parameter that is a smooth function of time."""

    def __init__(self, knots: Sequence[Pose], times: Array) -> None:
        from scipy.interpolate import CubicSpline, make_interp_spline  # noqa: PLC0415 (when needed)
        from scipy.spatial.transform import Rotation, RotationSpline  # noqa: PLC0415

        self._times, at_rest = times, [(1, 0.0), (2, 0.0)]
        self._parameter = make_interp_spline(times, times, k=5, bc_type=(at_rest, at_rest))  # type: ignore[arg-type]
        self._position = CubicSpline(times, np.array([pose.translation for pose in knots]))
        rotations = Rotation.from_matrix(np.array([pose.rotation for pose in knots]))
        self._rotation = RotationSpline(times, rotations)

    def __repr__(self) -> str:
        t = self._times
        return f"waypoints({len(t)} poses from t = {t[0]:g} to {t[-1]:g} s)"

    def __call__(self, t: float) -> CartesianReference:
        t = min(max(t, self._times[0]), self._times[-1])
        x, rate, curvature = (float(self._parameter(t, order)) for order in range(3))
        x = min(max(x, self._times[0]), self._times[-1])
        position, rotation = self._position, self._rotation(x).as_matrix()
        slope, bend = [
            np.concatenate([position(x, order), rotation @ self._rotation(x, order)])
            for order in (1, 2)
        ]
        return CartesianReference(
            Pose(rotation, position(x)), rate * slope, rate**2 * bend + curvature * slope
        )


def _copied(pose: Pose) -> Pose:
    return Pose(*(np.array(part) for part in pose))
