"""One arm that an uncertainty allows, with its sensors and actuators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from ..control.imperfect import ImperfectController
from ..control.tool_view import AnyController
from ..robot.arm_model import ArmModel


@dataclass(frozen=True, eq=False, kw_only=True)
class PlantSample:
    """One arm that the uncertainty allows.

    Attributes:
        plant: The arm, for `simulate`.
        payload: Mass at the tool [kg].
        com: Its centre of mass in the payload frame's axes, shape (3,) [m].
        gyration: Its radius of gyration about the centre of mass [m].
        inertia_scale: Factor on the links' masses and inertias.
        viscous: Friction beyond the arm's own, shape (nv,) [N·m·s/rad or N·s/m].
        coulomb: The same, shape (nv,) [N·m or N].
        armature: Reflected rotor inertia, shape (nv,) [kg·m² or kg].
        torque_constant: Ratio of true to demanded torque, shape (nv,).
        tilt: Rotation of gravity about the world's x and y axes, shape (2,) [rad].
        position_noise: Standard deviation [rad or m].
        velocity_noise: Standard deviation [rad/s or m/s].
        delay: Of the measurements [ticks].
        seed: Of the noise.
    """

    plant: ArmModel
    payload: float
    com: Array
    gyration: float
    inertia_scale: float
    viscous: Array
    coulomb: Array
    armature: Array
    torque_constant: Array
    tilt: Array
    position_noise: float
    velocity_noise: float
    delay: int
    seed: int

    @property
    def is_imperfect(self) -> bool:
        """Whether sensors or actuators are not perfect."""
        noise = self.position_noise > 0.0 or self.velocity_noise > 0.0
        return bool(noise or self.delay > 0 or (self.torque_constant != 1.0).any())

    def wrap(self, controller: AnyController, *, noisy: bool = True) -> AnyController:
        """Return the controller behind this sample's sensors and actuators.

        Args:
            controller: Any controller; where the loop is perfect it comes back as it is.
            noisy: False leaves the noise out; delay and torque constants stay.
        """
        noisy = noisy and (self.position_noise > 0.0 or self.velocity_noise > 0.0)
        if not noisy and self.delay == 0 and (self.torque_constant == 1.0).all():
            return controller
        return ImperfectController(
            controller,
            position_noise=noisy * self.position_noise,
            velocity_noise=noisy * self.velocity_noise,
            delay=self.delay,
            torque_constant=self.torque_constant,
            seed=self.seed,
        )


def with_body(
    arm: ArmModel, mass: float, com: Array, gyration: float, frame: str | None
) -> ArmModel:
    """Return an arm with a payload of equal inertia about all axes.

    Args:
        arm: The arm.
        mass: Of the body [kg].
        com: Its centre of mass in the frame's axes, shape (3,) [m].
        gyration: Its radius of gyration [m].
        frame: Where it is fixed; the tool frame by default.
    """
    return arm.with_payload(mass, com, mass * gyration**2 * np.eye(3), frame)


def tilted(gravity: Array, tilt: Array) -> Array:
    """Return a vector turned about the world's axes x and y by two angles (Rodrigues' formula), shape (3,)."""
    angle = float(np.linalg.norm(tilt))
    if angle == 0.0:
        return gravity.copy()
    axis = np.array([tilt[0], tilt[1], 0.0]) / angle
    turned: Array = (
        np.cos(angle) * gravity
        + np.sin(angle) * np.cross(axis, gravity)
        + (1.0 - np.cos(angle)) * (axis @ gravity) * axis
    )
    return turned
