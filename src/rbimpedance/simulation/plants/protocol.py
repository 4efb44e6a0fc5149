"""The form that every plant has."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

from ..._common.arrays import Array
from ...interaction import Interaction
from ...robot.arm_model import ArmModel

PlantStateT = TypeVar("PlantStateT")

SPEED_BOUND = 1e4
"""A joint faster than this has diverged [rad/s or m/s]."""


class Motion(NamedTuple):
    """Where links are and how fast.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,) [rad/s or m/s].
    """

    q: Array
    v: Array


@runtime_checkable
class Plant(Protocol[PlantStateT]):
    """What `simulate` moves, where it is more than an `ArmModel`: a second engine, or drives that yield and lag.

    A plant is pure: what changes is in its state, a tuple of arrays and of such tuples. It shares no model with a
    controller; one that is given an arm copies it.
    """

    @property
    def arm(self) -> ArmModel:
        """Its links: sizes, names, and the kinematics by which environments act on them."""

    def begin(self, q: Array, v: Array, h: float) -> PlantStateT:
        """Return the state at the start of a run.

        Args:
            q: Configuration of the links, shape (nq,).
            v: Velocity of the links, shape (nv,) [rad/s or m/s].
            h: Length of the steps to come [s].

        Raises:
            ParameterError: The plant cannot be integrated with steps that long.
        """

    def motion(self, state: PlantStateT) -> Motion:
        """Return how the links move."""

    def measured(self, state: PlantStateT) -> Motion:
        """Return the encoders' measurement of that."""

    def external_torque(self, state: PlantStateT, environment: Interaction, t: float) -> Array:
        """Return what the world does to the links, shape (nv,) [N·m or N]: the environment, and the plant's contacts.

        Args:
            state: At that time.
            environment: What pushes on the arm.
            t: Time [s].
        """

    def acceleration(self, state: PlantStateT, tau: Array, tau_ext: Array) -> Array:
        """Return the acceleration of the links, shape (nv,) [rad/s² or m/s²].

        Args:
            state: At that time.
            tau: Torque that the controller demands, shape (nv,) [N·m or N].
            tau_ext: From `external_torque`.
        """

    def step(
        self, state: PlantStateT, tau: Array, environment: Interaction, t: float, h: float
    ) -> PlantStateT:
        """Return the state after one step of the physics.

        Args:
            state: At its beginning.
            tau: Torque that the controller demands, held, shape (nv,) [N·m or N].
            environment: What pushes on the arm.
            t: Time at the beginning [s].
            h: Length [s].
        """
