"""What a robot is for the loop: a state that is read, a torque that is written, and conventions written down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, positive, positive_number
from .._common.brief import brief_repr
from .._common.frozen import set_fields


class RobotState(NamedTuple):
    """What a robot reports in one of its cycles; arrays are copies.

    Attributes:
        time: By the robot's own clock [s]: cycles are counted with it, not with the computer's clock.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
        command: Torque that the robot has accepted and applies now, in the robot's own convention, shape (nv,)
            [N·m or N].
        tau_ext: The robot's own estimate of the external torque on its links, shape (nv,) [N·m or N]; zero where it has
            none.
    """

    time: float
    q: Array
    v: Array
    command: Array
    tau_ext: Array


@brief_repr("name", "period", "adds_gravity", "adds_friction")
@dataclass(frozen=True, eq=False, init=False)
class Conventions:
    """What a maker's interface expects and tolerates, in one place.

    Attributes:
        name: Of the robot.
        joint_names: In the order of its arrays.
        period: Of its cycle [s].
        effort: Largest absolute command, shape (nv,) [N·m or N].
        torque_rate: Largest change of the command in a second, shape (nv,) [N·m/s or N/s]; +inf where there is none.
        velocity: Speed beyond which the robot stops, shape (nv,) [rad/s or m/s].
        adds_gravity: Whether the robot adds the torque that holds its own weight to the command.
        adds_friction: Whether it adds a torque against its joints' friction.
        longest_gap: Cycles without a command after which the robot stops.
        notes: Frames, reflexes and what else a user has to know, one sentence each.

    Raises:
        ParameterError: A number that is not positive.
        DimensionError: A limit for another number of joints.
    """

    name: str
    joint_names: tuple[str, ...]
    period: float
    effort: Array
    torque_rate: Array
    velocity: Array
    adds_gravity: bool
    adds_friction: bool
    longest_gap: int
    notes: tuple[str, ...]

    def __init__(
        self,
        name: str,
        joint_names: tuple[str, ...],
        *,
        period: float,
        effort: ArrayLike,
        torque_rate: ArrayLike | None = None,
        velocity: ArrayLike,
        adds_gravity: bool,
        adds_friction: bool,
        longest_gap: int = 20,
        notes: tuple[str, ...] = (),
    ) -> None:
        nv = len(joint_names)
        rate = (
            np.full(nv, np.inf) if torque_rate is None else positive("torque_rate", torque_rate, nv)
        )
        set_fields(
            self,
            name=name,
            joint_names=tuple(joint_names),
            period=positive_number("period", period, "time in seconds"),
            effort=per_joint("effort", positive("effort", effort, nv), nv),
            torque_rate=per_joint("torque_rate", rate, nv),
            velocity=per_joint("velocity", positive("velocity", velocity, nv), nv),
            adds_gravity=bool(adds_gravity),
            adds_friction=bool(adds_friction),
            longest_gap=longest_gap,
            notes=tuple(notes),
        )


class Robot(Protocol):
    """A robot that takes torques; write one for your own: five methods and its conventions.

    `read` and `write` alternate, one pair per cycle of the robot.
    """

    @property
    def conventions(self) -> Conventions:
        """What its interface expects."""

    def start(self) -> None:
        """Begin torque control; the robot holds itself until the first `write`.

        Raises:
            RobotError: The robot refuses; the error says what the robot reports.
        """

    def read(self) -> RobotState:
        """Wait for the next cycle and return its state.

        Raises:
            RobotError: The robot has stopped.
        """

    def gravity(self, q: Array) -> Array:
        """Return the torque that the robot adds by itself to hold its weight, shape (nv,); zero where it adds none.

        Args:
            q: Configuration, shape (nq,).
        """

    def write(self, command: Array) -> None:
        """Send the torque of this cycle, in the robot's own convention.

        Args:
            command: Shape (nv,) [N·m or N].

        Raises:
            RobotError: The robot has stopped.
        """

    def stop(self) -> None:
        """End torque control; the robot holds itself again. Safe to call twice, and after an error."""
