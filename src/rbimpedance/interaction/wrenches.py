"""What the environment does to the arm: every `Interaction` gives the joint torque tau_ext that it exerts.

Wrenches and joint torques as functions of time are here; walls and pushes are in contact.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, vector
from .._common.brief import brief_repr, shortly
from ..exceptions import ParameterError
from ..robot.arm_model import ArmModel

TimeFunction: TypeAlias = Callable[[float], ArrayLike]
"""Maps a time [s] to a vector."""


class Constant:
    """A vector that does not change: `value` at every time."""

    def __init__(self, value: Array) -> None:
        self.value = value

    def __repr__(self) -> str:
        return shortly(self.value)

    def __call__(self, t: float) -> Array:
        """Return the value."""
        del t
        return self.value


@runtime_checkable
class Interaction(Protocol):
    """Anything that pushes on the arm."""

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return tau_ext, shape (nv,) [N·m or N].

        Args:
            arm: The arm that is pushed.
            t: Time [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """


class AppliedWrench(NamedTuple):
    """Where a wrench acts, and which.

    Attributes:
        frame: Name of the frame at whose origin it acts.
        wrench: Force [N] and moment [N·m] on the robot in world axes, shape (6,).
    """

    frame: str
    wrench: Array


@runtime_checkable
class FrameInteraction(Interaction, Protocol):
    """An interaction that acts at frames and can say where: for pictures and for wrench sensors."""

    def wrenches(self, arm: ArmModel, t: float, q: Array, v: Array) -> tuple[AppliedWrench, ...]:
        """Return the wrenches that act, those of zero size included.

        Args:
            arm: The arm that is pushed.
            t: Time [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """


def wrench_at(arm: ArmModel, frame: str | None, acting: Iterable[AppliedWrench], q: Array) -> Array:
    """Return the sum of wrenches, moved to a frame's origin, in world axes, shape (6,) [N, N·m].

    Args:
        arm: The arm that is pushed.
        frame: Name of the frame; the tool frame by default.
        acting: The wrenches.
        q: Configuration, shape (nq,).
    """
    total, own = np.zeros(6), frame or arm.tool_frame
    for place, wrench in acting:
        total += wrench
        if place != own:
            arms = [arm.frame_placement(q, name)[1] for name in (place, own)]
            total[3:] += np.cross(arms[0] - arms[1], wrench[:3])
    return total


def says_where(interaction: Interaction) -> bool:
    """Whether all that pushes at frames says where, so that its wrench is known."""
    if isinstance(interaction, Sum):
        return all(says_where(part) for part in interaction.parts)
    return isinstance(interaction, FrameInteraction | JointTorque | Nothing)


@brief_repr("function", "frame", "expressed_in")
class FrameWrench:
    """A wrench on a named frame, constant or as a function of time: tau_ext = Jᵀ(q) w(t).

    Args:
        wrench: Force [N] and moment [N·m] at the frame's origin, shape (6,), or a function of time that gives them.
        frame: Name of the frame; the arm's tool frame by default.
        expressed_in: Axes of the wrench: "world", or "local" for the frame's own axes.

    Raises:
        DimensionError: A constant wrench that is not a vector of six numbers.
        NonFiniteError: A constant wrench that holds NaN or infinity.
        ParameterError: `expressed_in` is neither "world" nor "local".
    """

    def __init__(
        self,
        wrench: ArrayLike | TimeFunction,
        frame: str | None = None,
        expressed_in: str = "world",
    ) -> None:
        if expressed_in not in ("world", "local"):
            raise ParameterError("expressed_in", expressed_in, '"world" or "local"')
        self.function = _as_function("wrench", wrench, 6, "force, moment")
        self.frame = frame
        self.expressed_in = expressed_in

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return Jᵀ(q) w(t); see `Interaction.torque`."""
        del v
        return arm.external_torque(q, self.function(t), self.frame, self.expressed_in)

    def wrenches(self, arm: ArmModel, t: float, q: Array, v: Array) -> tuple[AppliedWrench, ...]:
        """Return the wrench in world axes; see `FrameInteraction.wrenches`."""
        del v
        wrench = vector("wrench", self.function(t), 6, "force, moment")
        if self.expressed_in == "local":
            rotation, _ = arm.frame_placement(q, self.frame)
            wrench = np.concatenate([rotation @ wrench[:3], rotation @ wrench[3:]])
        return (AppliedWrench(self.frame or arm.tool_frame, wrench.copy()),)


@brief_repr("function")
class JointTorque:
    """A torque on the joints themselves, constant or as a function of time.

    Args:
        torque: Shape (nv,) [N·m or N], or a function of time that gives it.

    Raises:
        DimensionError: A constant torque that is not a vector of numbers.
        NonFiniteError: A constant torque that holds NaN or infinity.
    """

    def __init__(self, torque: ArrayLike | TimeFunction) -> None:
        self.function = _as_function("torque", torque, None, "nv")

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return the torque at time t; see `Interaction.torque`."""
        del q, v
        return vector("torque", self.function(t), arm.nv).copy()


@brief_repr("parts")
class Sum:
    """Several interactions at once: their torques add up.

    Args:
        *parts: The interactions.

    Raises:
        ParameterError: A part is no `Interaction`.
    """

    def __init__(self, *parts: Interaction) -> None:
        for i, part in enumerate(parts):
            if not isinstance(part, Interaction):
                raise ParameterError(f"parts[{i}]", part, "an Interaction: FrameWrench, Wall, ...")
        self.parts = parts

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return the sum of the torques; see `Interaction.torque`."""
        total = np.zeros(arm.nv)
        for part in self.parts:
            total += part.torque(arm, t, q, v)
        return total

    def wrenches(self, arm: ArmModel, t: float, q: Array, v: Array) -> tuple[AppliedWrench, ...]:
        """Return the wrenches of all parts that act at frames; see `FrameInteraction.wrenches`."""
        acting = (part for part in self.parts if isinstance(part, FrameInteraction))
        return tuple(wrench for part in acting for wrench in part.wrenches(arm, t, q, v))


class Nothing:
    """No environment: the arm moves freely."""

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return zeros; see `Interaction.torque`."""
        del t, q, v
        return np.zeros(arm.nv)


EnvironmentLike: TypeAlias = Interaction | ArrayLike | TimeFunction
"""What `as_interaction` takes: an interaction, a constant vector, or a function of time."""


def as_interaction(wrench: EnvironmentLike | None) -> Interaction:
    """Return what `simulate` means by its `wrench` argument.

    Args:
        wrench: An `Interaction`; None for free motion; a wrench (6,), or a function of time that gives one, at the
            tool frame in world axes.

    Raises:
        DimensionError: None of these.
        NonFiniteError: A constant wrench that holds NaN or infinity.
    """
    if wrench is None:
        return Nothing()
    if isinstance(wrench, Interaction):
        return wrench
    return FrameWrench(wrench)


def _as_function(
    name: str, value: ArrayLike | TimeFunction, size: int | None, symbol: str
) -> TimeFunction:
    if callable(value):
        return value
    return Constant(vector(name, value, size, symbol).copy())
