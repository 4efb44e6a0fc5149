"""The six arms of the standard study: what a controller may know of each, and the gains that follow from the rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from ..._common.arrays import Array
from ...law.impedance import Impedance
from ...robot.arm_model import ArmModel
from ...robot.load import load_robot
from ...trajectories import cosine
from ...tuning import GainProposal, MotionMargin, Uncertainty, propose_gains
from ..definition import Task

DT = 1e-3
"""Control period [s]."""

ARMATURE = 0.1
"""Reflected rotor inertia of every joint, which the controllers know [kg·m²]."""

AMPLITUDE, PERIOD = 0.25, 4.0
"""The fastest motion [rad], [s]."""

DELAY = 2
"""Ticks from a measurement to the torque that it leads to, at most."""

ACCURACY = 5e-3
"""Error that the gains are proposed for [rad]."""


@dataclass(frozen=True)
class Arm:
    """One of the six.

    Attributes:
        name: For `load_robot`.
        payload: Largest payload [kg].
        pose: About which it moves: angles from the zero configuration [rad].
        lock: Joints of its gripper.
    """

    name: str
    payload: float
    pose: tuple[float, ...]
    lock: tuple[str, ...] = ()

    def model(self) -> ArmModel:
        """Return what controllers know: the description, rotors, and no friction."""
        return load_robot(self.name, lock=self.lock, armature=ARMATURE).with_friction(0.0, 0.0)

    def task(self) -> Task:
        """Return what controllers are made for."""
        arm = self.model()
        return Task(
            robot=self.name,
            arm=arm,
            impedance=Impedance(mass=1.0, damping=10.0, stiffness=20.0),
            dt=DT,
            proposal=self.proposal(arm),
        )

    def proposal(self, arm: ArmModel) -> GainProposal:
        """Return the gains for everything that is not known, at once."""
        motion = cosine(arm, center=posture(arm), amplitude=AMPLITUDE, period=PERIOD)
        return propose_gains(
            arm,
            self.unknown(),
            motion,
            DT,
            q0=motion(0.0).q,
            spread=MotionMargin(acceleration=4.0),
            accuracy=ACCURACY,
        )

    def unknown(self) -> Uncertainty:
        """Return what the controllers do not know."""
        return Uncertainty(
            payload=self.payload,
            inertia_scale=(0.9, 1.1),
            viscous=0.5,
            coulomb=0.3,
            payload_com=((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1)),
            position_noise=1e-4,
            velocity_noise=1e-3,
            delay=DELAY,
        )


_PANDA_FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
ARMS: Mapping[str, Arm] = MappingProxyType(
    {
        arm.name: arm
        for arm in (
            Arm("panda", 2.0, (0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8), _PANDA_FINGERS),
            Arm("ur5", 2.0, (0.0, -1.2, 1.6, -1.9, -1.5, 0.0)),
            Arm("z1", 1.0, (0.0, 1.0, -1.2, 0.2, 0.0, 0.0), ("jointGripper",)),
            Arm("xarm7", 2.0, (0.0, -0.4, 0.0, 1.2, 0.0, 1.6, 0.0)),
            Arm("kinova", 1.0, (0.0, 2.9, 1.9, 0.6, 2.6, 0.0)),
            Arm("talos_arm", 2.0, (0.6, 0.2, -1.4, 0.0, 0.0, 0.0), ("gripper_left_joint",)),
        )
    }
)
"""By name."""

ROBOTS: Mapping[str, Callable[[], Task]] = MappingProxyType(
    {name: partial(Arm.task, arm) for name, arm in ARMS.items()}
)
"""What the study takes."""


def posture(arm: ArmModel) -> Array:
    """Return the configuration about which an arm of the study moves, shape (nq,)."""
    angles = np.array(ARMS[arm.name].pose)
    return arm.integrate(arm.zero, angles)
